#pragma once

#include <cstdint>
#include <optional>

#include "core/surface/triangle_mesh.h"
#include "render/pass/mesh_projection.h"

namespace strata {

/// What a ray through a place of the picture meets first, by asking each triangle in double precision: what rasterizing must find.
struct MeshTruth {
    struct Hit {
        uint32_t triangle;
        double depth;
    };
    std::optional<Hit> nearest;
    double edge_px;  // from the place to the nearest edge in the picture: where it is less than corners are rounded by, rasterizing may find another triangle
};

/// mesh  behind the near plane, all of it
MeshTruth first_in_mesh(const TriangleMesh& mesh, const MeshProjection& view, double x_px, double y_px);

}  // namespace strata
