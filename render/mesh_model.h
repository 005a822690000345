#pragma once

#include <cstdint>
#include <vector>

#include "core/math/box.h"
#include "core/surface/triangle_mesh.h"
#include "render/mesh_colors.h"

namespace strata {

/// flat: each triangle as the plane that it is. smooth: lit by normals that change evenly over it, but for creases (corner_normals.h).
enum class MeshShading { flat, smooth };

struct MeshStyle {
    MeshShading shading = MeshShading::smooth;
    bool wireframe = false;  // darkens the edges of triangles
    bool mark_backs = false;  // triangles that are seen from behind get a color of their own
};

/// A mesh as a scene has it. The mesh must outlive it, and not change.
struct MeshModel {
    /// cost  that of corner_normals for smooth ones
    MeshModel(const TriangleMesh& drawn, MeshColors painted, const MeshStyle& drawn_as = {}, int threads = 1);

    const TriangleMesh* mesh;
    Box3d bounds;  // of what triangles use; world
    MeshColors colors;
    MeshStyle style;
    std::vector<uint32_t> corners;  // normals by corner_normals; empty for flat ones
    uint64_t serial;                // no other model has it but copies of this one
};

/// Bytes of memory that a model takes with its mesh, and most while it is made.
/// shading  smooth ones have normals of corners
struct MeshModelBytes {
    uint64_t kept, most;
};
MeshModelBytes mesh_model_bytes(const TriangleMesh& mesh, MeshShading shading);

}  // namespace strata
