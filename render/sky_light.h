#pragma once

#include "core/math/vec.h"

namespace strata {

/// Light of surfaces that are no points: a sky whose light changes evenly from one side to the other. Of the six directions up gets all, then
/// south, east, west, north, down.
/// normal   of length 1, world
/// returns  the part of the surface's color that it shows, in linear light, from 0.29 to 1.06
inline float sky_light(float normal_x, float normal_y, float normal_z) { return 0.675f + 0.057f * normal_x + -0.191f * normal_y + 0.325f * normal_z; }
inline float sky_light(const Vec3f& normal) { return sky_light(normal.x(), normal.y(), normal.z()); }

}  // namespace strata
