#include "core/surface/trilinear_root.h"

#include <algorithm>
#include <cmath>

namespace strata {
namespace {

// Within an interval at whose ends the cubic is on different sides of zero: bisection, by Newton's steps where they stay within.
double root_between(const LineCubic& cubic, double low, double high) {
    const bool low_inside = cubic(low) >= 0.0;
    double s = 0.5 * (low + high);
    for (int i = 0; i < 64 && high - low > 0x1p-40; ++i) {
        const double value = cubic(s);
        if (value == 0.0) return s;
        (value >= 0.0) == low_inside ? low = s : high = s;
        const double slope = cubic.c[1] + s * (2.0 * cubic.c[2] + s * 3.0 * cubic.c[3]);
        const double next = s - value / slope;
        const bool within = next > low && next < high;
        if (within && std::abs(next - s) < 0x1p-41) return next;
        s = within ? next : 0.5 * (low + high);
    }
    return s;
}

}  // namespace

LineCubic trilinear_on_line(const std::array<double, 8>& f, const Vec3d& from, const Vec3d& step) {
    const double x = from[0], y = from[1], z = from[2], dx = step[0], dy = step[1], dz = step[2];
    const double kx = f[1] - f[0], ky = f[2] - f[0], kz = f[4] - f[0];
    const double kxy = f[3] - f[2] - kx, kyz = f[6] - f[4] - ky, kzx = f[5] - f[4] - kx;
    const double kxyz = (f[7] - f[6]) - (f[5] - f[4]) - (f[3] - f[2]) + kx;
    return {{f[0] + kx * x + ky * y + kz * z + kxy * x * y + kyz * y * z + kzx * z * x + kxyz * x * y * z,
             kx * dx + ky * dy + kz * dz + kxy * (x * dy + y * dx) + kyz * (y * dz + z * dy) + kzx * (z * dx + x * dz) +
                 kxyz * (x * y * dz + x * z * dy + y * z * dx),
             kxy * dx * dy + kyz * dy * dz + kzx * dz * dx + kxyz * (x * dy * dz + y * dx * dz + z * dx * dy), kxyz * dx * dy * dz}};
}

std::optional<double> first_crossing(const LineCubic& cubic) {
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
