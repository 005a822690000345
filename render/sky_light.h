#pragma once

#include "core/math/vec.h"

namespace strata {

/// The axis of the world that points upwards. Where that is y, z points to where in other worlds south is.
enum class UpAxis { z, y };

/// Light of surfaces that are no points: a sky whose light changes evenly from one side to the other. Of the six directions up gets all, then
/// south, east, west, north, down.
struct Sky {
    float level = 0.675f, along_x = 0.057f, along_y = -0.191f, along_z = 0.325f;

    /// normal   of length 1, world
    /// returns  the part of the surface's color that it shows, in linear light, from 0.29 to 1.06
    float light(float normal_x, float normal_y, float normal_z) const { return level + along_x * normal_x + along_y * normal_y + along_z * normal_z; }
    float light(const Vec3f& normal) const { return light(normal.x(), normal.y(), normal.z()); }
};

constexpr Sky sky_of(UpAxis up) { return up == UpAxis::z ? Sky() : Sky{.along_y = 0.325f, .along_z = 0.191f}; }

}  // namespace strata
