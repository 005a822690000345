#pragma once

#include <algorithm>
#include <chrono>
#include <functional>
#include <vector>

#include "core/math/box.h"

namespace strata {

// What programs that time peers have in common.

inline double seconds_of(const std::function<void()>& act) {
    const auto start = std::chrono::steady_clock::now();
    act();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}
inline double median_seconds(int times, const std::function<void()>& act) {
    std::vector<double> all;
    for (int i = 0; i < times; ++i) all.push_back(seconds_of(act));
    std::sort(all.begin(), all.end());
    return all[all.size() / 2];
}

/// A pinhole before a box, in its coordinates, for a square picture.
struct PeerCamera {
    Vec3d eye, first, per_x, per_y;  // direction of pixel (x, y): first + x per_x + y per_y

    /// half  of the picture's width, in radii of the box, at its center
    PeerCamera(const Box3d& box, double half, int picture) {
        const Vec3d forward = Vec3d(-1.0, 0.7, -0.5).normalized();
        const double radius = 0.5 * box.size().norm();
        eye = box.center() - 2.5 * radius * forward;
        const Vec3d right = forward.cross(Vec3d::UnitZ()).normalized(), up = right.cross(forward);
        half /= 2.5;
        per_x = 2.0 * half / picture * right;
        per_y = -2.0 * half / picture * up;
        first = forward - half * right + half * up + 0.5 * (per_x + per_y);
    }
    Vec3d direction(int x, int y) const { return first + x * per_x + y * per_y; }
};

}  // namespace strata
