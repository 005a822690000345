#include "core/voxel/voxel_tree_builder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "core/error.h"
#include "tests/support/dense_voxels.h"

namespace strata {
namespace {

void expect_same(const VoxelTree& tree, const DenseVoxels& grid) {
    EXPECT_EQ(count_voxels(tree), uint64_t(std::count(grid.solid.begin(), grid.solid.end(), 1)));
    for (uint32_t x = 0; x < grid.side; ++x)
        for (uint32_t y = 0; y < grid.side; ++y)
            for (uint32_t z = 0; z < grid.side; ++z)
                ASSERT_EQ(is_occupied(tree, x, y, z), bool(grid.solid[grid.at(x, y, z)])) << x << " " << y << " " << z;
}

TEST(VoxelTreeBuilder, HoldsTheVoxelsThatWereAdded) {
    for (const double share : {0.0001, 0.01, 0.3, 0.9}) {
        const DenseVoxels grid = random_grid(3, share, 7);
        expect_same(tree_of(grid), grid);
    }
    for (const int levels : {1, 2, 3}) expect_same(tree_of(ball_grid(levels, 0.45)), ball_grid(levels, 0.45));
}

TEST(VoxelTreeBuilder, NothingAndOneVoxelAndEverything) {
    DenseVoxels grid(2);
    EXPECT_TRUE(tree_of(grid).empty());
    grid.solid[grid.at(13, 2, 7)] = 1;
    expect_same(tree_of(grid), grid);
    std::fill(grid.solid.begin(), grid.solid.end(), char(1));
    const VoxelTree whole = tree_of(grid);
    expect_same(whole, grid);
    EXPECT_EQ(whole.levels[0].full, std::vector<uint64_t>{kFullMask});
    EXPECT_TRUE(whole.levels[1].masks.empty());
}

// Full cells of any height give the tree that their voxels give.
TEST(VoxelTreeBuilder, LargeBlocksAreTheVoxelsTheyHold) {
    const DenseVoxels grid = ball_grid(4, 0.4);
    const VoxelTree plain = tree_of(grid);
    VoxelBatch merged;
    // Cells of 16 voxels that are whole, by the tree itself.
    const VoxelBatch all = grid.batch();
    std::map<uint64_t, std::vector<VoxelBlock>> parents;
    for (const VoxelBlock& block : all.blocks) parents[block.code >> 6].push_back(block);
    size_t large = 0;
    for (const auto& [code, blocks] : parents) {
        VoxelBlock whole = {.code = code, .height = 1};
        for (const VoxelBlock& block : blocks)
            if (block.mask == kFullMask) whole.mask |= uint64_t{1} << (block.code & 63);
        if (whole.mask != 0) merged.blocks.push_back(whole);
        large += whole.mask == kFullMask;
        for (const VoxelBlock& block : blocks)
            if (block.mask != kFullMask) merged.blocks.push_back(block);
    }
    ASSERT_GT(large, 0u);
    VoxelTreeInMemory memory(grid.frame(), {});
    VoxelTreeBuilder builder(grid.frame(), {}, memory);
    builder.add(merged);
    EXPECT_EQ(builder.finish().voxels, count_voxels(plain));
    const VoxelTree tree = memory.take();
    for (size_t level = 0; level < 4; ++level) {
        EXPECT_EQ(tree.levels[level].masks, plain.levels[level].masks);
        EXPECT_EQ(tree.levels[level].full, plain.levels[level].full);
    }
    EXPECT_FALSE(tree.levels[1].full.empty());
}

// Each attribute of each coarser cell against a sum over its voxels.
TEST(VoxelTreeBuilder, CoarserCellsAreMeansOfTheirVoxels) {
    const DenseVoxels grid = random_grid(2, 0.2, 3);
    VoxelBatch batch = grid.batch();
    std::mt19937 random(5);
    std::map<std::array<uint32_t, 3>, size_t> voxel_at;
    for (const VoxelBlock& block : batch.blocks)
        for (uint32_t bit = 0; bit < 64; ++bit) {
            if ((block.mask >> bit & 1) == 0) continue;
            voxel_at[coordinates_of_code(block.code << 6 | bit)] = batch.counts.size();
            batch.counts.push_back(1 + random() % 1000);
            batch.colors.push_back({uint8_t(random()), uint8_t(random()), uint8_t(random())});
            Vec3d normal = Vec3d(double(random() % 255), double(random() % 255), double(random() % 255)) - Vec3d::Constant(127);
            normal *= 127.0 / normal.norm();
            batch.normals.push_back({int8_t(std::lround(normal.x())), int8_t(std::lround(normal.y())), int8_t(std::lround(normal.z()))});
        }
    const VoxelAttributes all = {.count = true, .color = true, .normal = true, .opacity = true};
    VoxelTreeInMemory memory(grid.frame(), all);
    VoxelTreeBuilder builder(grid.frame(), all, memory);
    builder.add(batch);
    builder.finish();
    const VoxelTree tree = memory.take();
    EXPECT_EQ(tree.attributes[4].counts, batch.counts);
    EXPECT_EQ(tree.attributes[4].colors, batch.colors);
    EXPECT_EQ(tree.attributes[4].normals, batch.normals);

    for (int depth = 1; depth < 4; ++depth) {
        const uint32_t cells = 1u << depth, size = grid.side / cells;
        size_t checked = 0;
        for (uint64_t code = 0; code < uint64_t{1} << 3 * depth; ++code) {
            const auto [cx, cy, cz] = coordinates_of_code(code);
            uint64_t count = 0;
            Vec3d color = Vec3d::Zero(), normal = Vec3d::Zero();
            for (uint32_t x = cx * size; x < (cx + 1) * size; ++x)
                for (uint32_t y = cy * size; y < (cy + 1) * size; ++y)
                    for (uint32_t z = cz * size; z < (cz + 1) * size; ++z) {
                        const auto found = voxel_at.find({x, y, z});
                        if (found == voxel_at.end()) continue;
                        const size_t v = found->second;
                        count += batch.counts[v];
                        for (int c = 0; c < 3; ++c) color[c] += double(batch.counts[v]) * batch.colors[v][size_t(c)];
                        for (int c = 0; c < 3; ++c) normal[c] += double(batch.counts[v]) * batch.normals[v][size_t(c)];
                    }
            if (count == 0) continue;
            const int level = (depth - 1) / 2;
            uint32_t node = 0;
            if (level == 1) {
                const int bit = mask_bit(cx >> (depth - 2), cy >> (depth - 2), cz >> (depth - 2));
                node = tree.levels[0].child(0, bit);
            }
            const bool odd = depth % 2 == 1;
            const int bit = odd ? 8 * int(code & 7) : int(code & 63);
            const size_t cell = cell_index(tree, level, node, bit, odd);
            const CellAttributes& stored = tree.attributes[size_t(depth)];
            EXPECT_EQ(stored.counts[cell], count);
            for (int c = 0; c < 3; ++c) EXPECT_NEAR(stored.colors[cell][size_t(c)], color[c] / double(count), 0.5 + 1e-9);
            for (int c = 0; c < 3; ++c) EXPECT_NEAR(stored.normals[cell][size_t(c)], 127.0 * normal[c] / normal.norm(), 0.5 + 1e-9);
            ++checked;
        }
        EXPECT_EQ(checked, tree.attributes[size_t(depth)].counts.size());
    }
}

// A wall one voxel thick is opaque from the front at every depth, and thinner from the side with each. (There the rule takes
// columns for independent, a' = (1 - (1 - a)^2) / 2, while those of a wall hide one another: it is 3/8 after two depths where the
// truth is 1/4.)
TEST(VoxelTreeBuilder, ThinWallsStayOpaqueFromTheFront) {
    DenseVoxels wall(3);
    for (uint32_t y = 0; y < wall.side; ++y)
        for (uint32_t z = 0; z < wall.side; ++z) wall.solid[wall.at(21, y, z)] = 1;
    const VoxelTree tree = tree_of(wall, {.opacity = true});
    double side = 1.0;
    for (int depth = 5; depth > 0; --depth) {
        side = 0.5 * (1.0 - (1.0 - side) * (1.0 - side));
        ASSERT_FALSE(tree.attributes[size_t(depth)].opacities.empty());
        for (const auto& opacity : tree.attributes[size_t(depth)].opacities) {
            EXPECT_EQ(opacity[0], 255);
            EXPECT_EQ(opacity[1], std::lround(255.0 * side));
            EXPECT_EQ(opacity[2], std::lround(255.0 * side));
        }
    }
    EXPECT_TRUE(tree.attributes[6].opacities.empty());
}

// Of two voxels an axis, a cell is as opaque along an axis as the share of its columns that hold something.
TEST(VoxelTreeBuilder, OpacityIsTheShareOfColumns) {
    const DenseVoxels grid = random_grid(2, 0.3, 11);
    const VoxelTree tree = tree_of(grid, {.opacity = true});
    size_t cell = 0;
    for (uint64_t code = 0; code < 512; ++code) {
        const auto [x, y, z] = coordinates_of_code(code);
        std::array<std::array<bool, 4>, 3> columns = {};
        for (uint32_t i = 0; i < 8; ++i) {
            const uint32_t dx = i >> 2, dy = i >> 1 & 1, dz = i & 1;
            if (!grid.solid[grid.at(2 * x + dx, 2 * y + dy, 2 * z + dz)]) continue;
            columns[0][2 * dy + dz] = columns[1][2 * dx + dz] = columns[2][2 * dx + dy] = true;
        }
        if (std::count(columns[0].begin(), columns[0].end(), true) == 0) continue;
        ASSERT_LT(cell, tree.attributes[3].opacities.size());
        for (size_t axis = 0; axis < 3; ++axis)
            EXPECT_EQ(tree.attributes[3].opacities[cell][axis], std::lround(255.0 / 4 * double(std::count(columns[axis].begin(), columns[axis].end(), true))));
        ++cell;
    }
    EXPECT_EQ(cell, tree.attributes[3].opacities.size());
}

// Full cells are opaque, and so is what holds nothing else.
TEST(VoxelTreeBuilder, FullCellsAreOpaque) {
    const DenseVoxels grid = ball_grid(3, 0.45);
    const VoxelTree tree = tree_of(grid, {.opacity = true});
    ASSERT_FALSE(tree.levels[1].full.empty());
    size_t checked = 0;
    for (uint32_t node = 0; node < tree.levels[1].masks.size(); ++node)
        for (int bit = 0; bit < 64; ++bit)
            if ((tree.levels[1].full_mask(node) >> bit & 1) != 0) {
                EXPECT_EQ(tree.attributes[4].opacities[cell_index(tree, 1, node, bit, false)], (std::array<uint8_t, 3>{255, 255, 255}));
                ++checked;
            }
    EXPECT_GT(checked, 0u);
}

TEST(VoxelTree, IndexRefusesWhatIsNoTree) {
    const VoxelTree good = tree_of(random_grid(2, 0.005, 1));
    ASSERT_NE(good.levels[0].masks[0], kFullMask);
    VoxelTree tree = good;
    tree.levels[1].masks.pop_back();
    EXPECT_THROW(index_tree(tree), Error);
    tree = good;
    tree.levels[1].masks[0] = 0;
    EXPECT_THROW(index_tree(tree), Error);
    tree = good;
    tree.levels[0].full = {uint64_t{1} << std::countr_zero(~tree.levels[0].masks[0])};
    EXPECT_THROW(index_tree(tree), Error);
    tree = good;
    tree.levels[0].masks.clear();
    EXPECT_THROW(index_tree(tree), Error);
    tree = good;
    EXPECT_NO_THROW(index_tree(tree));
}

TEST(VoxelTree, BytesPresent) {
    EXPECT_EQ(bytes_present(0), 0u);
    for (int bit = 0; bit < 64; ++bit) EXPECT_EQ(bytes_present(uint64_t{1} << bit), 1u << bit / 8);
    EXPECT_EQ(bytes_present(kFullMask), 255u);
    EXPECT_EQ(bytes_present(0xff00000080000001), 0x89u);
}

}  // namespace
}  // namespace strata
