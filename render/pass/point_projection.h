#pragma once

#include <array>
#include <cstdint>

#include "core/math/camera.h"
#include "core/math/quantization.h"

namespace strata {

/// Takes the quanta of a cloud to pixels and depth. The eye's quanta are subtracted as integers before anything becomes
/// float, so the error is 2^-24 of the distance to the eye, wherever the cloud lies.
///   d        = float(quanta - eye_quanta)
///   depth    = depth_row . (d, 1)                          eye depth, world units
///   x_px     = center_x + x_row . (d, 1) / w               w = depth in perspective, 1 in orthographic projection
///   y_px     = center_y + y_row . (d, 1) / w               downwards, from the top edge of the whole picture
///   key      = key_scale / depth or key_offset + key_scale * depth   reversed: larger is nearer, in (0, 1]
struct PointProjection {
    PointProjection(const Camera& camera, const Quantization& quantization, uint32_t width_px, uint32_t height_px);

    float linear_depth(float key) const {
        return perspective ? key_scale / key : (key - key_offset) / key_scale;
    }

    bool perspective;
    std::array<int64_t, 3> eye_quanta;
    std::array<float, 4> x_row, y_row, depth_row;
    std::array<float, 3> right, down, forward;  // of the picture, world axes
    float center_x, center_y;
    float near_depth;
    float key_scale, key_offset;
    float pixels_per_unit;  // at depth 1 in perspective, everywhere in orthographic projection
};

}  // namespace strata
