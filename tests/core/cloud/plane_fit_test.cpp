#include "core/cloud/plane_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/math/random.h"

namespace strata {
namespace {

Mat3d random_rotation(Random& random) {
    const Vec3d a = Vec3d(random.normal(), random.normal(), random.normal()).normalized();
    const Vec3d b = a.cross(Vec3d(random.normal(), random.normal(), random.normal())).normalized();
    Mat3d rotation;
    rotation << a, b, a.cross(b);
    return rotation;
}

TEST(SymmetricEigen, AgreesWithEigenAndRebuildsTheMatrix) {
    Random random(1);
    for (int i = 0; i < 2000; ++i) {
        const Mat3d r = random_rotation(random);
        // From well apart to nearly equal, over 24 orders of magnitude.
        const double large = std::pow(10.0, random.uniform(-12.0, 12.0));
        const Vec3d values(large * std::pow(10.0, random.uniform(-14.0, 0.0)), large * (i % 3 ? random.uniform() : 1.0), large);
        const Mat3d matrix = r * values.asDiagonal() * r.transpose();
        const SymmetricEigen ours = symmetric_eigen(matrix);
        const Eigen::SelfAdjointEigenSolver<Mat3d> theirs(matrix);
        EXPECT_LT((ours.values - theirs.eigenvalues()).norm(), 1e-14 * large);
        EXPECT_LT((ours.vectors * ours.values.asDiagonal() * ours.vectors.transpose() - matrix).norm(), 3e-15 * large);
        EXPECT_LT((ours.vectors.transpose() * ours.vectors - Mat3d::Identity()).norm(), 3e-15);
        EXPECT_LE(ours.values[0], ours.values[1]);
        EXPECT_LE(ours.values[1], ours.values[2]);
    }
}

TEST(SymmetricEigen, ZeroAndDiagonalMatrices) {
    EXPECT_EQ(symmetric_eigen(Mat3d::Zero()).values, Vec3d(0, 0, 0));
    EXPECT_EQ(symmetric_eigen(Vec3d(5, -1, 3).asDiagonal()).values, Vec3d(-1, 3, 5));
    EXPECT_EQ(symmetric_eigen(Mat3d::Constant(1e-320)).values.array().isNaN().any(), false);
}

TEST(FitNormal, ThreePointsAndAGrid) {
    const Vec3d normal = fit_normal(std::vector<Vec3i>{{0, 0, 0}, {100, 0, 100}, {0, 100, 0}}, Vec3d::Ones());
    EXPECT_NEAR(std::abs(normal.dot(Vec3d(-1, 0, 1).normalized())), 1.0, 1e-15);
    std::vector<Vec3i> grid;
    for (int x = 0; x < 10; ++x)
        for (int y = 0; y < 10; ++y) grid.push_back({5 * x, 7 * y, 10 * x - 14 * y});  // z = 2x - 2y
    const Vec3d fitted = fit_normal(grid, Vec3d::Constant(0.01));
    EXPECT_NEAR(std::abs(fitted.dot(Vec3d(-2, 2, 1) / 3.0)), 1.0, 1e-15);
}

TEST(FitNormal, ScalesDifferByAxis) {
    std::vector<Vec3i> points;
    for (int x = 0; x < 5; ++x)
        for (int y = 0; y < 5; ++y) points.push_back({10 * x, 10 * y, 1000 * x});  // world: z = x
    EXPECT_NEAR(std::abs(fit_normal(points, {0.1, 0.1, 0.001}).dot(Vec3d(-1, 0, 1).normalized())), 1.0, 1e-12);
}

TEST(FitNormal, NoPlaneNoNormal) {
    const auto fitted = [](const std::vector<Vec3i>& points) { return fit_normal(points, Vec3d::Constant(0.001)); };
    const Vec3d none = Vec3d::Zero();
    EXPECT_EQ(fitted({}), none);
    EXPECT_EQ(fitted({{1, 2, 3}}), none);
    EXPECT_EQ(fitted({{1, 2, 3}, {400, 500, 600}}), none);
    EXPECT_EQ(fitted(std::vector<Vec3i>(16, Vec3i(9, 9, 9))), none);
    std::vector<Vec3i> line, rounded, wide;
    for (int i = 0; i < 16; ++i) {
        line.push_back(Vec3i(3, -2, 5) * i * 1000);
        rounded.push_back(Vec3i(int(std::lround(i * 314.159)), int(std::lround(i * 271.828)), int(std::lround(i * 57.29577))));
        wide.push_back(Vec3i(250'000'000, -250'000'000, 125'000'000) * (i - 8));
    }
    EXPECT_EQ(fitted(line), none);
    EXPECT_EQ(fitted(rounded), none);
    EXPECT_EQ(fitted(wide), none);
    line[7].z() += 4000;  // a plane, if only just
    EXPECT_NEAR(std::abs(fitted(line).dot(Vec3d(3, -2, 5).cross(Vec3d::UnitZ()).normalized())), 1.0, 1e-12);
}

// The same shape at any place gives the same bits, in any order.
TEST(FitNormal, PlaceAndOrderDoNotShow) {
    Random random(2);
    std::vector<Vec3i> points(16);
    for (Vec3i& p : points) p = Vec3i(int(random.uniform(0, 3000)), int(random.uniform(0, 3000)), int(random.uniform(0, 90)));
    const Vec3d scale(0.001, 0.001, 0.0007);
    const Vec3d expected = fit_normal(points, scale);
    for (const Vec3i& shift : {Vec3i(2'147'480'000, -2'147'480'000, 5), Vec3i(-17, 12'345, INT32_MAX - 100)}) {
        std::vector<Vec3i> moved = points;
        for (Vec3i& p : moved) p += shift;
        EXPECT_EQ(fit_normal(moved, scale), expected);
        std::sort(moved.begin(), moved.end(), [](const Vec3i& a, const Vec3i& b) { return a.z() < b.z(); });
        EXPECT_EQ(fit_normal(moved, scale), expected);
    }
}

TEST(FitNormal, PointsAcrossTheWholeRange) {
    Random random(3);
    const Vec3d normal = Vec3d(1, 2, 3).normalized(), u = normal.unitOrthogonal(), v = normal.cross(u);
    std::vector<Vec3i> points(kMostFitPoints);
    for (Vec3i& p : points)
        p = (u * random.uniform(-2e9, 2e9) + v * random.uniform(-2e9, 2e9)).cwiseMin(2.1e9).cwiseMax(-2.1e9).cast<int32_t>();
    std::erase_if(points, [&](const Vec3i& p) { return std::abs(p.cast<double>().dot(normal)) > 3.0; });  // clamped
    ASSERT_GT(points.size(), 100u);
    // Coarsened to 2^6 of 2^32.
    EXPECT_NEAR(std::abs(fit_normal(points, Vec3d::Ones()).dot(normal)), 1.0, 1e-14);
    std::vector<Vec3i> reversed(points.rbegin(), points.rend());
    EXPECT_EQ(fit_normal(reversed, Vec3d::Ones()), fit_normal(points, Vec3d::Ones()));
}

// k points within radius r of a plane with noise sigma: each of the two slopes has the variance sigma^2 over the sum of
// squares of the coordinate across, k r^2 / 4 in a disc, so the standard error of an angle is 2 sigma / (r sqrt(k)).
TEST(FitNormal, ErrorOfANoisyPlane) {
    Random random(4);
    constexpr int kTrials = 4000;
    constexpr double kRadius = 1e6;  // quanta, so that rounding is no part of it
    for (const int k : {12, 16, 32, 100})
        for (const double sigma : {0.002, 0.01, 0.03}) {
            double sum_squares = 0.0;
            const Mat3d rotation = random_rotation(random);
            for (int trial = 0; trial < kTrials; ++trial) {
                std::vector<Vec3i> points(static_cast<size_t>(k));
                for (Vec3i& p : points) {
                    const double r = kRadius * std::sqrt(random.uniform()), angle = random.uniform(0.0, 2.0 * M_PI);
                    p = (rotation * Vec3d(r * std::cos(angle), r * std::sin(angle), sigma * kRadius * random.normal())).cast<int32_t>();
                }
                const Vec3d normal = rotation.transpose() * fit_normal(points, Vec3d::Constant(1e-6));
                sum_squares += normal.head<2>().squaredNorm() / 2.0;
            }
            const double error = std::sqrt(sum_squares / kTrials), expected = 2.0 * sigma / std::sqrt(k);
            // Regression adds (k - 1) / (k - 4) to the variance for few points; 4000 * 2 angles measure it to 1 %.
            EXPECT_NEAR(error / expected, std::sqrt((k - 1.0) / (k - 4.0)), 0.06) << "k " << k << ", sigma " << sigma;
        }
}

}  // namespace
}  // namespace strata
