#pragma once

#include <cstddef>

#include "core/math/vec.h"

namespace strata {

struct PointColumn {
    const double *x, *y, *z;
};

/// Half the solid angles of triangles (p, q, apex), as seen from a point: sine and cosine times sizes, which are |p| |q| |apex| from there.
/// Positive where the triangle turns counterclockwise seen from the other side.
/// p, q, sine, cosine, sizes  [n]
/// source  A. van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", IEEE Trans. Biomed. Eng. 30, 1983
void half_solid_angles(size_t n, PointColumn p, PointColumn q, const Vec3d& apex, const Vec3d& from, double* sine, double* cosine,
                       double* sizes);

}  // namespace strata
