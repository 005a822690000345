#pragma once

#include <array>
#include <optional>

#include "core/math/vec.h"

namespace strata {

/// A trilinear function on a line through its cell: c[0] + c[1] s + c[2] s^2 + c[3] s^3.
struct LineCubic {
    std::array<double, 4> c;

    double operator()(double s) const { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); }
};

/// corners  values at the corners of the unit cube, x fastest, then y
/// from     the place of s = 0; step: the way to s = 1
LineCubic trilinear_on_line(const std::array<double, 8>& corners, const Vec3d& from, const Vec3d& step);

/// Where the cubic first is >= 0 for some s in (0, 1], if it is not at 0, or first < 0, if it is. What touches zero from below and turns is
/// found too, but for rounding. The interval is split at the cubic's extrema, so that no pair of roots between is missed.
/// returns  s, where the cubic is within a rounding of zero or s within 2^-40
/// source   G. Marmitt et al., "Fast and Accurate Ray-Voxel Intersection Techniques for Iso-Surface Ray Tracing", VMV 2004
std::optional<double> first_crossing(const LineCubic& cubic);

}  // namespace strata
