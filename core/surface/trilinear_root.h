#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/math/vec.h"

namespace strata {

/// A trilinear function on a line through its cell: c[0] + c[1] s + c[2] s^2 + c[3] s^3.
struct LineCubic {
    std::array<double, 4> c;

    double operator()(double s) const { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); }
};

/// f     values at the corners of the unit cube, x fastest, then y
/// from  the place of s = 0; step: the way to s = 1
inline LineCubic trilinear_on_line(const std::array<double, 8>& f, const Vec3d& from, const Vec3d& step) {
    using Four = double __attribute__((vector_size(32)));
    // Interpolated along x for the four edges, then along y, then along z: each time a polynomial of one degree more.
    const Four low = {f[0], f[4], f[2], f[6]}, rise = Four{f[1], f[5], f[3], f[7]} - low;
    const Four edge0 = low + from[0] * rise, edge1 = step[0] * rise;
    using Two = double __attribute__((vector_size(16)));
    const Two near0 = {edge0[0], edge0[1]}, near1 = {edge1[0], edge1[1]};
    const Two across0 = Two{edge0[2], edge0[3]} - near0, across1 = Two{edge1[2], edge1[3]} - near1;
    const double y = from[1], dy = step[1], z = from[2], dz = step[2];
    const Two face0 = near0 + y * across0, face1 = near1 + y * across1 + dy * across0, face2 = dy * across1;
    const double up0 = face0[1] - face0[0], up1 = face1[1] - face1[0], up2 = face2[1] - face2[0];
    return {{face0[0] + z * up0, face1[0] + z * up1 + dz * up0, face2[0] + z * up2 + dz * up1, dz * up2}};
}

/// Within an interval at whose ends the cubic is on different sides of zero: bisection, by Newton's steps where they stay within.
inline double root_between(const LineCubic& cubic, double low, double high) {
    const double at_low = cubic(low), at_high = cubic(high);
    const bool low_inside = at_low >= 0.0;
    const double most_curvature = 2.0 * std::abs(cubic.c[2]) + 6.0 * std::abs(cubic.c[3]);
    // Cells are small before most surfaces: the chord's zero is near the root.
    double s = low + (high - low) * (at_low / (at_low - at_high));
    if (!(s > low && s < high)) s = 0.5 * (low + high);
    for (int i = 0; i < 64 && high - low > 0x1p-40; ++i) {
        const double value = cubic(s);
        if (value == 0.0) return s;
        (value >= 0.0) == low_inside ? low = s : high = s;
        const double slope = cubic.c[1] + s * (2.0 * cubic.c[2] + s * 3.0 * cubic.c[3]);
        const double next = s - value / slope;
        const bool within = next > low && next < high;
        // Newton's next place is off by less than this (Kantorovich).
        const double step = next - s;
        if (within && (std::abs(step) < 0x1p-41 || most_curvature * step * step < 0x1p-41 * std::abs(slope))) return next;
        s = within ? next : 0.5 * (low + high);
    }
    return s;
}

/// Where the cubic first is >= 0 for some s in (0, 1], if it is not at 0, or first < 0, if it is. What touches zero from below and turns is
/// found too, but for rounding. The interval is split at the cubic's extrema, so that no pair of roots between is missed.
/// returns  s, where the cubic is within a rounding of zero or s within 2^-40
/// source   G. Marmitt et al., "Fast and Accurate Ray-Voxel Intersection Techniques for Iso-Surface Ray Tracing", VMV 2004
inline std::optional<double> first_crossing(const LineCubic& cubic) {
    constexpr double kThird = 1.0 / 3.0;
    // By its coefficients in Bernstein's basis: a cubic has no more zeros than these change sign.
    const double end = cubic(1.0), first_third = cubic.c[0] + kThird * cubic.c[1],
                 second_third = cubic.c[0] + kThird * (2.0 * cubic.c[1] + cubic.c[2]);
    const bool starts = cubic.c[0] >= 0.0, ends_inside = end >= 0.0;
    const int changes = (starts != (first_third >= 0.0)) + ((first_third >= 0.0) != (second_third >= 0.0)) + ((second_third >= 0.0) != ends_inside);
    if (changes == 0) return std::nullopt;
    if (changes == 1) return root_between(cubic, 0.0, 1.0);
    // Zeros of the slope c1 + 2 c2 s + 3 c3 s^2, by the form that does not cancel.
    std::array<double, 4> ends = {0.0, 1.0, 1.0, 1.0};
    size_t count = 1;
    const double a = 3.0 * cubic.c[3], b = cubic.c[2], c = cubic.c[1], square = b * b - a * c;
    if (square > 0.0) {
        const double q = -(b + std::copysign(std::sqrt(square), b));
        const double first = a != 0.0 ? q / a : 2.0, second = q != 0.0 ? c / q : 2.0;
        for (const double s : {std::min(first, second), std::max(first, second)})
            if (s > 0.0 && s < 1.0) ends[count++] = s;
    }
    ends[count] = 1.0;
    const bool inside = cubic(0.0) >= 0.0;
    for (size_t i = 0; i < count; ++i)
        if ((cubic(ends[i + 1]) >= 0.0) != inside) return root_between(cubic, ends[i], ends[i + 1]);
    return std::nullopt;
}

}  // namespace strata
