#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "core/voxel/voxel_tree_builder.h"

namespace strata {

/// A dense grid of voxels, and trees made of it.
struct DenseVoxels {
    explicit DenseVoxels(int tree_levels) : levels(tree_levels), side(1u << 2 * tree_levels), solid(size_t(side) * side * side) {}

    size_t at(uint32_t x, uint32_t y, uint32_t z) const { return (size_t(x) * side + y) * side + z; }
    VoxelFrame frame() const { return {.origin = Vec3d(1, 2, 3), .voxel_size = 0.5, .levels = levels}; }

    /// Its blocks of voxels in Morton order.
    VoxelBatch batch() const {
        VoxelBatch batch;
        const uint64_t blocks = uint64_t{1} << 6 * (levels - 1);
        for (uint64_t code = 0; code < blocks; ++code) {
            const auto [bx, by, bz] = coordinates_of_code(code);
            VoxelBlock block = {.code = code};
            for (uint32_t bit = 0; bit < 64; ++bit) {
                const auto [x, y, z] = coordinates_of_code(bit);
                if (solid[at(4 * bx + x, 4 * by + y, 4 * bz + z)]) block.mask |= uint64_t{1} << bit;
            }
            if (block.mask != 0) batch.blocks.push_back(block);
        }
        return batch;
    }

    int levels;
    uint32_t side;
    std::vector<char> solid;
};

inline DenseVoxels random_grid(int levels, double share, uint32_t seed) {
    DenseVoxels grid(levels);
    std::mt19937 random(seed);
    std::bernoulli_distribution occupied(share);
    for (char& voxel : grid.solid) voxel = occupied(random);
    return grid;
}

/// A solid ball: has whole blocks of several sizes.
inline DenseVoxels ball_grid(int levels, double radius_share) {
    DenseVoxels grid(levels);
    const double middle = 0.5 * grid.side, radius = radius_share * grid.side;
    for (uint32_t x = 0; x < grid.side; ++x)
        for (uint32_t y = 0; y < grid.side; ++y)
            for (uint32_t z = 0; z < grid.side; ++z)
                grid.solid[grid.at(x, y, z)] = (Vec3d(x + 0.5, y + 0.5, z + 0.5).array() - middle).matrix().norm() < radius;
    return grid;
}

inline VoxelTree tree_of(const DenseVoxels& grid, const VoxelAttributes& attributes = {}) {
    VoxelTreeInMemory memory(grid.frame(), attributes);
    VoxelTreeBuilder builder(grid.frame(), attributes, memory);
    builder.add(grid.batch());
    builder.finish();
    return memory.take();
}

}  // namespace strata
