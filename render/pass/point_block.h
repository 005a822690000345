#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "render/pass/point_projection.h"
#include "render/pass/points_pass.h"

namespace strata {

// Steps of drawing and resolving, for a block of points at a time. Inline: kernels compile them for each instruction set.

inline constexpr size_t kPointBlock = 256;  // their values stay in the nearest cache
inline constexpr float kLeastKey = 0x1p-100f;  // of what is drawn
inline constexpr float kLeastRound = 0.75f;  // radius, pixels: a disc no larger may miss every center, and its square covers two by two at most

/// What a point leaves at a pixel: of two the larger stays, which is nearer or else of the lower rank.
inline uint64_t make_word(float key, uint32_t rank) { return uint64_t{std::bit_cast<uint32_t>(key)} << 32 | uint32_t(~rank); }
inline float key_of_word(uint64_t word) { return std::bit_cast<float>(uint32_t(word >> 32)); }

/// Points of one block after projection. Points that are not drawn have key 0.
struct PointBlock {
    alignas(64) float x_px[kPointBlock];
    alignas(64) float y_px[kPointBlock];
    alignas(64) float size_px[kPointBlock];
    alignas(64) float key[kPointBlock];
    // Tilt of the surface around the point: how much farther it lies a pixel to the right, and one down, in pixels.
    alignas(64) float slope_x[kPointBlock];
    alignas(64) float slope_y[kPointBlock];
    // Of surfels: how far they reach from their center, pixels.
    alignas(64) float reach_left[kPointBlock], reach_right[kPointBlock], reach_up[kPointBlock], reach_down[kPointBlock];
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

inline constexpr float kMostSlope = 4.0f;  // 76 degrees: a plane of neighbors that is steeper is drawn as steep as this
inline constexpr float kMostSurfelSlope = 1000.0f;  // far beyond what a byte's normal can tell from edge-on

/// Tilt of the plane through projected point i.
/// nx, ny, nz  its normal, world axes, of any length and either side; zero: it faces the viewer
template <bool perspective>
inline void tilt_plane(const PointProjection& view, float nx, float ny, float nz, float most_slope, size_t i, PointBlock& out) {
    const float right = view.right[0] * nx + view.right[1] * ny + view.right[2] * nz;
    const float down = view.down[0] * nx + view.down[1] * ny + view.down[2] * nz;
    float along = view.forward[0] * nx + view.forward[1] * ny + view.forward[2] * nz;  // the view ray
    if constexpr (perspective)
        along += (right * (out.x_px[i] - view.center_x) + down * (out.y_px[i] - view.center_y)) * (1.0f / view.pixels_per_unit);
    // Slope (right, down) / -along, no longer than the most; a zero normal gives zero.
    const float across = std::sqrt(right * right + down * down);
    const float divisor = std::max(std::abs(along), std::max(across / most_slope, 1e-6f));
    const float scale = (along > 0.0f ? -1.0f : 1.0f) / divisor;
    out.slope_x[i] = right * scale;
    out.slope_y[i] = down * scale;
}

/// Adaptive diameters of projected points, and the tilt of the surface around them.
template <bool perspective>
inline void shape_block(const PointProjection& view, const SplatStyle& style, const PointShape* shapes, size_t count, PointBlock& out) {
    for (size_t i = 0; i < count; ++i) {
        out.size_px[i] = splat_size_px<perspective>(view, style, shapes[i].spacing, out.key[i]);
        tilt_plane<perspective>(view, shapes[i].normal[0], shapes[i].normal[1], shapes[i].normal[2], kMostSlope, i, out);
    }
}

/// Tilt of surfels that have their sizes, and the box around the ellipse that each is in the picture.
/// In perspective a column x pixels from the center touches the outline where the plane through the eye and it touches the disc:
///   m . P = radius |m - (m . n) n|,  m = right - (column / pixels_per_unit) forward,  P from the eye to the center,
/// which is a quadratic equation in x; rows alike. A disc that comes near to the eye reaches kSurfelReach radii at most.
template <bool perspective>
inline void surfel_block(const PointProjection& view, const PackedNormal* normals, size_t count, PointBlock& out) {
    const float inverse_unit = 1.0f / view.pixels_per_unit;
    for (size_t i = 0; i < count; ++i) {
        const float nx = normals[i][0], ny = normals[i][1], nz = normals[i][2];
        tilt_plane<perspective>(view, nx, ny, nz, kMostSurfelSlope, i, out);
        const float square = nx * nx + ny * ny + nz * nz;
        const float unit = square > 0.0f ? 1.0f / std::sqrt(square) : 0.0f;
        const float forward = square > 0.0f ? unit * (view.forward[0] * nx + view.forward[1] * ny + view.forward[2] * nz) : 1.0f;
        const float radius = 0.5f * out.size_px[i], angle = perspective ? radius * inverse_unit : 0.0f;
        const float divisor = std::max(1.0f - angle * angle * (1.0f - forward * forward), 0.25f), inverse = 1.0f / divisor;
        const auto reach = [&](const std::array<float, 3>& axis, float position_px, float& low, float& high) {
            const float aside = perspective ? position_px * inverse_unit : 0.0f;
            const float m = unit * (axis[0] * nx + axis[1] * ny + axis[2] * nz) - aside * forward;
            const float shift = -radius * angle * (aside + m * forward);
            const float half = std::sqrt(std::max(shift * shift + divisor * radius * radius * (1.0f + aside * aside - m * m), 0.0f));
            low = std::min(std::max((half + shift) * inverse, 0.5f), kSurfelReach * radius);
            high = std::min(std::max((half - shift) * inverse, 0.5f), kSurfelReach * radius);
            // Small ones are drawn as squares.
            low = radius > kLeastRound ? low : radius;
            high = radius > kLeastRound ? high : radius;
        };
        reach(view.right, out.x_px[i] - view.center_x, out.reach_left[i], out.reach_right[i]);
        reach(view.down, out.y_px[i] - view.center_y, out.reach_up[i], out.reach_down[i]);
    }
}

/// The key on a plane through that of `key` that lies `rise_px` farther there. On a plane, one over depth is linear in the picture.
/// inverse_unit  1 / view.pixels_per_unit
template <bool perspective>
inline float key_on_plane(const PointProjection& view, float key, float rise_px, float inverse_unit) {
    return perspective ? key - key * (rise_px * inverse_unit) : key + view.key_scale * (rise_px * inverse_unit);
}

/// A splat at a pixel that lies in the box around it.
struct SplatHit {
    float key;     // of the splat there
    float square;  // of the distance from its center in its plane, in radii; about so for small ones
    int32_t covered;  // 0 or 1; GCC 12 keeps a bool in memory, which costs the vector code
};

/// What a splat is at the pixel whose center lies (x, y) from the splat's. Plain arithmetic without a jump, so that loops around it become
/// vector code. Gaussian ones are paraboloids.
/// inverse_unit  1 / view.pixels_per_unit
template <SplatShape shape, bool perspective>
inline SplatHit splat_at(const PointProjection& view, const PointBlock& block, size_t i, float x, float y, float inverse_unit) {
    const float key = block.key[i];
    if constexpr (shape == SplatShape::square) return {key, 0.0f, 1};
    const float radius = 0.5f * block.size_px[i];
    const float inverse_square = 1.0f / (radius * radius);
    const bool round = radius > kLeastRound;
    if constexpr (shape == SplatShape::disc) {
        const float square = (x * x + y * y) * inverse_square;
        return {key, square, (square <= 1.0f) | !round};
    }
    const float rise = block.slope_x[i] * x + block.slope_y[i] * y;
    if constexpr (shape == SplatShape::surfel) {
        // The ray meets the plane at 1 / nearness of the center's depth, (across, down, rise) / nearness from the center.
        const float nearness = perspective ? 1.0f - rise * inverse_unit : 1.0f;
        const float across = perspective ? x + rise * ((block.x_px[i] - view.center_x) * inverse_unit) : x;
        const float down = perspective ? y + rise * ((block.y_px[i] - view.center_y) * inverse_unit) : y;
        const float square = across * across + down * down + rise * rise, limit = radius * nearness;
        const bool inside = (nearness > 0.0f) & (square <= limit * limit);
        const bool own = (x > -0.5f) & (x <= 0.5f) & (y > -0.5f) & (y <= 0.5f);  // the pixel of the center, even edge-on
        // Outside of the disc its plane may be anywhere; no part of the disc is farther from its center than a radius.
        const float within = inside ? rise : std::min(std::max(rise, -radius), radius);
        return {std::max(key_on_plane<perspective>(view, key, within, inverse_unit), kLeastKey), square * inverse_square, inside | own | !round};
    }
    const float square = (x * x + y * y + rise * rise) * inverse_square;
    // Behind the plane the key falls with the square of the distance, by a depth of one radius at the rim, at most to half.
    const float fall = std::min(radius * inverse_unit, 0.5f) * square;
    const float on_plane = key_on_plane<perspective>(view, key, rise, inverse_unit);
    const float behind = perspective ? on_plane - on_plane * fall : on_plane + view.key_scale * fall;
    return {round ? std::max(behind, kLeastKey) : key, square, (square <= 1.0f) | !round};
}

}  // namespace strata
