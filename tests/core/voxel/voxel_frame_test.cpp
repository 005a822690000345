#include "core/voxel/voxel_frame.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/error.h"

namespace strata {
namespace {

Box3d box_of(const Vec3d& min, const Vec3d& max) {
    Box3d box;
    box.extend(min);
    box.extend(max);
    return box;
}

// A box fits strictly inside of its frame, and its longest side takes the voxels that were asked for.
TEST(VoxelFrame, ResolutionIsThatOfTheLongestSide) {
    for (const uint32_t resolution : {1u, 2u, 3u, 4u, 5u, 100u, 1024u, 4096u, 65536u, 1u << 20})
        for (const Vec3d& min : {Vec3d(0, 0, 0), Vec3d(-3, 1e6, 5.3e6), Vec3d(4e6, -3e6, 4.5e6)}) {
            const Box3d box = box_of(min, min + Vec3d(700, 0, 1300));
            const VoxelFrame frame = frame_of_resolution(box, resolution);
            const Vec3d first = frame.voxel_from_world(box.min), last = frame.voxel_from_world(box.max);
            EXPECT_GE(first.minCoeff(), 0.001);
            EXPECT_LE(last.maxCoeff(), resolution - 0.001);
            EXPECT_EQ(int64_t(std::floor(last.z())) - int64_t(std::floor(first.z())) + 1, resolution);
            EXPECT_GE(frame.side(), resolution);
            EXPECT_TRUE(frame.levels == 1 || frame.side() / 4 < resolution);
        }
}

// Voxels of neighboring scans have the same faces.
TEST(VoxelFrame, VoxelSizeAlignsFacesToItsMultiples) {
    const VoxelFrame one = frame_of_voxel_size(box_of({431000.2, 5403000, 12}, {431099, 5403050, 80}), 0.25);
    const VoxelFrame two = frame_of_voxel_size(box_of({431093.01, 5403049, 3}, {431200, 5403100, 60}), 0.25);
    const Vec3d shift = (two.origin - one.origin) / 0.25;
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(shift[axis], std::round(shift[axis]));
    EXPECT_EQ(one.origin, Vec3d(430999.75, 5402999.75, 11.75));
    EXPECT_EQ(one.side(), 1024u);  // 98.8 m, one voxel more at each end
}

TEST(VoxelFrame, OnePointHasAFrame) {
    const VoxelFrame frame = frame_of_resolution(box_of({5, 6, 7}, {5, 6, 7}), 64);
    EXPECT_GE(frame.voxel_from_world({5, 6, 7}).minCoeff(), 0.001);
    EXPECT_EQ(frame_of_voxel_size(box_of({5, 6, 7}, {5, 6, 7}), 0.5).levels, 1);
}

TEST(VoxelFrame, RefusesWhatCannotBe) {
    const Box3d box = box_of({0, 0, 0}, {1, 1, 1});
    EXPECT_THROW(frame_of_resolution(Box3d(), 16), Error);
    EXPECT_THROW(frame_of_resolution(box, 0), Error);
    EXPECT_THROW(frame_of_resolution(box, (1u << 20) + 1), Error);
    EXPECT_THROW(frame_of_voxel_size(box, 0.0), Error);
    EXPECT_THROW(frame_of_voxel_size(box, std::nan("")), Error);
    EXPECT_THROW(frame_of_voxel_size(box, 1e-7), Error);
    EXPECT_THROW(frame_of_resolution(box_of({1e15, 0, 0}, {1e15 + 1, 1, 1}), 1024), Error);
    EXPECT_THROW(frame_of_resolution(box_of({-1e308, 0, 0}, {1e308, 1, 1}), 1024), Error);
    EXPECT_THROW(frame_of_resolution(box_of({0, 0, 0}, {std::numeric_limits<double>::infinity(), 1, 1}), 1024), Error);
}

}  // namespace
}  // namespace strata
