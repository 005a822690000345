#pragma once

#include "core/math/camera.h"

namespace strata {

/// Eye-dome lighting: shade = exp(-strength * mean response of 8 neighbors), response = how much nearer a neighbor is
/// over how far it lies sideways, both in world units; then the mean over several distances, each twice the one before. So a
/// plane tilted by phi has the mean response tan(phi) (1 + sqrt 2) / 8 at any resolution and distance, and one that faces the
/// viewer has none. A neighbor beyond the picture's border is what the opposite one says of a level slope through both; a
/// jump says nothing. Where both lie outside, neither counts.
struct EdlSettings {
    static constexpr int kScales = 3;

    float strength = 0.7f;       // 0: off
    float radius = 0.002f;       // how far the nearest neighbors lie, at least, in heights of the picture
    bool follow_splats = true;   // neighbors lie a splat away where splats are larger, so that their rims do not show
    float most_response = 4.0f;  // what a jump in depth counts for: the slope of 76 degrees

    /// Whole pixels to the neighbors along the axes, for scale 0 to kScales - 1. Those on the diagonals lie
    /// diagonal_px(reach) along each axis.
    int reach_px(uint32_t height_px, int scale) const;
};

int diagonal_px(int reach_px);

/// World units that a pixel covers: x * depth + y.
Vec2f pixel_world_size(const Camera& camera, uint32_t height_px);

}  // namespace strata
