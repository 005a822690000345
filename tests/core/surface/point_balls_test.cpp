#include "core/surface/point_balls.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/error.h"
#include "core/math/random.h"
#include "core/surface/contour.h"
#include "core/surface/surface_report.h"
#include "tests/support/memory_source.h"
#include "tests/support/surface_in_memory.h"

namespace strata {
namespace {

SurfaceReport report_of(const MemorySource& points, const PointBallsSettings& settings, SurfaceInMemory* surface = nullptr) {
    PointBalls field(points, points.info().bounds, settings);
    EXPECT_EQ(field.outside(), 0u);
    SurfaceInMemory own;
    ContourSettings contour;
    contour.inside = ContourInside::below;
    contour.threads = settings.threads;
    SurfaceInMemory& out = surface != nullptr ? *surface : own;
    contour_bricks(field, contour, out);
    return measure_surface(out.mesh());
}

// Random points of a cube, in millimeters.
std::vector<Vec3i> random_points(size_t count, int extent, uint64_t seed) {
    Random random(seed);
    std::vector<Vec3i> points(count);
    for (Vec3i& p : points) p = Vec3i(int(random.uniform(0, extent)), int(random.uniform(0, extent)), int(random.uniform(0, extent)));
    return points;
}

TEST(PointBalls, ValuesAreDistances) {
    const MemorySource points(random_points(300, 4000, 1));  // 4 m
    const PointBallsSettings settings = {.spacing = 0.1, .radius = 0.25, .threads = 2};
    PointBalls field(points, points.info().bounds, settings);
    const Vec3d origin = field.placement().origin;
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(std::remainder(origin[axis], 0.1), 0.0, 1e-9);
    FieldBrickLayer layer;
    size_t samples = 0, within = 0;
    int32_t last_k = -1;
    std::map<std::array<int32_t, 3>, size_t> bricks;
    while (field.next_layer(layer)) {
        EXPECT_GT(layer.k, last_k);
        last_k = layer.k;
        EXPECT_TRUE(std::is_sorted(layer.corners.begin(), layer.corners.end(),
                                   [](const auto& a, const auto& b) { return a[1] < b[1] || (a[1] == b[1] && a[0] < b[0]); }));
        for (size_t b = 0; b < layer.corners.size(); ++b) {
            bricks[{layer.corners[b][0], layer.corners[b][1], layer.k}] = b;
            for (int n = 0; n < kFieldBrickSamples; n += 7) {
                const Vec3d p = field.placement().world_from_index(
                    {layer.corners[b][0] + double(n & 7), layer.corners[b][1] + double(n >> 3 & 7), layer.k + double(n >> 6)});
                double nearest = 1e9;
                for (const Vec3i& q : points.positions())
                    nearest = std::min(nearest, (points.info().quantization.world_from_quanta(q) - p).norm());
                ASSERT_NEAR(layer.values[b * kFieldBrickSamples + size_t(n)], std::clamp(nearest - 0.25, -0.2, 0.2), 0.1 * 0.002);
                ++samples;
                within += std::abs(nearest - 0.25) < 0.2;
            }
        }
    }
    EXPECT_GT(within, samples / 20);
    // No sample of the band is missing.
    Random random(2);
    for (int round = 0; round < 2000; ++round) {
        const Vec3i& q = points.positions()[size_t(random.bits() % 300)];
        const Vec3d away = 0.35 * Vec3d(random.normal(), random.normal(), random.normal()).normalized();
        const Vec3d index = (points.info().quantization.world_from_quanta(q) + away - origin) / 0.1;
        const std::array<int32_t, 3> corner = {int32_t(std::lround(index.x())) & ~7, int32_t(std::lround(index.y())) & ~7,
                                               int32_t(std::lround(index.z())) & ~7};
        EXPECT_TRUE(bricks.contains(corner));
    }
}

// A ball: closed, a sphere, with vertices within h^2 / 8 R of it, and the volume of the polyhedron between.
TEST(PointBalls, OnePointIsASphere) {
    const MemorySource points({Vec3i(1234, -777, 50)});
    for (const double steps : {1.5, 3.0, 6.0}) {
        SurfaceInMemory surface;
        const SurfaceReport report = report_of(points, {.spacing = 0.5 / steps, .radius = 0.5, .threads = 2}, &surface);
        EXPECT_TRUE(report.is_manifold());
        EXPECT_EQ(report.components, 1u);
        EXPECT_EQ(report.euler_characteristic, 2);
        const double h = 0.5 / steps, volume = 4.0 / 3.0 * std::numbers::pi * 0.125;
        EXPECT_LT(report.volume, volume * 1.01);
        EXPECT_GT(report.volume, volume * (1.0 - 1.5 * h * h / 0.25));
        const Vec3d center = points.info().quantization.world_from_quanta(points.positions()[0]);
        for (const Vec3d& p : surface.positions)
            EXPECT_NEAR((p - center).norm(), 0.5, h * h / 4.0 + h / 512.0) << (p - center).transpose() / h << " steps " << steps;
    }
}

// A sheet of points becomes one closed plate without holes, whose thickness is that of balls: twice the radius at the points.
TEST(PointBalls, ASheetIsAClosedPlate) {
    std::vector<Vec3i> sheet;
    for (int x = 0; x < 60; ++x)
        for (int y = 0; y < 50; ++y) sheet.push_back(Vec3i(100 * x, 100 * y, 20 * (x % 2)));
    const MemorySource points(sheet);
    const SurfaceReport report = report_of(points, {.spacing = 0.05, .radius = 0.12, .threads = 2});
    EXPECT_TRUE(report.is_manifold());
    EXPECT_EQ(report.components, 1u);
    EXPECT_EQ(report.euler_characteristic, 2);
    EXPECT_GT(report.volume, 6.0 * 5.0 * 0.14);
    EXPECT_LT(report.volume, 6.2 * 5.2 * 0.28);
}

// Threads and memory do not show, nor does the order of points.
TEST(PointBalls, TheSameWhateverTheThreads) {
    std::vector<Vec3i> positions = random_points(20'000, 9000, 7);
    SurfaceInMemory first;
    report_of(MemorySource(positions), {.spacing = 0.2, .radius = 0.3, .threads = 1}, &first);
    std::reverse(positions.begin(), positions.end());
    for (const int threads : {2, 5}) {
        SurfaceInMemory other;
        const SurfaceReport report = report_of(MemorySource(positions), {.spacing = 0.2, .radius = 0.3, .threads = threads}, &other);
        EXPECT_TRUE(report.is_manifold());
        EXPECT_EQ(first.positions, other.positions);
        EXPECT_EQ(first.triangles, other.triangles);
    }
}

// Where bounds lie by a little, balls reach beyond them: they are whole, or their points are counted.
TEST(PointBalls, BoundsThatLieByALittle) {
    const MemorySource points(random_points(2000, 9000, 11));
    PointBallsSettings settings = {.spacing = 0.1, .radius = 0.25, .threads = 2};
    const SurfaceReport right = report_of(points, settings);
    ASSERT_TRUE(right.is_manifold());
    int whole = 0;
    for (int axis = 0; axis < 3; ++axis)
        for (const bool upper : {false, true})
            for (const double bricks : {0.5, 0.8, 1.1, 1.4, 1.7, 2.0}) {
                Box3d bounds = points.info().bounds;
                (upper ? bounds.max : bounds.min)[axis] += (upper ? -bricks : bricks) * kFieldBrickSide * settings.spacing;
                for (const bool ask : {false, true}) {
                    settings.bounds_of_all = {};
                    if (ask) settings.bounds_of_all = [&](uint64_t) { return points.info().bounds; };
                    PointBalls field(points, bounds, settings);
                    if (ask) EXPECT_EQ(field.outside(), 0u);
                    if (field.outside() > 0) continue;
                    ++whole;
                    SurfaceInMemory surface;
                    contour_bricks(field, {.inside = ContourInside::below, .threads = 2}, surface);
                    const SurfaceReport report = measure_surface(surface.mesh());
                    EXPECT_TRUE(report.is_manifold()) << axis << upper << bricks;
                    EXPECT_EQ(report.triangles, right.triangles);
                }
            }
    EXPECT_GE(whole, 36);
}

TEST(PointBalls, SaysWhatCannotBe) {
    const MemorySource points(random_points(1000, 9000, 3));
    for (const double radius : {0.05, 0.7, -1.0, std::nan("")})
        EXPECT_THROW(PointBalls(points, points.info().bounds, {.spacing = 0.1, .radius = radius}), Error) << radius;
    EXPECT_THROW(PointBalls(points, points.info().bounds, {.spacing = 1e-6, .radius = 2e-6}), Error);
    Box3d half = points.info().bounds;
    half.max.z() = half.center().z();
    PointBalls some(points, half, {.spacing = 0.1, .radius = 0.2});
    EXPECT_GT(some.outside(), 200u);
    PointBalls little(points, points.info().bounds, {.spacing = 0.1, .radius = 0.2, .memory_bytes = 1000});
    FieldBrickLayer layer;
    EXPECT_THROW(little.next_layer(layer), Error);
}

}  // namespace
}  // namespace strata
