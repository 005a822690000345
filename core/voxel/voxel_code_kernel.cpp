#include "core/voxel/voxel_code_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/math/morton.h"
#include "core/simd_target.h"

namespace strata {
namespace {

constexpr size_t kSegment = 256;  // points at a time: their coordinates stay in the nearest cache
constexpr uint32_t kOutside = 0x80000000;

inline void find_coordinates(double scale, double offset, double side, const int32_t* quanta, size_t n, uint32_t* out) {
    for (size_t i = 0; i < n; ++i) {
        const double t = double(quanta[i]) * scale + offset;
        const bool inside = (t >= 0.0) & (t < side);
        const int32_t whole = int32_t(inside ? t : 0.0);
        out[i] = inside ? uint32_t(whole) : kOutside;
    }
}

inline void find_codes(const VoxelFromQuanta& map, const int32_t* x, const int32_t* y, const int32_t* z, size_t n, uint64_t* codes) {
    alignas(64) std::array<uint32_t, kSegment> cell_x, cell_y, cell_z;
    for (size_t begin = 0; begin < n; begin += kSegment) {
        const size_t count = std::min(kSegment, n - begin);
        find_coordinates(map.scale.x(), map.offset.x(), map.side, x + begin, count, cell_x.data());
        find_coordinates(map.scale.y(), map.offset.y(), map.side, y + begin, count, cell_y.data());
        find_coordinates(map.scale.z(), map.offset.z(), map.side, z + begin, count, cell_z.data());
        for (size_t i = 0; i < count; ++i) {
            const uint64_t code = octant_code(cell_x[i], cell_y[i], cell_z[i]);
            codes[begin + i] = ((cell_x[i] | cell_y[i] | cell_z[i]) & kOutside) != 0 ? kNoVoxel : code;
        }
    }
}

STRATA_KERNEL_BASELINE void find_codes_baseline(const VoxelFromQuanta& map, const int32_t* x, const int32_t* y, const int32_t* z, size_t n,
                                                uint64_t* codes) {
    find_codes(map, x, y, z, n, codes);
}
STRATA_KERNEL_AVX2 void find_codes_avx2(const VoxelFromQuanta& map, const int32_t* x, const int32_t* y, const int32_t* z, size_t n,
                                        uint64_t* codes) {
    find_codes(map, x, y, z, n, codes);
}
STRATA_KERNEL_AVX512 void find_codes_avx512(const VoxelFromQuanta& map, const int32_t* x, const int32_t* y, const int32_t* z, size_t n,
                                            uint64_t* codes) {
    find_codes(map, x, y, z, n, codes);
}

}  // namespace

VoxelFromQuanta::VoxelFromQuanta(const VoxelFrame& frame, const Quantization& quantization)
    : scale(quantization.scale / frame.voxel_size), offset((quantization.offset - frame.origin) / frame.voxel_size), side(frame.side()) {
    // Half a unit in the last place of scale, offset, origin and voxel size as they were typed, and of the operations here and on
    // the points: within the frame, where |quanta * scale| <= side + |offset|, at most 2^-51 of each of the terms below. Twice that
    // is still 1e-5 of a millimeter voxel at UTM northings. Farther out it stays below the room that frames leave around a cloud.
    constexpr double kRounding = 0x1p-50, kMostRounding = 0x1p-10;
    for (int axis = 0; axis < 3; ++axis)
        offset[axis] += std::min(
            kRounding * (side + (std::abs(quantization.offset[axis]) + std::abs(frame.origin[axis])) / frame.voxel_size), kMostRounding);
}

void find_voxel_codes(const VoxelFromQuanta& map, const int32_t* x, const int32_t* y, const int32_t* z, std::span<uint64_t> codes,
                      SimdLevel level) {
    const auto kernel = level == SimdLevel::avx512 ? find_codes_avx512 : level == SimdLevel::avx2 ? find_codes_avx2 : find_codes_baseline;
    kernel(map, x, y, z, codes.size(), codes.data());
}

}  // namespace strata
