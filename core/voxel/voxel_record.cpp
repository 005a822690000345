#include "core/voxel/voxel_record.h"

#include <cmath>

namespace strata {

VoxelColor mean_color(const VoxelSums& sums, int rgb_bits) {
    VoxelColor color;
    if (sums.count == 1) {
        for (size_t i = 0; i < 3; ++i) color[i] = uint8_t(sums.color[i] >> (rgb_bits - 8));
        return color;
    }
    const uint64_t half = rgb_bits > 8 ? 0 : sums.count / 2, divisor = rgb_bits > 8 ? sums.count << 8 : sums.count;
    for (size_t i = 0; i < 3; ++i) {
        const uint64_t sum = sums.color[i] + half;
        // Dividing 32 bits takes a third of the time.
        color[i] = (sum | divisor) <= UINT32_MAX ? uint8_t(uint32_t(sum) / uint32_t(divisor)) : uint8_t(sum / divisor);
    }
    return color;
}

VoxelNormal mean_normal(const VoxelSums& sums) {
    const double x = double(sums.normal[0]), y = double(sums.normal[1]), z = double(sums.normal[2]);
    const double length = std::sqrt(x * x + y * y + z * z);
    if (length == 0.0) return {};
    const auto component = [&](double value) { return int8_t(std::round(127.0 * value / length)); };
    return {component(x), component(y), component(z)};
}

}  // namespace strata
