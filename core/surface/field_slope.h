#pragma once

#include <cmath>

#include "core/math/vec.h"

namespace strata {

/// A field's slope at a sample between two others, a step each: of both, of the one that is finite, or 0.
inline double slope_between(double before, double here, double after) {
    const bool has_before = std::isfinite(before), has_after = std::isfinite(after);
    return has_before && has_after ? 0.5 * (after - before) : has_after ? after - here : has_before ? here - before : 0.0;
}

/// Of unit length; zero where that cannot be.
inline Vec3f unit_normal(const Vec3d& direction) {
    const double length = direction.norm();
    return length > 0.0 && std::isfinite(length) ? Vec3f((direction / length).cast<float>()) : Vec3f(Vec3f::Zero());
}

}  // namespace strata
