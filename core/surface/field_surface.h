#pragma once

#include <array>
#include <cstdint>
#include <limits>
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

/// Bricks that an isosurface may pass through.
uint64_t count_crossed_bricks(const FieldBricks& field, const IsoLevel& level);

/// The cells that an isosurface passes through: those with corners on both sides, and none that is missing. As voxels of an octree, so
/// that rays leap over all others; cell (x, y, z) of the field is voxel (x, y, z) of a frame of unit size.
/// memory_bytes  for what is made, and what is needed while it is: some 100 to 200 bytes for each brick that is crossed
/// throws  Error{limit}: more is needed
/// cost    a glance at every brick, and some 0.4 us for such brick and thread; a byte a cell or less
VoxelTree surface_cells(const FieldBricks& field, const IsoLevel& level, int threads, uint64_t memory_bytes, SimdLevel simd = best_simd_level());

/// An isosurface made ready for rays: made anew for another isovalue, which is quick. The field must outlive it.
struct FieldSurface {
    FieldSurface(const FieldBricks& of, const IsoLevel& at, int threads = 1, uint64_t memory_bytes = std::numeric_limits<uint64_t>::max())
        : field(&of), level(at), cells(surface_cells(of, at, threads, memory_bytes)) {}

    bool empty() const { return cells.empty(); }

    const FieldBricks* field;
    IsoLevel level;
    VoxelTree cells;
};

/// The box of the cells of a surface; world. Empty: there are none.
Box3d surface_bounds(const FieldSurface& surface);

}  // namespace strata
