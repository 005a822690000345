#pragma once

#include <optional>
#include <span>

#include "core/math/box.h"
#include "core/voxel/ray_cast.h"

namespace strata {

/// Where a ray first is in one of the boxes, by asking each of them in double precision: what ray casting through a tree must find.
/// boxes   in voxels, such as one a cell
/// grow    moves all faces of the boxes outwards, voxels: between the answers for a little more and a little less lies every
///         answer that is right up to rounding
/// returns t, at least least_t; none: the ray meets no box
std::optional<double> first_in_boxes(std::span<const Box3d> boxes, const VoxelRay& ray, double least_t, double grow);

}  // namespace strata
