#pragma once

#include <string>

namespace strata {

/// The report of `strata info` as a block of text: a label and its lines for each part of the report that is there.
/// report_json  what --json prints
std::string info_text(const std::string& report_json);

}  // namespace strata
