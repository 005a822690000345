#include "core/surface/near_points.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <set>

#include "core/math/random.h"
#include "core/surface/layer_normals.h"
#include "core/surface/plane_mean.h"
#include "tests/support/scanned_points.h"

namespace strata {
namespace {

constexpr double kStep = 0.1;

/// Three layers of points, with normals.
struct Layers {
    explicit Layers(const std::vector<ScannedPoint>& all) : points(all) {
        PointForm form;
        form.normals = true;
        ScratchBlocks scratch(nullptr);
        PointLayers layers(PointGrid::around(points.info().bounds, kStep, 7.0), form, 1 << 24, scratch);
        layers.distribute(points, 1, {});
        origin = layers.grid().placement.origin;
        size_t most = 0;
        for (size_t layer = 1; layer + 1 < layers.size(); ++layer)
            if (layers.points(layer) > layers.points(most)) most = layer;
        middle = most;
        for (size_t l = 0; l < 3; ++l) held[l] = layers.take(middle + l - 1, false, 1 << 24);
    }
    std::array<const PointLayer*, 3> pointers() const { return {&held[0], &held[1], &held[2]}; }
    Vec3d corner(const std::array<int32_t, 2>& at) const { return {double(at[0]), double(at[1]), double(middle) * kFieldBrickSide}; }
    /// Steps from the grid's least sample.
    std::vector<Vec3d> places() const {
        std::vector<Vec3d> all;
        for (const ScannedPoint& p : points.points()) all.push_back((p.place - origin) / kStep);
        return all;
    }

    ScannedPoints points;
    Vec3d origin;
    size_t middle = 0;
    std::array<PointLayer, 3> held;
};

// A wavy sheet through several layers.
std::vector<ScannedPoint> sheet(double noise) {
    std::vector<ScannedPoint> points;
    Random random(6);
    for (double x = 0.0; x < 3.0; x += 0.07)
        for (double y = 0.0; y < 3.0; y += 0.07) {
            const Vec3d n = Vec3d(-0.6 * std::cos(2.0 * x), 0.0, 1.0).normalized();
            points.push_back({.place = {x + 0.1 * noise * random.normal(), y + 0.1 * noise * random.normal(), 0.3 * std::sin(2.0 * x) + noise * random.normal()}, .normal = n.cast<float>()});
        }
    return points;
}

TEST(NearPoints, AreThoseNearTheBrick) {
    const Layers layers(sheet(0.02));
    const std::vector<Vec3d> places = layers.places();
    const std::vector<std::array<int32_t, 2>> corners = corners_around(layers.pointers());
    NearPoints near;
    size_t some = 0;
    for (const float reach : {2.0f, 7.0f})
        for (const auto& at : corners) {
            near.gather(layers.pointers(), at, reach, false);
            std::multiset<std::array<int64_t, 3>> expected, found;
            const auto rounded = [](const Vec3d& p) { return std::array<int64_t, 3>{std::llround(p.x() * 1e4), std::llround(p.y() * 1e4), std::llround(p.z() * 1e4)}; };
            for (const Vec3d& place : places) {
                const Vec3d from = place - layers.corner(at);
                if (from.minCoeff() > -reach && from.maxCoeff() < double(kFieldBrickSide) + reach) expected.insert(rounded(from));
            }
            for (size_t p = 0; p < near.size(); ++p) found.insert(rounded({near.x[p], near.y[p], near.z[p]}));
            // Points on the rim may be rounded to either side.
            EXPECT_NEAR(double(expected.size()), double(found.size()), 1.0);
            some += found.size();
        }
    EXPECT_GT(some, 10'000u);
}

// Of points on a plane, the plane's normal: whatever the sign.
TEST(LayerNormals, OfAPlane) {
    const Vec3d n = Vec3d(0.2, -0.3, 0.9).normalized(), u = n.unitOrthogonal(), v = n.cross(u);
    std::vector<ScannedPoint> points;
    for (int a = -10; a < 10; ++a)
        for (int b = -10; b < 10; ++b) points.push_back({.place = 0.07 * (a * u + b * v)});
    const Layers layers(points);
    const std::vector<Vec3f> normals = layer_normals(layers.pointers(), 3.0f, 2);
    ASSERT_GT(normals.size(), 100u);
    for (const Vec3f& normal : normals) EXPECT_GT(std::abs(normal.dot(n.cast<float>())), 1.0f - 1e-5f);
}

TEST(LayerNormals, FewPointsHaveNone) {
    for (const size_t count : {3u, 4u}) {
        std::vector<ScannedPoint> points = {{.place = {0, 0, 0}}, {.place = {0.1, 0, 0}}, {.place = {0, 0.1, 0}}, {.place = {0.1, 0.1, 0}}};
        points.resize(count);
        for (const Vec3f& normal : layer_normals(Layers(points).pointers(), 3.0f, 1)) EXPECT_EQ(normal.isZero(0.0f), count < size_t{kLeastPoints});
    }
}

TEST(LayerNormals, TheSameByAllInstructions) {
    if (best_simd_level() == SimdLevel::baseline) GTEST_SKIP() << "this processor has the baseline only";
    const Layers layers(sheet(0.02));
    for (const float radius : {2.0f, 3.3f, 7.0f}) {
        const std::vector<Vec3f> a = layer_normals(layers.pointers(), radius, 2, SimdLevel::baseline), b = layer_normals(layers.pointers(), radius, 2, best_simd_level());
        ASSERT_EQ(a.size(), b.size());
        ASSERT_GT(a.size(), 500u);
        EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]), 0) << radius;
    }
}

