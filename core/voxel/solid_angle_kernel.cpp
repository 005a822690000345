#include "core/voxel/solid_angle_kernel.h"

#include <cmath>

namespace strata {

void half_solid_angles(size_t n, PointColumn p, PointColumn q, const Vec3d& apex, const Vec3d& from, double* __restrict sine,
                       double* __restrict cosine, double* __restrict sizes) {
    const double x = from.x(), y = from.y(), z = from.z();
    const double cx = apex.x() - x, cy = apex.y() - y, cz = apex.z() - z, lc = std::sqrt(cx * cx + cy * cy + cz * cz);
    for (size_t k = 0; k < n; ++k) {
        const double ax = p.x[k] - x, ay = p.y[k] - y, az = p.z[k] - z;
        const double bx = q.x[k] - x, by = q.y[k] - y, bz = q.z[k] - z;
        const double la = std::sqrt(ax * ax + ay * ay + az * az), lb = std::sqrt(bx * bx + by * by + bz * bz), size = la * lb * lc;
        sizes[k] = size;
        sine[k] = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
        cosine[k] = size + (ax * bx + ay * by + az * bz) * lc + (bx * cx + by * cy + bz * cz) * la + (cx * ax + cy * ay + cz * az) * lb;
    }
}

}  // namespace strata
