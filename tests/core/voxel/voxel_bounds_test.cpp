#include "core/voxel/voxel_bounds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

TEST(OccupiedBounds, AreThoseOfTheVoxels) {
    for (uint64_t seed = 0; seed < 20; ++seed)
        for (const bool with_full : {false, true}) {
            const VoxelCube voxels = random_boxes(2, 1 + int(seed % 4), seed);
            VoxelTree tree = tree_of(voxels, with_full);
            tree.frame.origin = Vec3d(1, 2, 3);
            tree.frame.voxel_size = 0.5;
            Box3d expected;
            for (uint32_t x = 0; x < voxels.side(); ++x)
                for (uint32_t y = 0; y < voxels.side(); ++y)
                    for (uint32_t z = 0; z < voxels.side(); ++z)
                        if (voxels.at(x, y, z)) expected.extend(cell_box(tree.frame, 4, {x, y, z}));
            EXPECT_EQ(occupied_bounds(tree).min, expected.min);
            EXPECT_EQ(occupied_bounds(tree).max, expected.max);
        }
    EXPECT_TRUE(occupied_bounds(tree_of(VoxelCube(2))).empty());
}

// The depth is the finest with no more cells than allowed, and its cells are those with voxels.
TEST(CoarseCells, AreThoseWithVoxels) {
    for (const bool with_full : {false, true}) {
        const VoxelCube voxels = random_boxes(3, 30, 7);
        const VoxelTree tree = tree_of(voxels, with_full);
        for (int depth = 2; depth <= 6; depth += 2) {
            std::set<std::array<uint32_t, 3>> expected;
            const int shift = 6 - depth;
            for (uint32_t x = 0; x < voxels.side(); ++x)
                for (uint32_t y = 0; y < voxels.side(); ++y)
                    for (uint32_t z = 0; z < voxels.side(); ++z)
                        if (voxels.at(x, y, z)) expected.insert({x >> shift, y >> shift, z >> shift});
            const CellList list = coarse_cells(tree, expected.size());
            EXPECT_EQ(list.depth, depth);
            EXPECT_EQ((std::set<std::array<uint32_t, 3>>(list.cells.begin(), list.cells.end())), expected);
            EXPECT_EQ(list.cells.size(), expected.size());
            EXPECT_EQ(coarse_cells(tree, expected.size() - 1).depth, depth - 2);
        }
    }
    EXPECT_TRUE(coarse_cells(tree_of(VoxelCube(2)), 100).cells.empty());
}

}  // namespace
}  // namespace strata
