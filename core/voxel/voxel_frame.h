#pragma once

#include <cstdint>

#include "core/math/box.h"
#include "core/math/vec.h"

namespace strata {

inline constexpr int kMostVoxelLevels = 10;  // of 4^3 masks: 2^20 voxels an axis

/// Where voxels lie: a cube of 4^levels voxels an axis. Voxel (x, y, z) holds origin + voxel_size * [x, x + 1) and so on.
struct VoxelFrame {
    Vec3d origin = Vec3d::Zero();  // world: the least corner of voxel (0, 0, 0)
    double voxel_size = 1.0;       // world units
    int levels = 1;                // 1 to kMostVoxelLevels

    uint32_t side() const { return uint32_t{1} << 2 * levels; }  // voxels
    int depth() const { return 2 * levels; }                     // of the octree: voxels are its cells at this depth
    Vec3d voxel_from_world(const Vec3d& p) const { return (p - origin) / voxel_size; }
    Vec3d world_from_voxel(const Vec3d& p_voxel) const { return origin + voxel_size * p_voxel; }
    bool operator==(const VoxelFrame&) const = default;
};

/// The frame in which the box's longest side takes `resolution` voxels. The box lies inside by a thousandth of a voxel or
/// more, so that what touches its faces touches no voxel beyond them.
/// throws  Error{usage}: the box is empty or not finite, or the resolution is not in 1 ... 2^20
///         Error{limit}: voxels so small could not be told apart so far from the origin of the world
VoxelFrame frame_of_resolution(const Box3d& box, uint32_t resolution);

/// The frame of voxels of a size whose faces lie on multiples of it, so that frames of neighboring scans fit together. The box
/// lies inside by a voxel or more.
/// throws  Error{usage}: as above; more than 2^20 voxels an axis
VoxelFrame frame_of_voxel_size(const Box3d& box, double voxel_size);

}  // namespace strata
