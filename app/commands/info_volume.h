#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "io/format.h"

namespace strata {

/// What `strata info` says of a volume: its header, and the range of its values, for which all of it is read.
nlohmann::ordered_json volume_report(const std::string& path, const Format& format);

}  // namespace strata
