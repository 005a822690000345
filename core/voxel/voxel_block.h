#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/math/morton.h"
#include "core/voxel/voxel_frame.h"

namespace strata {

// A mask of 4^3 cells in Morton order, x highest: bit octant_code(x & 3, y & 3, z & 3) is cell (x, y, z). So each
// byte is one of the eight octants, in the order of octant digits, and each bit of a byte an octant of that.
inline constexpr uint64_t kFullMask = ~uint64_t{0};

/// Bit of a cell in the mask that holds it: x, y, z may be whole coordinates, of which the lowest two bits count.
constexpr int mask_bit(uint32_t x, uint32_t y, uint32_t z) { return int(octant_code(x & 3, y & 3, z & 3)); }

/// Coordinates of a code, the inverse of octant_code.
constexpr std::array<uint32_t, 3> coordinates_of_code(uint64_t code) {
    return {gather_bits_by_3(code >> 2), gather_bits_by_3(code >> 1), gather_bits_by_3(code)};
}

/// 4^3 cells of side 4^height voxels, those in the mask wholly occupied.
struct VoxelBlock {
    uint64_t code = 0;  // octant_code of the block's coordinates in units of its own side, 4^(height + 1) voxels
    uint64_t mask = 0;  // never 0
    int height = 0;     // 0: of voxels. More only where voxels have no attributes

    bool operator==(const VoxelBlock&) const = default;
};

using VoxelColor = std::array<uint8_t, 3>;   // sRGB
using VoxelNormal = std::array<int8_t, 3>;   // of length about 127; zero: none

/// Which attributes voxels have.
struct VoxelAttributes {
    bool count = false;    // points in the voxel
    bool color = false;    // mean
    bool normal = false;   // mean
    bool opacity = false;  // along each axis, of the coarser cells; voxels themselves are opaque

    bool any_of_voxels() const { return count || color || normal; }
    bool operator==(const VoxelAttributes&) const = default;
};

/// A run of blocks in ascending order (of code << 6 * height, the first voxel block each covers), disjoint, and what is known of
/// their voxels: block after block, bit after bit.
struct VoxelBatch {
    std::vector<VoxelBlock> blocks;
    std::vector<uint32_t> counts;      // [voxels] or empty, as are the others
    std::vector<VoxelColor> colors;
    std::vector<VoxelNormal> normals;

    void clear() {
        blocks.clear();
        counts.clear();
        colors.clear();
        normals.clear();
    }
};

/// Takes batches in ascending order, from one thread at a time. What makes voxels calls it.
using VoxelSink = std::function<void(const VoxelBatch&)>;

}  // namespace strata
