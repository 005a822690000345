#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "core/math/vec.h"
#include "core/simd_level.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

struct VoxelDag;

/// Points origin + t * direction, t >= 0, in voxels of the tree's frame.
struct VoxelRay {
    Vec3d origin = Vec3d::Zero();
    Vec3d direction = Vec3d::UnitX();  // of any length; one of length 0, and what is not finite, hits nothing
};

enum class CellFace : uint8_t { min_x, max_x, min_y, max_y, min_z, max_z, inside };  // inside: the ray starts in the cell

/// The first occupied cell of a ray.
struct VoxelHit {
    double t = 0.0;                     // where the ray enters the cell, in lengths of the direction, or starts in it
    std::array<uint32_t, 3> cell = {};  // coordinates among the cells of `depth`
    int depth = 0;                      // of the octree; a full cell is cut to the depth asked for. 0: the ray hits nothing
    CellFace face = CellFace::inside;
    int level = 0;  // where the cell's attributes are: cell_index(tree, level, node, bit, depth is odd)
    uint32_t node = 0;
    int bit = 0;

    bool operator==(const VoxelHit&) const = default;
};

/// The part of a ray that counts, and where to stop: at cells of `depth`, at the finest there are, and at those whose side, in
/// voxels, is at most spread * t + footprint where the ray enters them. So a picture whose pixels are `spread` wide at t = 1
/// shows no cells smaller than its pixels. The coarsest cells that stop a ray are those of depth 1.
struct RayLimits {
    int depth = 2 * kMostVoxelLevels;
    double least_t = 0.0, most_t = std::numeric_limits<double>::infinity();
    double spread = 0.0, footprint = 0.0;  // not negative
};

/// Rays of a rectangle of pixels: that of pixel (x, y) is `first` and x and y times its changes. All zero but the directions': a
/// perspective picture. All but the origins': an orthographic one.
struct VoxelTile {
    VoxelRay first;
    Vec3d origin_per_x = Vec3d::Zero(), origin_per_y = Vec3d::Zero();
    Vec3d direction_per_x = Vec3d::Zero(), direction_per_y = Vec3d::Zero();
    int width = 1, height = 1;

    VoxelRay ray(int x, int y) const {
        return {first.origin + x * origin_per_x + y * origin_per_y, first.direction + x * direction_per_x + y * direction_per_y};
    }
};

/// The first occupied cell. A ray may be anywhere and look in any direction, along axes and through edges and corners too.
/// Cells are half open: a ray along a face is in the cell above it. One that starts on a face is in the cell that it looks into.
/// Where it passes through an edge or a corner it visits one of the cells between as well, so that it passes no wall whose cells
/// share faces. Differs from an exhaustive walk in double precision only where the ray passes within 2^-13 cell of an edge.
std::optional<VoxelHit> cast_ray(const VoxelTree& tree, const VoxelRay& ray, const RayLimits& limits = {},
                                 SimdLevel level = best_simd_level());

/// Whether there is an occupied cell on the ray.
bool is_occluded(const VoxelTree& tree, const VoxelRay& ray, const RayLimits& limits = {}, SimdLevel level = best_simd_level());

/// What cast_ray finds for each ray, `depth` 0 where that is nothing. Faster than one by one.
/// hits  [rays]
void cast_rays(const VoxelTree& tree, std::span<const VoxelRay> rays, const RayLimits& limits, std::span<VoxelHit> hits,
               SimdLevel level = best_simd_level());

/// The same for the rays of a tile, row by row. Tiles of 8 x 8 to 64 x 64 pixels are best.
/// hits  [width * height]
void cast_tile(const VoxelTree& tree, const VoxelTile& tile, const RayLimits& limits, std::span<VoxelHit> hits,
               SimdLevel level = best_simd_level());

/// The same in a DAG: `level` and `node` of a hit are the DAG's, which has no attributes.
std::optional<VoxelHit> cast_ray(const VoxelDag& dag, const VoxelRay& ray, const RayLimits& limits = {},
                                 SimdLevel level = best_simd_level());
bool is_occluded(const VoxelDag& dag, const VoxelRay& ray, const RayLimits& limits = {}, SimdLevel level = best_simd_level());
void cast_rays(const VoxelDag& dag, std::span<const VoxelRay> rays, const RayLimits& limits, std::span<VoxelHit> hits,
               SimdLevel level = best_simd_level());
void cast_tile(const VoxelDag& dag, const VoxelTile& tile, const RayLimits& limits, std::span<VoxelHit> hits,
               SimdLevel level = best_simd_level());

}  // namespace strata
