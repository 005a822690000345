#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "core/math/camera.h"
#include "render/pass/point_block.h"

namespace strata {

/// A vertex in a picture.
struct ProjectedVertex {
    int32_t x, y;  // 1/256 pixel, to the right of and below the upper left corner of the whole picture; x is kUnsnapped where it lies nowhere there
    float key;     // reversed depth, as points have it: larger is nearer, in (0, 1]; 0: it lies before the near plane
};

inline constexpr int32_t kSubpixels = 256, kSubpixelBits = 8;
inline constexpr int32_t kUnsnapped = INT32_MIN;
inline constexpr double kGuardPx = 1 << 20;  // vertices farther from the corner are not snapped: products of differences fit in 64 bits with ease

/// Takes world positions to pixels and depth, in double precision: a mesh may lie anywhere. Meshes are drawn in integers from then on.
///   d      = p - eye
///   depth  = forward . d                               eye depth, world units
///   x_px   = center_x + x_row . d / w                  w = depth in perspective, 1 in orthographic projection
///   y_px   = center_y + y_row . d / w                  downwards, from the top edge of the whole picture
///   key    = near / depth, or (far - depth) / (far - near)
struct MeshProjection {
    /// offset_px  of a sample, from the middle of its pixel
    MeshProjection(const Camera& camera, uint32_t width_px, uint32_t height_px, const Vec2f& offset_px)
        : perspective(camera.projection == Projection::perspective),
          eye(camera.eye),
          forward(camera.forward()),
          unit_px(pixels_per_unit(camera, 1.0, height_px)),
          x_row(unit_px * camera.right()),
          y_row(-unit_px * camera.up()),
          right(camera.right() / unit_px),
          down(-camera.up() / unit_px),
          center_x(0.5 * width_px - double(offset_px.x())),
          center_y(0.5 * height_px - double(offset_px.y())),
          near_depth(camera.near_depth),
          key_scale(perspective ? camera.near_depth : -1.0 / (camera.far_depth - camera.near_depth)),
          key_offset(perspective ? 0.0 : camera.far_depth / (camera.far_depth - camera.near_depth)) {}

    float key_of(double depth) const {
        const double key = perspective ? key_scale / depth : key_offset + key_scale * depth;
        return key > double(kLeastKey) ? float(key) : kLeastKey;
    }
    double depth_of(double key) const { return perspective ? key_scale / key : (key - key_offset) / key_scale; }

    /// Where the ray of a place in the picture begins, from the eye, and how far it goes for a depth of 1.
    struct Ray {
        Vec3d origin, direction;
    };
    Ray ray(double x_px, double y_px) const {
        const Vec3d aside = (x_px - center_x) * right + (y_px - center_y) * down;
        return perspective ? Ray{Vec3d::Zero(), forward + aside} : Ray{aside, forward};
    }

    bool perspective;
    Vec3d eye, forward;
    double unit_px;  // pixels that a world unit covers, at depth 1 in perspective
    Vec3d x_row, y_row;
    Vec3d right, down;  // that a pixel goes to the right and down, world units, at depth 1 in perspective
    double center_x, center_y, near_depth, key_scale, key_offset;
};

/// Of a number below 2^31 in size: the nearest integer, halves to the even one. Plain arithmetic, so that loops around it become vectors.
inline int32_t nearest_integer(double value) { return int32_t(uint32_t(std::bit_cast<uint64_t>(value + 0x1.8p52))); }

inline ProjectedVertex project_vertex(const MeshProjection& view, double world_x, double world_y, double world_z) {
    const double dx = world_x - view.eye[0], dy = world_y - view.eye[1], dz = world_z - view.eye[2];
    const double depth = view.forward[0] * dx + view.forward[1] * dy + view.forward[2] * dz;
    const double across = view.x_row[0] * dx + view.x_row[1] * dy + view.x_row[2] * dz;
    const double below = view.y_row[0] * dx + view.y_row[1] * dy + view.y_row[2] * dz;
    const double inverse = view.perspective ? 1.0 / depth : 1.0;
    const double x = view.center_x + across * inverse, y = view.center_y + below * inverse;
    const double key = view.perspective ? view.key_scale / depth : view.key_offset + view.key_scale * depth;
    const bool seen = depth >= view.near_depth, snapped = seen & (std::abs(x) <= kGuardPx) & (std::abs(y) <= kGuardPx);
    const float kept = key > double(kLeastKey) ? float(key) : kLeastKey;
    return {snapped ? nearest_integer((snapped ? x : 0.0) * kSubpixels) : kUnsnapped, snapped ? nearest_integer((snapped ? y : 0.0) * kSubpixels) : 0, seen ? kept : 0.0f};
}

}  // namespace strata
