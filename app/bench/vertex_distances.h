#pragma once

#include "core/surface/contour.h"

namespace strata {

/// How far the vertices of a mesh are from the true surface.
struct VertexDistances {
    double largest = 0.0, rms = 0.0;
};

/// distance  from the surface, of places near it; of any sign
VertexDistances distances_of_vertices(const ContourMesh& mesh, double (*distance)(const Vec3d& place));

}  // namespace strata
