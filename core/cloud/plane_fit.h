#pragma once

#include <cstddef>
#include <span>

#include "core/math/vec.h"

namespace strata {

inline constexpr size_t kMostFitPoints = 1024;

/// The direction in which points spread least, as a unit vector of either sign; zero where there is no such direction:
/// a single point, points that coincide, points on a line (to within half a quantum, which is what rounding does to one).
/// Sums are exact, so neither the order of the points nor their distance from the origin shows.
/// points  at most kMostFitPoints
/// scale   world units per quantum, positive
Vec3d fit_normal(std::span<const Vec3i> points, const Vec3d& scale);

/// Eigenvalues of a symmetric matrix, ascending, and their unit vectors as columns.
struct SymmetricEigen {
    Vec3d values;
    Mat3d vectors;
};
/// By Jacobi's rotations: to rounding, whatever the matrix. Reads the upper triangle; entries are finite.
SymmetricEigen symmetric_eigen(Mat3d matrix);

}  // namespace strata
