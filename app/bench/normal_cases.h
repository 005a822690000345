#pragma once

#include <optional>

#include "app/bench/bench_scene.h"
#include "app/bench/report.h"

namespace strata {

/// Normals from neighbors against those of the true surface: noise x neighbors, names normals/NOISE/K.
/// returns  nothing where settings.only asks for none of them
std::optional<BenchSection> run_normal_cases(BenchScene& scene, const BenchSettings& settings);

}  // namespace strata
