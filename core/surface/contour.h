#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/surface/large_array.h"
#include "core/surface/scalar_field.h"
#include "core/surface/surface_sink.h"

namespace strata {

/// Which side of an isovalue is inside, and hence where triangles face: away from it. A sample equal to the isovalue is inside, one that
/// is NaN is outside.
enum class ContourInside {
    above,  // densities: samples >= isovalue
    below,  // signed distances: samples <= isovalue
};

struct ContourSettings {
    std::vector<double> isovalues = {0.0};  // finite; a surface each, in one pass over the field
    ContourInside inside = ContourInside::above;
    bool close = false;                          // as if the field were outside beyond the grid
    bool open_at_nan = false;                    // of contour_bricks: cells with a NaN sample have no surface; else NaN is outside
    bool normals = false;                        // of the field's gradient, pointing outside
    std::vector<std::array<uint8_t, 4>> colors;  // of the vertices of each isovalue; or empty
    int threads = 1;
    uint64_t memory_bytes = uint64_t{1} << 30;  // for slices, bricks and what is made of them
    uint64_t memory_parts = 1;                  // memory_bytes, and memory_beside, is one of so many of what was given: errors speak of that
    uint64_t memory_beside = 0;                 // held by others
};

/// What was found on the way, of all isovalues together.
struct ContourReport {
    uint64_t vertices = 0, triangles = 0;
    uint64_t nan_samples = 0;
    float least = std::numeric_limits<float>::infinity(),
          greatest = -std::numeric_limits<float>::infinity();  // of samples that are not NaN
    bool meets_boundary = false;                               // of the grid, or cells with NaN: the surface is open there, or was closed
    uint64_t clamped_vertices = 0;  // vertices lie at least 2^-10 of an edge from its ends; those that were moved to do so
    double largest_shift_cells = 0.0;
    uint64_t ambiguous_cells = 0;  // cells whose corners alone do not tell how the surface runs
    uint64_t tunnel_cells = 0;     // those of them through which a tunnel leads
};

/// An isosurface in memory. Colors come only by way of a sink.
struct ContourMesh {
    Vec3d origin = Vec3d::Zero();                   // world: of positions
    LargeArray<Vec3f> positions;                    // world, less origin
    LargeArray<Vec3f> normals;                      // [positions] of unit length, zero: unknown; or empty
    LargeArray<std::array<uint32_t, 3>> triangles;  // counterclockwise seen from outside
};

/// The isosurface of the trilinear interpolant of samples: closed but for the grid's boundary, consistently oriented, a manifold with the
/// interpolant's own topology in every cell, and the same bytes whatever the number of threads. One vertex for each edge of the grid that
/// the surface crosses, and some within cells that need them; their order is that of the grid, k slowest.
/// size     samples an axis
/// values   [size] i runs fastest, then j. NaN: no value
/// returns  an empty surface where an axis has fewer than two samples and is not closed
/// throws   Error{usage}: isovalues not finite; Error{limit}: 2^32 vertices or more
/// cost     O(samples / 64 + vertices) beside one reading of the field, and 2 bits a sample
/// source   G. M. Nielson, B. Hamann, "The asymptotic decider", IEEE Visualization 1991, for faces; cells within: cell_interior.h
ContourReport contour_grid(const GridPlacement& placement, const std::array<uint32_t, 3>& size, std::span<const float> values,
                           const ContourSettings& settings, ContourMesh& out);

/// The same of a field that may be larger than memory, piece by piece; vertices are shared between pieces, and the pieces together do not
/// depend on the memory. The first isovalue is subtracted by the source before values are rounded.
/// throws  as contour_grid, and what source and sink throw; Error{limit}: two slices, their masks and a row of the surface do not fit in
///         memory_bytes
ContourReport contour_slices(SliceSource& source, const ContourSettings& settings, SurfaceSink& sink);

/// The same of a sparse field: only cells with a sample in a brick are visited. There is no boundary to close the surface at: it has one
/// only where it is open at NaN, which `meets_boundary` tells; each vertex has a face there, too. `nan_samples`, `least` and `greatest` are those of
/// bricks. Normals are the gradient's.
/// throws  as contour_slices; Error{malformed}: layers or bricks out of order; Error{limit}: up to five layers, that being read one of them,
///         and what is made of them do not fit in memory_bytes
ContourReport contour_bricks(FieldBrickSource& source, const ContourSettings& settings, SurfaceSink& sink);
/// In memory, and without colors: `memory_bytes` does not count the surface.
ContourReport contour_bricks(FieldBrickSource& source, const ContourSettings& settings, ContourMesh& out);

}  // namespace strata
