#include "core/math/quantization.h"

#include <algorithm>
#include <cmath>

namespace strata {
namespace {

// The whole q that the value is on, or the q between two whole ones.
double snapped_quantum(double value, double scale, double offset) {
    const double q = (value - offset) / scale;
    if (!std::isfinite(q)) return q;
    // Half a unit in the last place of value, offset and scale as they were typed, and of the two operations here: at most
    // 5 * 2^-53 of (|value| + |offset|) / scale. Three times that (2^-49) is still 2e-5 quanta at UTM northings in millimeters.
    const double rounding = std::min(0x1p-49 * (std::abs(value) + std::abs(offset)) / scale, 0.25);
    const double nearest = std::nearbyint(q);
    return std::abs(q - nearest) <= rounding ? nearest : q;
}

}  // namespace

double first_quantum_from(double value, double scale, double offset) { return std::ceil(snapped_quantum(value, scale, offset)); }

double last_quantum_to(double value, double scale, double offset) { return std::floor(snapped_quantum(value, scale, offset)); }

}  // namespace strata
