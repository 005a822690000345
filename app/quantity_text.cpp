#include "app/quantity_text.h"

#include <cstdio>
#include <iterator>

namespace strata {

std::string with_commas(uint64_t count) {
    std::string text = std::to_string(count);
    for (int at = int(text.size()) - 3; at > 0; at -= 3) text.insert(size_t(at), 1, ',');
    return text;
}

std::string size_text(uint64_t bytes) {
    constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB"};
    double value = double(bytes);
    size_t unit = 0;
    // What would print as 1024.0 is one of the next unit.
    for (; value >= 1023.95 && unit + 1 < std::size(kUnits); ++unit) value /= 1024.0;
    char text[32];
    std::snprintf(text, sizeof text, "%.*f %s", unit == 0 ? 0 : 1, value, kUnits[unit]);
    return text;
}

}  // namespace strata
