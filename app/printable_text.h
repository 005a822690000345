#pragma once

#include <string>

namespace strata {

/// The text without control characters: what comes from a file is data, and nothing in it may move the cursor or hide a line.
std::string printable(const std::string& text);

}  // namespace strata
