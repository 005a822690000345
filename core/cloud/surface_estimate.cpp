#include "core/cloud/surface_estimate.h"

#include <algorithm>
#include <numbers>

#include "core/cloud/plane_fit.h"

namespace strata {
namespace {

bool looks_away(const Vec3d& normal, const Vec3d& towards) {
    if (const double along = normal.dot(towards); along != 0.0) return along < 0.0;
    for (const int axis : {2, 1, 0})
        if (normal[axis] != 0.0) return normal[axis] < 0.0;
    return false;
}

}  // namespace

SurfaceEstimate estimate_surface(const Neighborhood& neighbors, const Quantization& quantization,
                                 const std::optional<Vec3d>& viewpoint) {
    SurfaceEstimate estimate;
    Vec3d normal = fit_normal(neighbors.points, quantization.scale);
    const Vec3d towards = viewpoint ? Vec3d(*viewpoint - quantization.world_from_quanta(neighbors.center)) : Vec3d(0.0, 0.0, 1.0);
    if (looks_away(normal, towards)) normal = -normal;
    estimate.normal = normal.cast<float>() + Vec3f::Zero();  // no negative zeros
    const double least = 0.5 * quantization.scale.minCoeff();
    const double radius_squared = std::max(neighbors.radius_squared, least * least);
    estimate.density = float(double(neighbors.points.size() - 1) / (std::numbers::pi * radius_squared));
    return estimate;
}

}  // namespace strata
