#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace strata {

/// The report of `strata info` as a block of text: a label and its lines for each part of the report that is there.
std::string info_text(const nlohmann::ordered_json& report);

/// 1234567 as "1,234,567".
std::string with_commas(uint64_t count);

}  // namespace strata
