#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "io/format.h"

namespace strata {

/// What `strata info` says of the grids of a `.vdb` file.
nlohmann::ordered_json vdb_report(const std::string& path, const Format& format);

}  // namespace strata
