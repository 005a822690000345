#include "core/math/frustum.h"

#include <cmath>

namespace strata {

Frustum::Frustum(const Camera& camera, double aspect) : eye_(camera.eye) {
    const Vec3d right = camera.right(), up = camera.up(), forward = camera.forward();
    const Plane near_plane = {forward, -camera.near_depth};
    if (camera.projection == Projection::orthographic) {
        const double half_height = 0.5 * camera.height, half_width = half_height * aspect;
        planes_ = {Plane{right, half_width}, Plane{-right, half_width}, Plane{up, half_height}, Plane{-up, half_height},
                   near_plane};
        return;
    }
    const double slope_y = std::tan(0.5 * camera.fov_rad), slope_x = slope_y * aspect;
    planes_ = {Plane{slope_x * forward + right, 0.0}, Plane{slope_x * forward - right, 0.0},
               Plane{slope_y * forward + up, 0.0}, Plane{slope_y * forward - up, 0.0}, near_plane};
}

bool Frustum::intersects(const Box3d& box) const {
    const Vec3d center = box.center() - eye_, half = 0.5 * box.size();
    for (const Plane& plane : planes_) {
        // The corner farthest along the normal decides. A box flush with the plane counts as in sight.
        const double reach = plane.normal.cwiseAbs().dot(half);
        if (plane.normal.dot(center) + reach + plane.offset < -1e-12 * reach) return false;
    }
    return true;
}

}  // namespace strata
