#pragma once

#include <cstdint>
#include <string>

namespace strata {

/// The report of `strata info` as a block of text: a label and its lines for each part of the report that is there.
/// report_json  what --json prints
std::string info_text(const std::string& report_json);

/// 1234567 as "1,234,567".
std::string with_commas(uint64_t count);

}  // namespace strata
