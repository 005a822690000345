#include "core/voxel/brick_voxels.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "core/error.h"
#include "core/voxel/voxel_tree_builder.h"

namespace strata {
namespace {

VoxelTree tree_of(const BrickVoxels& voxels, const VoxelFrame& frame) {
    VoxelTreeInMemory memory(frame, {});
    VoxelTreeBuilder builder(frame, {}, memory);
    uint64_t next = 0;
    voxels.emit([&](const VoxelBatch& batch) {
        for (const VoxelBlock& block : batch.blocks) {
            ASSERT_GE(block.code << 6 * block.height, next);
            ASSERT_NE(block.mask, 0u);
            next = (block.code << 6 * block.height) + (block.height == 0 ? 1 : 0);
        }
        builder.add(batch);
    });
    builder.finish();
    return memory.take();
}

using Places = std::set<std::array<int, 3>>;

// Every lattice point of a box is asked for.
void expect_places(const VoxelTree& tree, const Places& places, int low, int high) {
    EXPECT_EQ(count_voxels(tree), places.size());
    const Vec3d base = (tree.frame.origin / tree.frame.voxel_size).array() + 0.5;
    for (int x = low; x < high; ++x)
        for (int y = low; y < high; ++y)
            for (int z = low; z < high; ++z) {
                const Vec3d at = Vec3d(x, y, z) - base;
                const bool inside = at.minCoeff() >= 0.0 && at.maxCoeff() < double(tree.frame.side());
                const bool found = inside && is_occupied(tree, uint32_t(at.x()), uint32_t(at.y()), uint32_t(at.z()));
                ASSERT_EQ(found, places.count({x, y, z}) > 0) << x << " " << y << " " << z;
            }
}

void add_cube_to(Places& places, int x0, int y0, int z0, int side) {
    for (int x = 0; x < side; ++x)
        for (int y = 0; y < side; ++y)
            for (int z = 0; z < side; ++z) places.insert({x0 + x, y0 + y, z0 + z});
}

TEST(BrickVoxels, BricksAndCubesLandWhereTheirPointsAre) {
    BrickVoxels voxels;
    Places places;
    std::mt19937_64 random(3);
    for (const auto& [x0, y0, z0] : {std::array{-8, 0, 16}, std::array{8, -16, 0}, std::array{0, 0, 8}, std::array{24, 24, 24}}) {
        std::array<uint64_t, 8> masks;
        for (uint64_t& mask : masks) mask = random() & random();
        for (int x = 0; x < 8; ++x)
            for (int y = 0; y < 8; ++y)
                for (int z = 0; z < 8; ++z)
                    if (masks[size_t(octant_code(uint32_t(x >> 2), uint32_t(y >> 2), uint32_t(z >> 2)))] >> mask_bit(uint32_t(x), uint32_t(y), uint32_t(z)) & 1)
                        places.insert({x0 + x, y0 + y, z0 + z});
        voxels.add_brick({x0, y0, z0}, masks);
    }
    voxels.add_brick({-800, 0, 0}, {});  // nothing
    // Cubes of an odd and an even power.
    voxels.add_cube({-16, -16, -16}, 3);
    add_cube_to(places, -16, -16, -16, 8);
    voxels.add_cube({-16, 32, -16}, 4);
    add_cube_to(places, -16, 32, -16, 16);
    voxels.add_cube({32, 0, -32}, 4);
    add_cube_to(places, 32, 0, -32, 16);
    EXPECT_EQ(voxels.voxels(), places.size());
    const VoxelFrame frame = voxels.finish(Vec3d::Zero(), 0.5);
    EXPECT_EQ(frame.levels, 3);  // 64 voxels along y and z
    EXPECT_EQ(frame.origin, Vec3d(-16.5, -16.5, -32.5) * 0.5);
    expect_places(tree_of(voxels, frame), places, -34, 50);
}

TEST(BrickVoxels, AFullFrameIsOneNode) {
    BrickVoxels voxels;
    voxels.add_cube({64, 64, -64}, 6);
    const VoxelFrame frame = voxels.finish(Vec3d(1, 2, 3), 1.0);
    EXPECT_EQ(frame.levels, 3);
    EXPECT_EQ(frame.origin, Vec3d(64.5, 65.5, -61.5));
    const VoxelTree tree = tree_of(voxels, frame);
    EXPECT_EQ(count_voxels(tree), 64u * 64 * 64);
    EXPECT_EQ(tree.levels[0].masks.size(), 1u);
    EXPECT_EQ(tree.levels[1].masks.size(), 0u);
}

// A cube that a finer brick touches shares a node with it, in whichever order the two were added.
TEST(BrickVoxels, CubesAndBricksShareNodes) {
    for (const bool cube_first : {true, false}) {
        BrickVoxels voxels;
        Places places;
        std::array<uint64_t, 8> corner = {1};
        if (!cube_first) voxels.add_brick({8, 8, 8}, corner);
        voxels.add_cube({0, 0, 0}, 3);
        if (cube_first) voxels.add_brick({8, 8, 8}, corner);
        add_cube_to(places, 0, 0, 0, 8);
        places.insert({8, 8, 8});
        expect_places(tree_of(voxels, voxels.finish(Vec3d::Zero(), 1.0)), places, -2, 18);
    }
}

TEST(BrickVoxels, AFrameIsKeptWhereAllFits) {
    BrickVoxels voxels;
    voxels.add_brick({56, 0, 0}, {1});
    EXPECT_EQ(voxels.finish(Vec3d::Zero(), 1.0, 4), (VoxelFrame{.origin = Vec3d::Constant(-0.5), .voxel_size = 1.0, .levels = 4}));
    BrickVoxels outside;
    outside.add_brick({-8, 0, 0}, {1});
    EXPECT_EQ(outside.finish(Vec3d::Zero(), 1.0, 4).levels, 1);
    BrickVoxels beyond;
    beyond.add_brick({256, 0, 0}, {1});
    EXPECT_EQ(beyond.finish(Vec3d::Zero(), 1.0, 4).origin.x(), 255.5);
}

// A frame of one level is half as wide as a brick.
TEST(BrickVoxels, AFrameOfOneLevelIsKept) {
    BrickVoxels voxels;
    voxels.add_brick({0, 0, 0}, {uint64_t{1} | uint64_t{1} << 63});
    const VoxelFrame frame = voxels.finish(Vec3d(1, 2, 3), 1.0, 1);
    EXPECT_EQ(frame, (VoxelFrame{.origin = Vec3d(0.5, 1.5, 2.5), .voxel_size = 1.0, .levels = 1}));
    const VoxelTree tree = tree_of(voxels, frame);
    EXPECT_EQ(count_voxels(tree), 2u);
    EXPECT_TRUE(is_occupied(tree, 0, 0, 0));
    EXPECT_TRUE(is_occupied(tree, 3, 3, 3));
    for (const size_t octant : {1, 2, 4}) {  // each beyond along one axis
        std::array<uint64_t, 8> masks{};
        masks[octant] = 1;
        BrickVoxels wider;
        wider.add_brick({0, 0, 0}, masks);
        EXPECT_EQ(wider.finish(Vec3d::Zero(), 1.0, 1).levels, 2);
    }
}

TEST(BrickVoxels, NoVoxelsAreNoBlocks) {
    BrickVoxels voxels;
    EXPECT_EQ(voxels.finish(Vec3d::Zero(), 1.0).levels, 1);
    voxels.emit([](const VoxelBatch&) { FAIL(); });
}

TEST(BrickVoxels, MoreThanTheLargestFrameIsRefused) {
    BrickVoxels voxels;
    voxels.add_brick({0, 0, 0}, {1});
    voxels.add_brick({1 << 20, 0, 0}, {1});
    EXPECT_THROW(voxels.finish(Vec3d::Zero(), 1.0), Error);
    BrickVoxels whole;
    whole.add_brick({-(1 << 19), 0, 0}, {1});
    whole.add_brick({(1 << 19) - 8, 0, 0}, {1});
    EXPECT_EQ(whole.finish(Vec3d::Zero(), 1.0).levels, 10);
}

}  // namespace
}  // namespace strata
