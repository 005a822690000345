#include "render/pass/point_projection.h"

#include <algorithm>
#include <cmath>

namespace strata {

PointProjection::PointProjection(const Camera& camera, const Quantization& quantization, uint32_t width_px,
                                 uint32_t height_px)
    : perspective(camera.projection == Projection::perspective),
      center_x(0.5f * float(width_px)),
      center_y(0.5f * float(height_px)),
      near_depth(float(camera.near_depth)),
      pixels_per_unit(float(strata::pixels_per_unit(camera, 1.0, height_px))) {
    // The whole quanta go into the integer subtraction, the rest of the eye's position into the last column.
    Vec3d rest;
    for (int axis = 0; axis < 3; ++axis) {
        const double eye = camera.eye[axis] - quantization.offset[axis];
        const double whole = std::clamp(std::nearbyint(eye / quantization.scale[axis]), -0x1p62, 0x1p62);
        eye_quanta[size_t(axis)] = int64_t(whole);
        rest[axis] = whole * quantization.scale[axis] - eye;
    }
    const double scale_px = strata::pixels_per_unit(camera, 1.0, height_px);
    const auto set_row = [&](std::array<float, 4>& row, const Vec3d& axis, double scale) {
        for (int i = 0; i < 3; ++i) row[size_t(i)] = float(axis[i] * quantization.scale[i] * scale);
        row[3] = float(axis.dot(rest) * scale);
    };
    set_row(x_row, camera.right(), scale_px);
    set_row(y_row, -camera.up(), scale_px);
    set_row(depth_row, camera.forward(), 1.0);
    for (int axis = 0; axis < 3; ++axis) {
        right[size_t(axis)] = float(camera.right()[axis]);
        down[size_t(axis)] = float(-camera.up()[axis]);
        forward[size_t(axis)] = float(camera.forward()[axis]);
    }
    if (perspective) {
        key_scale = near_depth;
        key_offset = 0.0f;
    } else {
        const double range = camera.far_depth - camera.near_depth;
        key_scale = float(-1.0 / range);
        key_offset = float(camera.far_depth / range);
    }
}

}  // namespace strata
