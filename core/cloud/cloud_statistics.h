#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/math/vec.h"

namespace strata {

/// Least and most of one component of an attribute, as values: stored * scale + offset. Empty where no point has a value.
struct ValueRange {
    double min = std::numeric_limits<double>::infinity();
    double max = -std::numeric_limits<double>::infinity();
    bool empty() const { return !(min <= max); }
};

/// What the points of a cloud are, whatever its header says.
struct CloudStatistics {
    uint64_t points = 0;
    Box3d bounds;                                     // world
    std::vector<std::vector<ValueRange>> ranges;      // [attribute][component]
    std::array<uint64_t, 256> points_by_return{};     // by "return number"
    std::array<uint64_t, 256> points_by_class{};      // by "classification"
    int rgb_bits = 0;                                 // 8, 16, or 0: no color, or all black
};

/// Reads every point of a cloud once. "No data" and NaN are left out of the ranges.
/// throws  what the source throws
CloudStatistics measure_cloud(const PointSource& source, int threads);

}  // namespace strata
