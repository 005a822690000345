#include "core/cloud/plane_fit.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <utility>

namespace strata {
namespace {

__extension__ using int128 = __int128;

// Sums of kMostFitPoints products of two differences fit in 63 bits.
constexpr int kDifferenceBits = 26;

// The eigenvector of the least eigenvalue, where that is well below the next and the next well above `noise`; else zero.
// The adjugate has the same vectors, and the least eigenvalue has become the greatest; squaring drives the others down.
Vec3d isolated_least_vector(const Mat3d& a, double noise) {
    const double trace = a(0, 0) + a(1, 1) + a(2, 2);
    double xx = a(1, 1) * a(2, 2) - a(1, 2) * a(1, 2), yy = a(0, 0) * a(2, 2) - a(0, 2) * a(0, 2),
           zz = a(0, 0) * a(1, 1) - a(0, 1) * a(0, 1), xy = a(0, 2) * a(1, 2) - a(0, 1) * a(2, 2),
           xz = a(0, 1) * a(1, 2) - a(0, 2) * a(1, 1), yz = a(0, 1) * a(0, 2) - a(0, 0) * a(1, 2);
    const double minors = xx + yy + zz;
    // The middle eigenvalue is at least a third of minors / trace; the adjugate's rounding is 2^-52 trace^2.
    if (!(minors > 4.0 * noise * trace && minors > 1e-6 * trace * trace)) return Vec3d::Zero();
    double norm = minors;  // the trace before, the sum of squares after a squaring
    constexpr int kMostSquarings = 8;
    for (int step = 0;; ++step) {
        const double factor = 1.0 / norm;
        xx *= factor, yy *= factor, zz *= factor, xy *= factor, xz *= factor, yz *= factor;
        norm = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz);
        if (norm > 1.0 - 0x1p-50) break;  // one eigenvalue is left
        if (step == kMostSquarings) return Vec3d::Zero();
        const double xx2 = xx * xx + xy * xy + xz * xz, yy2 = xy * xy + yy * yy + yz * yz, zz2 = xz * xz + yz * yz + zz * zz,
                     xy2 = xx * xy + xy * yy + xz * yz, xz2 = xx * xz + xy * yz + xz * zz, yz2 = xy * xz + yy * yz + yz * zz;
        xx = xx2, yy = yy2, zz = zz2, xy = xy2, xz = xz2, yz = yz2;
    }
    if (xx >= yy && xx >= zz) return Vec3d(xx, xy, xz).normalized();
    return yy >= zz ? Vec3d(xy, yy, yz).normalized() : Vec3d(xz, yz, zz).normalized();
}

}  // namespace

SymmetricEigen symmetric_eigen(Mat3d a) {
    constexpr int kMostSweeps = 12;  // five are enough; convergence is quadratic
    Mat3d vectors = Mat3d::Identity();
    for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
        const double off = std::abs(a(0, 1)) + std::abs(a(0, 2)) + std::abs(a(1, 2));
        const double diagonal = std::abs(a(0, 0)) + std::abs(a(1, 1)) + std::abs(a(2, 2));
        if (off <= 0x1p-60 * diagonal) break;
        for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
            if (a(p, q) == 0.0) continue;
            const double theta = (a(q, q) - a(p, p)) / (2.0 * a(p, q));
            const double t = std::copysign(1.0, theta) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
            const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
            const int r = 3 - p - q;
            const double apq = a(p, q), arp = a(std::min(r, p), std::max(r, p)), arq = a(std::min(r, q), std::max(r, q));
            a(p, p) -= t * apq;
            a(q, q) += t * apq;
            a(p, q) = 0.0;
            a(std::min(r, p), std::max(r, p)) = c * arp - s * arq;
            a(std::min(r, q), std::max(r, q)) = s * arp + c * arq;
            const Vec3d vp = vectors.col(p), vq = vectors.col(q);
            vectors.col(p) = c * vp - s * vq;
            vectors.col(q) = s * vp + c * vq;
        }
    }
    int order[3] = {0, 1, 2};
    const auto ascend = [&](int i, int j) {
        if (a(order[j], order[j]) < a(order[i], order[i])) std::swap(order[i], order[j]);
    };
    ascend(0, 1);
    ascend(1, 2);
    ascend(0, 1);
    SymmetricEigen result;
    for (int i = 0; i < 3; ++i) {
        result.values[i] = a(order[i], order[i]);
        result.vectors.col(i) = vectors.col(order[i]);
    }
    return result;
}

Vec3d fit_normal(std::span<const Vec3i> points, const Vec3d& scale) {
    assert(points.size() <= kMostFitPoints);
    if (points.size() < 3) return Vec3d::Zero();
    Vec3i low = points[0], high = points[0];
    for (const Vec3i& point : points) {
        low = low.cwiseMin(point);
        high = high.cwiseMax(point);
    }
    // Differences that are too wide for the sums are coarsened by a power of two.
    const int64_t extent = (high.cast<int64_t>() - low.cast<int64_t>()).maxCoeff();
    const int coarsening = std::max(int(std::bit_width(uint64_t(extent))) - kDifferenceBits, 0);
    int64_t sx = 0, sy = 0, sz = 0, xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
    for (const Vec3i& point : points) {
        const int64_t x = (int64_t{point.x()} - low.x()) >> coarsening, y = (int64_t{point.y()} - low.y()) >> coarsening,
                      z = (int64_t{point.z()} - low.z()) >> coarsening;
        sx += x, sy += y, sz += z;
        xx += x * x, xy += x * y, xz += x * z;
        yy += y * y, yz += y * z, zz += z * z;
    }
    const int64_t n = int64_t(points.size());
    const Vec3d unit = scale * std::ldexp(1.0, coarsening);
    const auto covariance = [&](int64_t products, int64_t sum_a, int64_t sum_b) {
        return double(int128(products) * n - int128(sum_a) * sum_b) / (double(n) * double(n));
    };
    Mat3d matrix = Mat3d::Zero();
    matrix(0, 0) = covariance(xx, sx, sx) * unit.x() * unit.x();
    matrix(0, 1) = covariance(xy, sx, sy) * unit.x() * unit.y();
    matrix(0, 2) = covariance(xz, sx, sz) * unit.x() * unit.z();
    matrix(1, 1) = covariance(yy, sy, sy) * unit.y() * unit.y();
    matrix(1, 2) = covariance(yz, sy, sz) * unit.y() * unit.z();
    matrix(2, 2) = covariance(zz, sz, sz) * unit.z() * unit.z();
    const double rounding = 0.5 * unit.maxCoeff();
    if (const Vec3d normal = isolated_least_vector(matrix, rounding * rounding); normal != Vec3d::Zero()) return normal;
    const SymmetricEigen eigen = symmetric_eigen(matrix);
    const double noise = std::max(rounding * rounding, 1e-13 * eigen.values[2]);
    if (!(eigen.values[1] > noise)) return Vec3d::Zero();
    return eigen.vectors.col(0);
}

}  // namespace strata
