#pragma once

#include <cstdint>
#include <functional>

#include "core/surface/triangle_mesh.h"
#include "core/voxel/voxel_block.h"
#include "core/voxel/voxel_frame.h"

namespace strata {

/// Which voxels a mesh occupies.
enum class VoxelKind {
    /// Those whose closed box shares a point with a triangle: the surface lets no 26-connected path of empty voxels through.
    conservative,
    /// Those of whose three axis segments through the center, from face to face, one meets a triangle: no 6-connected path gets
    /// through. A segment has its ends but for the upper one along its axis, so a sheet on faces of voxels is one layer. A part of the
    /// conservative ones. Source: S. Laine, "A Topological Approach to Voxelization", Computer Graphics Forum 32(4), 2013.
    thin,
    /// Those whose center has a generalized winding number over 1/2. Triangles turn counterclockwise seen from outside; an inside-out
    /// mesh (winding number -1) has no inside, nested and overlapping shells (2) have. A center on the surface counts as if it lay
    /// higher by (e^2, e^3, e) along x, y, z for a small e. Winding numbers of closed meshes are exact; near wide holes of open ones
    /// they are sums in double precision, of which 1/2 + 1e-9 is not over 1/2. Cubes wholly inside are blocks of greater height.
    solid
};

struct VoxelProgress {
    uint64_t done = 0, total = 0;  // bricks of 64^3 voxels
};

struct MeshVoxelSettings {
    VoxelKind kind = VoxelKind::conservative;
    VoxelAttributes
        attributes;  // of surfaces: the mean normal of the triangles in a voxel, each weighing as its area, and their mean color
    int threads = 1;
    uint64_t memory_bytes = uint64_t{2} << 30;              // for all but the mesh itself
    std::function<void(const VoxelProgress&)> on_progress;  // may be empty; called from any thread, one at a time
};

/// Bits of a voxel's side that vertices are snapped to: 16, less in frames of more than 4096 voxels an axis (9 at 2^20).
/// Vertices are moved by at most 2^-(bits + 1) voxel an axis, once for all triangles; every decision after that is exact.
int snapped_bits(const VoxelFrame& frame);

/// Writes the voxels of a mesh to the sink, in ascending order. Depends neither on threads and memory, nor on
/// the order of triangles and vertices; surface kinds do not depend on which side of a triangle is out. What lies outside the frame
/// is cut off; triangles that reach a quarter of the frame's side or more beyond it are halved there at snapped points, each of which
/// may lie another 2^-(bits + 1) voxel off. A triangle without area is the segment or point that
/// it covers; in a solid it is nothing.
/// throws  Error{malformed}: a vertex of a triangle is not finite, or not there
///         Error{limit}: the settings' memory is too little (the message says how much it takes), or a vertex of a triangle lies more
///         than 2^40 voxels outside
///         Error{usage}: attributes that there are not: counts, colors where vertices have none, any of a solid
///         whatever the sink throws
/// cost    memory: 12 bytes a vertex and 24 for each triangle and brick of 64^3 voxels that it touches (about 1.3 bricks a triangle
///         where triangles are small), and some 100 kB a thread
void voxelize_mesh(const TriangleMesh& mesh, const VoxelFrame& frame, const MeshVoxelSettings& settings, const VoxelSink& sink);

}  // namespace strata
