#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>

#include "core/simd_level.h"
#include "core/surface/field_surface.h"
#include "core/voxel/ray_cast.h"

namespace strata {

/// Points origin + t * direction, t >= 0, in samples of a FieldBricks.
using FieldRay = VoxelRay;

struct FieldHit {
    double t = std::numeric_limits<double>::infinity();  // infinite: there is none
    std::array<int32_t, 3> cell = {0, 0, 0};
    bool from_inside = false;  // the ray leaves the inside there
};

/// The first place where a ray passes from outside to inside or back, exactly in the interpolant: the root of its cubic in the cell, and
/// none is missed between cells, as they are told apart by the crossings of planes (core/voxel/ray_walk.h) and the side on which the ray
/// comes into a cell is that of the face's corners where these agree, else that on which it ended in the cell before. A cell with a corner
/// that is NaN has no surface; beyond a dense field there is nothing, and where it ends no surface either.
std::optional<FieldHit> cast_ray(const FieldSurface& surface, const FieldRay& ray, double least_t = 0.0,
                                 double most_t = std::numeric_limits<double>::infinity(), SimdLevel level = best_simd_level());

/// The same for the rays of a tile, row by row; faster. Tiles of 8 x 8 to 64 x 64 pixels are best.
/// hits  [width * height]
/// cost  50 to 250 ns a ray
void cast_tile(const FieldSurface& surface, const VoxelTile& tile, double least_t, double most_t, std::span<FieldHit> hits,
               SimdLevel level = best_simd_level());

/// Normals of a surface where rays meet it.
class FieldNormals {
public:
    explicit FieldNormals(const FieldSurface& surface);

    /// World, of length 1, away from the inside: of the gradient by central differences at the samples around, interpolated. One-sided
    /// where there is no sample; zero where there is no gradient.
    Vec3f outward(const FieldRay& ray, const FieldHit& hit) const;

private:
    const FieldBricks& field_;
    Mat3d outward_from_gradient_;
};

}  // namespace strata
