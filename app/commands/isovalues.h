#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/options.h"
#include "core/error.h"

namespace strata {

/// The numbers of an option "1,2.5".
/// throws  Error{usage}: other words
std::vector<double> parse_list(std::string_view flag, const std::string& text);

/// The isovalues of --iso "1,2.5".
/// throws  Error{usage}: other words, or a number twice
std::vector<double> parse_isovalues(const std::string& text);

/// What is thrown where --iso is missing: names the values that `what` has. least > greatest: it has none
Error isovalue_expected(const std::string& what, double least, double greatest);

/// "0.5", "-1000 to 1176"
std::string value_text(double value);
std::string values_text(double least, double greatest);

}  // namespace strata
