#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "render/pass/point_projection.h"
#include "render/pass/points_pass.h"

namespace strata {

// Steps of drawing and resolving, for a block of points at a time. Inline: kernels compile them for each instruction set.

inline constexpr size_t kPointBlock = 256;  // their values stay in the nearest cache

/// Points of one block after projection. Points that are not drawn have key 0.
struct PointBlock {
    alignas(64) float x_px[kPointBlock];
    alignas(64) float y_px[kPointBlock];
    alignas(64) float size_px[kPointBlock];
    alignas(64) float key[kPointBlock];
    // Tilt of the surface around the point: how much farther it lies a pixel to the right, and one down, in pixels.
    alignas(64) float slope_x[kPointBlock];
    alignas(64) float slope_y[kPointBlock];
};

/// Whether every quanta difference between the node's points and the eye fits in 32 bits.
inline bool is_near(const ResidentNode& points, const PointProjection& view) {
    for (size_t axis = 0; axis < 3; ++axis) {
        const int64_t eye = view.eye_quanta[axis];
        if (eye != int32_t(eye) || points.min_quanta[int(axis)] - eye < INT32_MIN || points.max_quanta[int(axis)] - eye > INT32_MAX)
            return false;
    }
    return true;
}

template <bool perspective, bool near>
inline void project_block(const PointProjection& view, const int32_t* x, const int32_t* y, const int32_t* z, size_t count,
                          PointBlock& out) {
    const int32_t eye_x = int32_t(view.eye_quanta[0]), eye_y = int32_t(view.eye_quanta[1]), eye_z = int32_t(view.eye_quanta[2]);
    for (size_t i = 0; i < count; ++i) {
        float dx, dy, dz;
        if constexpr (near) {
            dx = float(x[i] - eye_x);
            dy = float(y[i] - eye_y);
            dz = float(z[i] - eye_z);
        } else {
            dx = float(x[i] - view.eye_quanta[0]);
            dy = float(y[i] - view.eye_quanta[1]);
            dz = float(z[i] - view.eye_quanta[2]);
        }
        const float depth = view.depth_row[0] * dx + view.depth_row[1] * dy + view.depth_row[2] * dz + view.depth_row[3];
        const float across = view.x_row[0] * dx + view.x_row[1] * dy + view.x_row[2] * dz + view.x_row[3];
        const float down = view.y_row[0] * dx + view.y_row[1] * dy + view.y_row[2] * dz + view.y_row[3];
        float key;
        if constexpr (perspective) {
            const float inverse = 1.0f / depth;
            key = view.key_scale * inverse;
            out.x_px[i] = view.center_x + across * inverse;
            out.y_px[i] = view.center_y + down * inverse;
        } else {
            // What lies beyond far still shows, behind all else.
            key = std::max(view.key_offset + view.key_scale * depth, 0x1p-100f);
            out.x_px[i] = view.center_x + across;
            out.y_px[i] = view.center_y + down;
        }
        out.key[i] = depth >= view.near_depth ? key : 0.0f;
    }
}

/// Adaptive diameter of a splat.
template <bool perspective>
inline float splat_size_px(const PointProjection& view, const SplatStyle& style, float spacing, float key) {
    float size = style.spacing_factor * view.pixels_per_unit * spacing;
    if constexpr (perspective) size *= key * (1.0f / view.key_scale);
    return std::min(std::max(size, style.least_px), style.most_px);
}

/// Adaptive diameters of projected points, and the tilt of the surface around them.
template <bool perspective>
inline void shape_block(const PointProjection& view, const SplatStyle& style, const PointShape* shapes, size_t count, PointBlock& out) {
    constexpr float kMostSlope = 4.0f;  // 76 degrees: what is steeper is drawn as steep as this
    const float inverse_unit = 1.0f / view.pixels_per_unit;
    for (size_t i = 0; i < count; ++i) {
        out.size_px[i] = splat_size_px<perspective>(view, style, shapes[i].spacing, out.key[i]);
        const float nx = shapes[i].normal[0], ny = shapes[i].normal[1], nz = shapes[i].normal[2];
        const float right = view.right[0] * nx + view.right[1] * ny + view.right[2] * nz;
        const float down = view.down[0] * nx + view.down[1] * ny + view.down[2] * nz;
        float along = view.forward[0] * nx + view.forward[1] * ny + view.forward[2] * nz;  // the view ray
        if constexpr (perspective)
            along += (right * (out.x_px[i] - view.center_x) + down * (out.y_px[i] - view.center_y)) * inverse_unit;
        // Slope (right, down) / -along, no longer than the most; a zero normal gives zero.
        const float across = std::sqrt(right * right + down * down);
        const float divisor = std::max(std::abs(along), std::max(across / kMostSlope, 1e-6f));
        const float scale = (along > 0.0f ? -1.0f : 1.0f) / divisor;
        out.slope_x[i] = right * scale;
        out.slope_y[i] = down * scale;
    }
}

/// The key on a plane through that of `key` that lies `rise_px` farther there. On a plane, one over depth is linear in the picture.
/// inverse_unit  1 / view.pixels_per_unit
template <bool perspective>
inline float key_on_plane(const PointProjection& view, float key, float rise_px, float inverse_unit) {
    return perspective ? key - key * (rise_px * inverse_unit) : key + view.key_scale * (rise_px * inverse_unit);
}

inline constexpr float kLeastKey = 0x1p-100f;  // of what is drawn

}  // namespace strata