// At a sample, the distance to the plane that all points lie on; away from it, and where points are too few, none.
TEST(PlaneMean, IsTheDistanceToAPlane) {
    const Vec3f n = Vec3f(0.2f, -0.3f, 0.9f).normalized(), center(3.6f, 3.7f, 3.4f);
    const Vec3f u = n.unitOrthogonal(), v = n.cross(u);
    NearPoints near;
    const auto add = [&](const Vec3f& place) {
        near.x.push_back(place.x()), near.y.push_back(place.y()), near.z.push_back(place.z());
        near.normals.push_back(n);
    };
    for (int a = -16; a <= 16; ++a)
        for (int b = -16; b <= 16; ++b) add(center + 0.7f * (float(a) * u + float(b) * v));
    std::array<float, kFieldBrickSamples> values;
    PlaneMean mean(3.0f);
    EXPECT_TRUE(mean.evaluate(near, values));
    size_t known = 0;
    for (int s = 0; s < kFieldBrickSamples; ++s) {
        const float distance = (Vec3f(float(s & 7), float(s >> 3 & 7), float(s >> 6)) - center).dot(n);
        if (std::abs(distance) < 1.99f) EXPECT_NEAR(values[size_t(s)], distance, 1e-5f);
        if (std::abs(distance) > 2.01f) EXPECT_TRUE(std::isnan(values[size_t(s)]));
        known += !std::isnan(values[size_t(s)]);
    }
    EXPECT_GT(known, 100u);
    for (const size_t count : {3u, 4u}) {
        near = {};
        for (size_t p = 0; p < count; ++p) add(center + 0.5f * (float(p & 1) * u + float(p >> 1) * v));
        EXPECT_EQ(mean.evaluate(near, values), count >= size_t{kLeastPoints});
    }
}

TEST(PlaneMean, TheSameByAllInstructions) {
    if (best_simd_level() == SimdLevel::baseline) GTEST_SKIP() << "this processor has the baseline only";
    const Layers layers(sheet(0.02));
    NearPoints near;
    size_t known = 0;
    for (const float radius : {2.0f, 3.3f, 7.0f}) {
        PlaneMean baseline(radius, SimdLevel::baseline), best(radius, best_simd_level());
        for (const auto& corner : corners_around(layers.pointers())) {
            near.gather(layers.pointers(), corner, radius, true);
            std::array<float, kFieldBrickSamples> a, b;
            EXPECT_EQ(baseline.evaluate(near, a), best.evaluate(near, b));
            EXPECT_EQ(std::memcmp(a.data(), b.data(), sizeof a), 0) << radius;
            for (const float value : a) known += !std::isnan(value);
        }
    }
    EXPECT_GT(known, 1000u);
}

}  // namespace
}  // namespace strata
