#pragma once

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "core/voxel/mesh_voxels.h"

namespace strata {

/// All the cells of a small frame, one by one.
struct CellGrid {
    uint32_t side = 0;
    std::vector<uint8_t> cells;

    explicit CellGrid(uint32_t s) : side(s), cells(size_t(s) * s * s) {}
    uint8_t& at(uint32_t x, uint32_t y, uint32_t z) { return cells[(size_t(x) * side + y) * side + z]; }
    uint8_t at(uint32_t x, uint32_t y, uint32_t z) const { return cells[(size_t(x) * side + y) * side + z]; }
    uint64_t count() const { return uint64_t(std::count(cells.begin(), cells.end(), 1)); }
    bool operator==(const CellGrid&) const = default;

    void add(const VoxelBlock& block) {
        for (int bit = 0; bit < 64; ++bit) {
            if (!(block.mask >> bit & 1)) continue;
            const std::array<uint32_t, 3> cell = coordinates_of_code(block.code << 6 | uint64_t(bit));
            const uint32_t size = uint32_t{1} << 2 * block.height;
            for (uint32_t x = cell[0] * size; x < (cell[0] + 1) * size; ++x)
                for (uint32_t y = cell[1] * size; y < (cell[1] + 1) * size; ++y)
                    for (uint32_t z = cell[2] * size; z < (cell[2] + 1) * size; ++z) at(x, y, z) = 1;
        }
    }
};

/// What a mesh's blocks are, checked for order.
inline std::vector<VoxelBlock> blocks_of(const TriangleMesh& mesh, const VoxelFrame& frame, const MeshVoxelSettings& settings) {
    std::vector<VoxelBlock> blocks;
    uint64_t next = 0;  // voxel block
    voxelize_mesh(mesh, frame, settings, [&](const VoxelBatch& batch) {
        EXPECT_TRUE(batch.counts.empty() && batch.colors.empty() && batch.normals.empty());
        for (const VoxelBlock& block : batch.blocks) {
            EXPECT_NE(block.mask, 0u);
            EXPECT_GE(block.code << 6 * block.height, next);
            next = (block.code + 1) << 6 * block.height;
            blocks.push_back(block);
        }
    });
    EXPECT_LE(next, uint64_t{1} << (6 * frame.levels - 6));
    return blocks;
}

inline CellGrid cells_of(const TriangleMesh& mesh, const VoxelFrame& frame, VoxelKind kind) {
    CellGrid dense(frame.side());
    for (const VoxelBlock& block : blocks_of(mesh, frame, {.kind = kind})) dense.add(block);
    return dense;
}

inline uint64_t count_voxels(const std::vector<VoxelBlock>& blocks) {
    uint64_t count = 0;
    for (const VoxelBlock& block : blocks) count += uint64_t(std::popcount(block.mask)) << 6 * block.height;
    return count;
}

}  // namespace strata
