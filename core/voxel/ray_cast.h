#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "core/math/vec.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// Points origin + t * direction, t >= 0, in voxels of the tree's frame.
struct VoxelRay {
    Vec3d origin = Vec3d::Zero();
    Vec3d direction = Vec3d::UnitX();  // of any length but 0
};

enum class CellFace : uint8_t { min_x, max_x, min_y, max_y, min_z, max_z, inside };  // inside: the ray starts in the cell

/// The first occupied cell of a ray.
struct VoxelHit {
    double t = 0.0;                     // where the ray enters the cell, in lengths of the direction
    std::array<uint32_t, 3> cell = {};  // coordinates among the cells of `depth`
    int depth = 0;                      // of the octree; a full cell is cut to the depth asked for
    CellFace face = CellFace::inside;
    int level = 0;                      // where the cell's attributes are: cell_index(tree, level, node, bit, depth is odd)
    uint32_t node = 0;
    int bit = 0;
};

/// The part of a ray that counts, and the depth to stop at.
struct RayLimits {
    int depth = 2 * kMostVoxelLevels;  // cells of this depth, or of the finest there are, stop the ray
    double least_t = 0.0, most_t = std::numeric_limits<double>::infinity();
};

/// The first occupied cell. A ray may be anywhere and look in any direction, along axes and through edges and corners too.
/// Differs from an exhaustive walk in double precision only where the ray passes within 2^-13 cell of an edge.
std::optional<VoxelHit> cast_ray(const VoxelTree& tree, const VoxelRay& ray, const RayLimits& limits = {});

}  // namespace strata
