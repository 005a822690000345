#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/voxel/voxel_tree.h"

namespace strata {

/// Voxels of a small cube, a byte each: what tests compare trees with.
struct VoxelCube {
    int levels = 1;  // of 4^3 masks
    std::vector<uint8_t> occupied;

    explicit VoxelCube(int level_count) : levels(level_count), occupied(size_t{1} << 6 * level_count) {}
    uint32_t side() const { return uint32_t{1} << 2 * levels; }
    size_t index(uint32_t x, uint32_t y, uint32_t z) const { return (size_t(x) * side() + y) * side() + z; }
    bool at(uint32_t x, uint32_t y, uint32_t z) const { return occupied[index(x, y, z)] != 0; }
    void set(uint32_t x, uint32_t y, uint32_t z, bool value = true) { occupied[index(x, y, z)] = value; }
    uint64_t count() const;
};

/// Voxels for which a function of their coordinates is true.
VoxelCube cube_where(int levels, const std::function<bool(uint32_t x, uint32_t y, uint32_t z)>& is_occupied);
/// Random ones, `share` of all.
VoxelCube random_cube(int levels, double share, uint64_t seed);
/// Random boxes from single voxels to a quarter of the side, `count` of them, some on multiples of 4 or 16.
VoxelCube random_boxes(int levels, int count, uint64_t seed);
/// A cell of side 2^shift is occupied where any of its voxels is; written to all its voxels.
VoxelCube coarsened(const VoxelCube& voxels, int shift);

/// The tree of the voxels, in a frame of their levels: `with_full`: wholly occupied cells have no nodes below them.
VoxelTree tree_of(const VoxelCube& voxels, bool with_full = false);

}  // namespace strata
