#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "io/format.h"

namespace strata {

/// What `strata info` says of a mesh: its headers say little or nothing, so all of it is read.
/// exact  also what its surface is like
nlohmann::ordered_json mesh_report(const std::string& path, const Format& format, bool exact, uint64_t memory_bytes);

}  // namespace strata
