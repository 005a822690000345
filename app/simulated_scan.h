#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/simulate/scene.h"
#include "core/simulate/survey.h"
#include "io/output_file.h"

namespace strata {

/// Scans the scene into a LAS file: 1.4, format 7. The same bytes whatever the threads.
/// on_progress  gets the points written so far; may be empty
/// returns      bytes of the file
/// throws       Error{usage, io}
uint64_t write_simulated_scan(const std::string& path, const VillageScene& scene, const SurveySettings& settings, int threads,
                              bool overwrite, Durability durability, const std::function<void(uint64_t points)>& on_progress);

}  // namespace strata
