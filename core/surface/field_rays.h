#pragma once

#include <array>
#include <limits>
#include <optional>
#include <vector>

#include "core/math/vec.h"
#include "core/surface/contour.h"
#include "core/surface/field_bricks.h"

namespace strata {

/// Which isosurface: where the trilinear interpolant has the value.
struct IsoLevel {
    double isovalue = 0.0;  // finite
    ContourInside inside = ContourInside::above;
};

/// The bricks that an isosurface may pass through.
std::vector<std::array<int32_t, 3>> crossed_bricks(const FieldBricks& field, const IsoLevel& level);
/// The box of the cells in a brick that it does pass through, in samples.
Box3d crossed_cells(const FieldBricks& field, const IsoLevel& level, const std::array<int32_t, 3>& brick);
/// Of the bricks that it may pass through; world. Empty: it passes through none.
Box3d surface_bounds(const FieldBricks& field, const IsoLevel& level);

/// Points origin + t * direction, t >= 0, in samples of a FieldBricks.
struct FieldRay {
    Vec3d origin = Vec3d::Zero();
    Vec3d direction = Vec3d::UnitX();
};

struct FieldHit {
    double t = 0.0;
    std::array<int32_t, 3> cell = {0, 0, 0};
    bool from_inside = false;  // the ray leaves the inside there
};

/// The first place where a ray passes from outside to inside or back, exactly in the interpolant: the root of its cubic in the cell, and
/// none is missed between cells, as they are told apart by the crossings of planes (core/voxel/ray_walk.h) and each takes over the side on
/// which the one before ended. A cell with a corner that is NaN has no surface; beyond a dense field there is nothing, and where it ends no
/// surface either. cost  some 10 ns a cell near the surface; bricks and wide bricks without the value are leapt over
std::optional<FieldHit> cast_ray(const FieldBricks& field, const IsoLevel& level, const FieldRay& ray, double least_t = 0.0,
                                 double most_t = std::numeric_limits<double>::infinity());

/// The surface's normal at a hit, world, of length 1, away from the inside: of the gradient by central differences at the samples around,
/// interpolated. One-sided where there is no sample; zero where there is no gradient.
Vec3f outward_normal(const FieldBricks& field, const IsoLevel& level, const FieldRay& ray, const FieldHit& hit);

}  // namespace strata
