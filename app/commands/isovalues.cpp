#include "app/commands/isovalues.h"

#include <algorithm>
#include <cstdio>

#include "core/error.h"

namespace strata {

std::vector<double> parse_list(std::string_view flag, const std::string& text) {
    std::vector<double> values;
    for (const std::string& item : split_list(text)) values.push_back(parse_number(flag, item));
    return values;
}

std::vector<double> parse_isovalues(const std::string& text) {
    const std::vector<double> values = parse_list("--iso", text);
    for (auto value = values.begin(); value != values.end(); ++value)
        if (std::find(values.begin(), value, *value) != value) throw Error(ErrorKind::usage, "--iso: " + value_text(*value) + " is there twice");
    return values;
}

std::string value_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.9g", value);
    return text;
}

std::string values_text(double least, double greatest) { return value_text(least) + " to " + value_text(greatest); }

Error isovalue_expected(const std::string& what, double least, double greatest) {
    return {ErrorKind::usage, "--iso V is expected; the values of " + what +
                                  (least <= greatest ? " are from " + values_text(least, greatest) : " are all not a number")};
}

}  // namespace strata
