#pragma once

#include <cstdint>

#include "core/math/vec.h"
#include "core/surface/contour_cell.h"

namespace strata {

/// Slope of a cell's trilinear function at a place in it, from (0, 0, 0) to (1, 1, 1); zero where a corner is not finite.
Vec3d inside_slope(const CellValues& values, const Vec3d& p_cell);

/// A place within a cell for a vertex amid those on some of its edges: their mean, brought to the zero of the cell's trilinear function.
/// edges  a bit each; they are crossed
Vec3d place_inner_vertex(const CellValues& values, uint16_t edges);

}  // namespace strata
