#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "core/math/box.h"
#include "core/math/camera.h"
#include "core/surface/cube_brick_source.h"
#include "core/surface/surface_sink.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

struct CubeSurfaceSettings {
    /// How rectangles become faces.
    enum class Joints : uint8_t {
        closed,   // edges are cut where corners of other rectangles lie on them, and vertices shared: no gaps between faces
        separate  // a rectangle is a quad with four vertices of its own: pixels between faces may stay open
    };

    int depth = 0;  // of an octree: of the cells that are cubes; 0: its finest
    Joints joints = Joints::closed;
    bool normals = false;                                          // of the faces; then only faces that look the same way share vertices
    bool colors = true;                                            // where cells have some: what differs in color does not merge
    std::vector<std::pair<VoxelColor, uint8_t>> transparent = {};  // colors that can be seen through, and their opacities
    int threads = 1;
    uint64_t memory_bytes = std::numeric_limits<uint64_t>::max();  // for the cells' bricks, corners and the faces of those in work
    uint64_t memory_parts = 1;                                     // memory_bytes is one of so many of what was given: errors speak of that
    std::function<void(uint64_t done, uint64_t total)> on_progress;  // cells, about; may be empty; called from any thread, one at a time
};

struct CubeSurfaceCounts {
    uint64_t solid_voxels = 0;                        // occupied cells
    uint64_t faces_uncut = 0;                         // six a cell
    uint64_t faces_culled = 0;                        // those that are left, which can be seen
    uint64_t rectangles = 0;                          // that these merge into
    uint64_t vertices = 0, triangles = 0, quads = 0;  // put out
};

/// The surface of cells as rectangles of faces, brick after brick of 64^3 cells in the source's order, the same whatever the threads.
/// All positions are from the grid's origin, computed from whole numbers, so that equal corners are equal floats in every brick: closed
/// faces leave no gap where a rasterizer fills shared edges once, as all do. Where materials meet, vertices are there once for each.
/// Closed faces are consistently oriented and every edge belongs to as many faces one way as the other; where cells touch along
/// an edge only, four faces share it. What can be seen through is not closed where it lies at something opaque.
/// throws  Error{usage}: transparent colors where cells have no colors
///         Error{limit}: more than 2^32 - 1 vertices; more than memory_bytes, found when a brick is done: one a thread goes beyond
///         what the sink throws
/// cost    On one thread 0.15 microseconds a rectangle of a scan, closed (4 triangles for 3 of the others), and 0.07 separate. Memory: 3 MB
///         a thread, which memory_bytes does not count, and the output of 4 bricks; what the source holds; closed 48 bytes a brick, and 4 for a corner on the
///         outside of a brick, then 16 for a vertex there, as long as a brick that has it, too, is to come
/// bricks  settings.depth does not count
CubeSurfaceCounts mesh_cubes(const CubeBrickSource& bricks, const CubeSurfaceSettings& settings, SurfaceSink& out);

/// The same of the cells of an octree, in Morton order, of which the source holds 20 bytes a brick.
/// throws  Error{usage}, too: a depth that the tree does not have
CubeSurfaceCounts mesh_cubes(const VoxelTree& tree, const CubeSurfaceSettings& settings, SurfaceSink& out);

/// The least depth whose cubes lie within `error` of the voxels of the tree's finest depth; 1 at least. A cube of 2^k voxels a side has
/// at least one of them, so what it adds is at most sqrt(3) (2^k - 1) voxels from it.
/// error_voxels  in voxels of the tree's finest depth
int depth_of_error(const VoxelTree& tree, double error_voxels);

/// The same for an error in pixels of a picture, by the nearest of what it shows; 1 where it shows nothing. Near is so exact as the finest
/// depth of at most 4,096 cells is.
int depth_of_error_px(const VoxelTree& tree, const Camera& camera, uint32_t width_px, uint32_t height_px, double error_px);

}  // namespace strata
