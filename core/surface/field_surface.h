#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/box.h"
#include "core/simd_level.h"
#include "core/surface/contour.h"
#include "core/surface/field_bricks.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// Which isosurface: where the trilinear interpolant has the value.
struct IsoLevel {
    double isovalue = 0.0;  // finite
    ContourInside inside = ContourInside::above;
};

/// The bricks that an isosurface may pass through.
std::vector<std::array<int32_t, 3>> crossed_bricks(const FieldBricks& field, const IsoLevel& level);

/// The cells that an isosurface passes through: those with corners on both sides, and none that is missing. As voxels of an octree, so
/// that rays leap over all others; cell (x, y, z) of the field is voxel (x, y, z) of a frame of unit size.
/// cost  a glance at every brick, and some 0.4 us for each of crossed_bricks and thread; a byte a cell or less
VoxelTree surface_cells(const FieldBricks& field, const IsoLevel& level, int threads, SimdLevel simd = best_simd_level());

/// An isosurface made ready for rays: made anew for another isovalue, which is quick. The field must outlive it.
struct FieldSurface {
    FieldSurface(const FieldBricks& of, const IsoLevel& at, int threads = 1) : field(&of), level(at), cells(surface_cells(of, at, threads)) {}

    bool empty() const { return cells.empty(); }

    const FieldBricks* field;
    IsoLevel level;
    VoxelTree cells;
};

/// The box of the cells of a surface; world. Empty: there are none.
Box3d surface_bounds(const FieldSurface& surface);

}  // namespace strata
