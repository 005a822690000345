#pragma once

#include <limits>

#include "core/math/vec.h"

namespace strata {

/// Axis-aligned box, world units, both ends included. A new one is empty: it holds nothing and grows by `extend`.
struct Box3d {
    Vec3d min = Vec3d::Constant(std::numeric_limits<double>::infinity());
    Vec3d max = Vec3d::Constant(-std::numeric_limits<double>::infinity());

    bool empty() const { return !(min.array() <= max.array()).all(); }
    Vec3d size() const { return max - min; }
    Vec3d center() const { return 0.5 * (min + max); }
    bool contains(const Vec3d& p) const { return (p.array() >= min.array()).all() && (p.array() <= max.array()).all(); }
    void extend(const Vec3d& p) {
        min = min.cwiseMin(p);
        max = max.cwiseMax(p);
    }
    void extend(const Box3d& other) {
        min = min.cwiseMin(other.min);
        max = max.cwiseMax(other.max);
    }
};

}  // namespace strata
