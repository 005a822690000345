#include "core/surface/point_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>

#include "core/error.h"
#include "core/math/random.h"
#include "core/surface/contour.h"
#include "core/surface/surface_report.h"
#include "tests/support/scanned_points.h"
#include "tests/support/store_in_memory.h"
#include "tests/support/surface_in_memory.h"

namespace strata {
namespace {

using std::numbers::pi;

struct Made {
    SurfaceInMemory surface;
    SurfaceReport report;
    PointSurfaceReport points;
};

Made surface_of(const PointSource& points, PointSurfaceSettings settings) {
    if (settings.threads == 1) settings.threads = 2;
    PointSurface field(points, points.info().bounds, settings);
    Made made;
    ContourSettings contour;
    contour.inside = ContourInside::below;
    contour.open_at_nan = true;
    contour.threads = settings.threads;
    contour_bricks(field, contour, made.surface);
    made.report = measure_surface(made.surface.mesh());
    made.points = field.report();
    EXPECT_EQ(made.report.unused_vertices, 0u);
    return made;
}

// Removes what the points know of normals.
std::vector<ScannedPoint> without_normals(std::vector<ScannedPoint> points) {
    for (ScannedPoint& p : points) p.normal.setZero();
    return points;
}

// A square grid in the plane through `center` across n, whose normals are n.
std::vector<ScannedPoint> plane_points(const Vec3d& center, const Vec3d& n, double half, double apart) {
    const Vec3d u = n.unitOrthogonal(), v = n.cross(u);
    std::vector<ScannedPoint> points;
    for (double a = -half; a <= half; a += apart)
        for (double b = -half; b <= half; b += apart) points.push_back({.place = center + a * u + b * v, .normal = n.cast<float>()});
    return points;
}

// Loops of edges with one face.
size_t boundary_loops(const SurfaceInMemory& surface) {
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    for (const auto& t : surface.triangles)
        for (size_t i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
    std::map<uint32_t, uint32_t> next;
    for (const auto& [edge, count] : edges)
        if (!edges.contains({edge.second, edge.first})) next[edge.first] = edge.second;
    size_t loops = 0;
    while (!next.empty()) {
        ++loops;
        for (auto at = next.begin(); at != next.end();) {
            const uint32_t to = at->second;
            next.erase(at);
            at = next.find(to);
        }
    }
    return loops;
}

// All points lie on one plane: so does each mean of distances to it.
TEST(PointSurface, APlaneIsAPlane) {
    const Vec3d center(0.3117, -0.1739, 0.2291), n = Vec3d(0.3137, -0.5213, -0.7919).normalized();
    const double apart = 0.02, radius = 0.06, half = 1.0;
    const Made made = surface_of(ScannedPoints(plane_points(center, n, half, apart)), {.spacing = 0.02, .radius = radius});
    ASSERT_GT(made.report.triangles, 10'000u);
    size_t exact = 0;
    for (const Vec3d& p : made.surface.positions) {
        EXPECT_LT(std::abs((p - center).dot(n)), 0.02 / 1024.0);  // vertices keep away from samples by that
        exact += std::abs((p - center).dot(n)) < 2.5e-7;  // as floats of about 2
        // What is beyond the edge is less than half the radius and a cell.
        EXPECT_LT(std::abs((p - center).dot(n.unitOrthogonal())), half + 0.6 * radius);
    }
    EXPECT_GT(exact, made.surface.positions.size() * 99 / 100);
    EXPECT_EQ(made.report.components, 1u);
    EXPECT_EQ(made.report.euler_characteristic, 1);  // a disk
    EXPECT_EQ(boundary_loops(made.surface), 1u);
    EXPECT_NEAR(made.report.area, 4.0 * half * half, 8.0 * half * 0.6 * radius);
    EXPECT_FALSE(made.points.oriented);
    // Triangles face along the normals.
    for (const auto& t : made.surface.triangles) {
        const Vec3d& a = made.surface.positions[t[0]];
        EXPECT_GT((made.surface.positions[t[1]] - a).cross(made.surface.positions[t[2]] - a).dot(n), 0.0);
    }
}

// Of points on a sphere of radius R the mean of planes alone is off by the mean square of the distance, over 2 R: h^2 / 12 R, as weights are
// (1 - r^2 / h^2)^4. With the normal of the place it would be exact on the sphere; where coherence is less, and between samples, it is not: within a quarter.
TEST(PointSurface, ASphereIsCloseToOneAndClosed) {
    double last = 0.0;
    for (const int level : {0, 1, 2}) {
        const double h = 0.2 / (1 << level);
        const Made made = surface_of(ScannedPoints(sphere_points(size_t(4000) << (2 * level), 1.0)), {.spacing = h / 3.0, .radius = h});
        EXPECT_TRUE(made.report.is_manifold());
        EXPECT_EQ(made.report.components, 1u);
        EXPECT_EQ(made.report.euler_characteristic, 2);
        EXPECT_GT(made.report.volume, 0.0);
        double most = 0.0;
        for (const Vec3d& p : made.surface.positions) most = std::max(most, std::abs(p.norm() - 1.0));
        EXPECT_LT(most, h * h / 48.0);
        if (level > 0) EXPECT_LT(most, 0.3 * last) << "second order";
        last = most;
    }
}

// Normals that are fitted, and whose sides are chosen, do as well.
TEST(PointSurface, ASphereOfPointsAlone) {
    const double h = 0.1;
    const Made made = surface_of(ScannedPoints(without_normals(sphere_points(16'000, 1.0))), {.spacing = h / 3.0, .radius = h});
    EXPECT_TRUE(made.points.oriented);
    EXPECT_FALSE(made.points.has_normals);
    EXPECT_EQ(made.points.components, 1u);
    EXPECT_TRUE(made.report.is_manifold());
    EXPECT_EQ(made.report.components, 1u);
    EXPECT_EQ(made.report.euler_characteristic, 2);
    EXPECT_GT(made.report.volume, 0.0) << "the outside is outside";
    for (const Vec3d& p : made.surface.positions) EXPECT_NEAR(p.norm(), 1.0, h * h / 24.0);
}

// Normals that all look up are of no use around an object: they are those of someone who did not know its outside.
TEST(PointSurface, NormalsThatAllLookUpAreTurned) {
    std::vector<ScannedPoint> points = sphere_points(16'000, 1.0);
    for (ScannedPoint& p : points)
        if (p.normal.z() < 0.0f) p.normal = -p.normal;
    const Made made = surface_of(ScannedPoints(points), {.spacing = 0.1 / 3.0, .radius = 0.1});
    EXPECT_TRUE(made.points.has_normals);
    EXPECT_TRUE(made.points.oriented);
    EXPECT_TRUE(made.report.is_manifold());
    EXPECT_GT(made.report.volume, 4.0);
}

// Who stands within a sphere sees its inside.
TEST(PointSurface, NormalsLookAtTheViewpoint) {
    const Made made = surface_of(ScannedPoints(without_normals(sphere_points(16'000, 1.0))), {.spacing = 0.1 / 3.0, .radius = 0.1, .viewpoint = Vec3d(0.2, 0.1, 0.0)});
    EXPECT_FALSE(made.points.oriented);
    EXPECT_TRUE(made.report.is_manifold());
    EXPECT_LT(made.report.volume, -4.0);
}

// Half a sphere stays half a sphere: one edge, and nothing beyond it.
TEST(PointSurface, HalfASphereIsOpen) {
    for (const bool normals : {true, false}) {
        std::vector<ScannedPoint> points = sphere_points(20'000, 1.0);
        std::erase_if(points, [](const ScannedPoint& p) { return p.place.x() < 0.0; });
        const double h = 0.1;
        const Made made = surface_of(ScannedPoints(normals ? points : without_normals(points)), {.spacing = h / 3.0, .radius = h});
        EXPECT_EQ(made.report.components, 1u);
        EXPECT_EQ(made.report.euler_characteristic, 1);
        EXPECT_EQ(made.report.nonmanifold_edges, 0u);
        EXPECT_EQ(made.report.flipped_edges, 0u);
        EXPECT_EQ(boundary_loops(made.surface), 1u);
        double least = 1.0;
        for (const Vec3d& p : made.surface.positions) {
            EXPECT_NEAR(p.norm(), 1.0, h * h / 4.0);
            least = std::min(least, p.x());
        }
        EXPECT_GT(least, -0.6 * h);
        EXPECT_LT(least, 0.0);
    }
}

// Two sheets stay two, be they plates' sides (of opposite normals) near each other, or floors (of equal ones) as far apart as the radius.
TEST(PointSurface, SheetsStayApart) {
    const double h = 0.06;
    for (const auto& [gap, same, top] : {std::tuple(2.0 * h, true, 0.01), std::tuple(1.5 * h, true, 0.01), std::tuple(1.2 * h, true, 0.01), std::tuple(1.2 * h, true, 0.004), std::tuple(1.2 * h, true, 0.171),
                                         std::tuple(2.0 * h, false, 0.01), std::tuple(0.5 * h, false, 0.01)}) {
        std::vector<ScannedPoint> points = plane_points({0.0, 0.0, top}, Vec3d::UnitZ(), 0.5, 0.02);
        for (ScannedPoint p : plane_points({0.0, 0.0, top - gap}, same ? Vec3d(Vec3d::UnitZ()) : Vec3d(-Vec3d::UnitZ()), 0.5, 0.02)) points.push_back(p);
        const Made made = surface_of(ScannedPoints(points), {.spacing = 0.02, .radius = h});
        EXPECT_EQ(made.report.components, 2u) << gap << " " << same << " " << top;
        EXPECT_EQ(made.report.euler_characteristic, 2);
        for (const Vec3d& p : made.surface.positions) {
            if (p.head<2>().cwiseAbs().maxCoeff() > 0.45) continue;
            EXPECT_LT(std::min(std::abs(p.z() - top), std::abs(p.z() - top + gap)), 1e-3 * h) << gap << same << p.transpose();
        }
    }
}

// A hole narrower than the radius is closed, one that is several times as wide stays.
TEST(PointSurface, ClosesNarrowGaps) {
    const double h = 0.06;
    for (const auto& [hole, loops] : {std::pair(h, 1u), std::pair(4.0 * h, 2u)}) {
        std::vector<ScannedPoint> points = plane_points({0.0, 0.0, 0.01}, Vec3d::UnitZ(), 0.5, 0.015);
        std::erase_if(points, [&](const ScannedPoint& p) { return p.place.head<2>().norm() < hole / 2.0; });
        const Made made = surface_of(ScannedPoints(points), {.spacing = 0.02, .radius = h});
        EXPECT_EQ(made.report.components, 1u);
        EXPECT_EQ(boundary_loops(made.surface), loops) << hole;
    }
}

TEST(PointSurface, ATorusHasAHandle) {
    const double major = 1.0, minor = 0.4, h = 0.1;
    std::vector<ScannedPoint> points;
    Random random(5);
    while (points.size() < 30'000) {
        const double a = random.uniform(0, 2 * pi), b = random.uniform(0, 2 * pi);
        if (random.uniform() * (major + minor) > major + minor * std::cos(b)) continue;  // evenly over the area
        const Vec3d n(std::cos(b) * std::cos(a), std::cos(b) * std::sin(a), std::sin(b));
        points.push_back({.place = Vec3d(major * std::cos(a), major * std::sin(a), 0.0) + minor * n, .normal = n.cast<float>()});
    }
    for (const bool normals : {true, false}) {
        const Made made = surface_of(ScannedPoints(normals ? points : without_normals(points)), {.spacing = h / 3.0, .radius = h});
        EXPECT_TRUE(made.report.is_manifold());
        EXPECT_EQ(made.report.components, 1u);
        EXPECT_EQ(made.report.euler_characteristic, 0);
        EXPECT_NEAR(made.report.volume, 2.0 * pi * pi * major * minor * minor, 0.03);
    }
}

// The mean of n points has an n-th of their noise, squared: within the radius lie some 60 of them, 25 if weights count.
TEST(PointSurface, NoiseIsLess) {
    std::vector<ScannedPoint> points = sphere_points(40'000, 1.0);
    Random random(9);
    const double sigma = 0.01, h = 0.08;
    for (ScannedPoint& p : points) p.place *= 1.0 + sigma * random.normal();
    const Made made = surface_of(ScannedPoints(points), {.spacing = h / 3.0, .radius = h});
    double squares = 0.0;
    for (const Vec3d& p : made.surface.positions) squares += (p.norm() - 1.0) * (p.norm() - 1.0);
    EXPECT_LT(std::sqrt(squares / double(made.surface.positions.size())), 0.35 * sigma);
    EXPECT_EQ(made.report.components, 1u);
}

// Neither threads, nor the order of points, nor memory show.
TEST(PointSurface, TheSameWhateverTheThreads) {
    std::vector<ScannedPoint> points = without_normals(sphere_points(30'000, 1.0));
    Random random(3);
    for (ScannedPoint& p : points) p.place += 0.003 * Vec3d(random.normal(), random.normal(), random.normal());
    points.insert(points.end(), points.begin(), points.begin() + 500);  // some twice
    PointSurfaceSettings settings = {.spacing = 0.03, .radius = 0.09};
    const Made first = surface_of(ScannedPoints(points), settings);
    std::reverse(points.begin(), points.end());
    test::StoreInMemory store;
    for (const int threads : {2, 5}) {
        settings.threads = threads;
        if (threads == 5) settings.scratch = &store, settings.memory_bytes = 2'500'000;
        const Made other = surface_of(ScannedPoints(points), settings);
        EXPECT_EQ(first.surface.positions, other.surface.positions);
        EXPECT_EQ(first.surface.triangles, other.surface.triangles);
    }
    EXPECT_GT(store.written(), 100'000u);
}

// Bounds that lie: those of all points are asked for once, before anything is made of some of them.
TEST(PointSurface, BeginsAgainWithBoundsOfAll) {
    const ScannedPoints points(without_normals(sphere_points(16'000, 1.0)));
    PointSurfaceSettings settings = {.spacing = 0.1 / 3.0, .radius = 0.1, .threads = 2};
    const Made right = surface_of(points, settings);
    for (const double bricks : {0.5, 1.0, 1.5, 2.0, 5.0}) {
        Box3d bounds = points.info().bounds;
        bounds.max.z() -= bricks * kFieldBrickSide * settings.spacing;
        int asked = 0;
        settings.bounds_of_all = [&](uint64_t outside) {
            EXPECT_GT(outside, 0u);
            ++asked;
            return points.info().bounds;
        };
        PointSurface field(points, bounds, settings);
        EXPECT_EQ(field.outside(), 0u);
        EXPECT_LE(asked, 1);
        SurfaceInMemory surface;
        contour_bricks(field, {.inside = ContourInside::below, .open_at_nan = true}, surface);
        const SurfaceReport report = measure_surface(surface.mesh());
        EXPECT_TRUE(report.is_manifold()) << bricks;
        EXPECT_EQ(report.triangles, right.report.triangles);
        if (bricks == 5.0) EXPECT_EQ(asked, 1);
    }
}

// Points that say nothing of a surface make none.
TEST(PointSurface, WhatIsNoSurface) {
    const PointSurfaceSettings settings = {.spacing = 0.1, .radius = 0.3};
    const auto empty = [&](std::vector<ScannedPoint> points, const char* what) {
        const Made made = surface_of(ScannedPoints(std::move(points)), settings);
        EXPECT_EQ(made.report.triangles, 0u) << what;
        return made.points;
    };
    EXPECT_EQ(empty({{.place = {1.0, 2.0, 3.0}}}, "one point").without_normal, 1u);
    EXPECT_EQ(empty({{.place = {1.0, 2.0, 3.0}, .normal = {0, 0, 1}}}, "one point with a normal").without_normal, 0u);
    const PointSurfaceReport equal = empty(std::vector<ScannedPoint>(100'000, {.place = {1.0, 2.0, 3.0}}), "equal points");
    EXPECT_EQ(equal.merged, 1u);
    EXPECT_EQ(equal.without_normal, 1u);
    std::vector<ScannedPoint> line;
    for (int i = 0; i < 1000; ++i) line.push_back({.place = Vec3d(0.3, 0.4, 0.5) * (0.01 * i)});
    const PointSurfaceReport collinear = empty(line, "a line");
    EXPECT_EQ(collinear.without_normal, collinear.merged);
    // NaN is no normal, nor is 0; a file in which all are has none, and they are fitted.
    std::vector<ScannedPoint> sphere = sphere_points(16'000, 1.0);
    for (ScannedPoint& p : sphere) p.normal.setConstant(std::numeric_limits<float>::quiet_NaN());
    const Made fitted = surface_of(ScannedPoints(sphere), {.spacing = 0.1 / 3.0, .radius = 0.1});
    EXPECT_FALSE(fitted.points.has_normals);
    EXPECT_EQ(fitted.report.euler_characteristic, 2);
}

TEST(PointSurface, SaysWhatCannotBe) {
    const ScannedPoints points(sphere_points(5000, 1.0));
    const auto make = [&](const PointSurfaceSettings& settings) { PointSurface field(points, points.info().bounds, settings); };
    for (const double radius : {0.19, 0.71, -1.0, std::nan("")}) EXPECT_THROW(make({.spacing = 0.1, .radius = radius}), Error) << radius;
    EXPECT_THROW(make({.spacing = 1e-6, .radius = 3e-6}), Error);
    EXPECT_THROW(make({.spacing = 0.05, .radius = 0.15, .memory_bytes = 1000}), Error);
    Box3d half = points.info().bounds;
    half.max.z() = -0.5;
    PointSurface some(points, half, {.spacing = 0.05, .radius = 0.15});
    EXPECT_GT(some.outside(), 1000u);
}

}  // namespace
}  // namespace strata
