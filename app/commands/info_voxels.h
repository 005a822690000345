#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "io/format.h"

namespace strata {

/// What `strata info` says of a voxel file: by its header and directory; with `exact`, every block is
/// checked, and so is the tree as far as it fits in memory.
nlohmann::ordered_json voxel_report(const std::string& path, const Format& format, bool exact, uint64_t memory_bytes, int threads);

}  // namespace strata
