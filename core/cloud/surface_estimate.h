#pragma once

#include <optional>

#include "core/cloud/neighbor_search.h"
#include "core/math/quantization.h"

namespace strata {

/// What a point's neighbors say of the surface it lies on.
struct SurfaceEstimate {
    Vec3f normal = Vec3f::Zero();  // unit, or zero: no plane fits (see fit_normal)
    float density = 0.0f;          // points per square unit of a surface; 0: the point is alone
};

/// viewpoint  where the surface was seen from, world: normals look there; without one they look up. A normal at right
///            angles to that looks towards +z, else +y, else +x
/// Density counts the other points within the distance r of the farthest: (k - 1) / (pi r^2), r no less than half a quantum.
SurfaceEstimate estimate_surface(const Neighborhood& neighbors, const Quantization& quantization,
                                 const std::optional<Vec3d>& viewpoint);

}  // namespace strata
