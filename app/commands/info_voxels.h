#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "io/format.h"

namespace strata {

/// What `strata info` says of a voxel file: by its header and directory; with `exact`, all of it is read and checked.
/// threads  to read with
nlohmann::ordered_json voxel_report(const std::string& path, const Format& format, bool exact, int threads);

}  // namespace strata
