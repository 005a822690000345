#include "core/simulate/scene.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"

namespace strata {
namespace {

TEST(Waves, SineAndCosineAgreeWithTheLibrary) {
    for (double turns = -3.0; turns < 3.0; turns += 0.0137) {
        const SinCos got = sin_cos_turns(turns);
        EXPECT_NEAR(got.sin, std::sin(2.0 * M_PI * turns), 2e-13);
        EXPECT_NEAR(got.cos, std::cos(2.0 * M_PI * turns), 2e-13);
    }
}

TEST(Waves, LogarithmAgreesWithTheLibrary) {
    Random random(4);
    for (int i = 0; i < 10'000; ++i) {
        const double share = 1.0 - random.uniform(), any = std::ldexp(share, i % 600 - 300);
        EXPECT_NEAR(natural_log(share), std::log(share), 1e-13 * std::max(1.0, -std::log(share)));
        EXPECT_NEAR(natural_log(any), std::log(any), 1e-13 * std::max(1.0, std::abs(std::log(any))));
    }
    EXPECT_EQ(natural_log(1.0), 0.0);
}

TEST(Waves, FloorIsExactAtWholeNumbers) {
    EXPECT_EQ(floor_to_int(-2.0), -2);
    EXPECT_EQ(floor_to_int(-2.25), -3);
    EXPECT_EQ(floor_to_int(2.75), 2);
    EXPECT_EQ(floor_to_int(0.0), 0);
}

// Central differences of step h err by h^2/6 of the third derivative, here below 1e-9, and by rounding of about 1e-14 / h.
TEST(Terrain, SlopeAndCurvatureAreDerivativesOfTheHeight) {
    const Terrain terrain(5);
    Pond pond{.center = Vec2d(3.0, -4.0), .radius = 20.0, .depth = 3.0, .water_level = 0.0};
    const auto at = [&](double x, double y) {
        GroundSample ground = terrain.sample(x, y);
        pond.lower(x, y, ground);
        return ground;
    };
    constexpr double h = 1e-3;
    Random random(1);
    for (int i = 0; i < 200; ++i) {
        const double x = random.uniform(-25.0, 25.0), y = random.uniform(-25.0, 25.0);
        const GroundSample g = at(x, y);
        EXPECT_NEAR(g.slope_x, (at(x + h, y).height - at(x - h, y).height) / (2 * h), 1e-7);
        EXPECT_NEAR(g.slope_y, (at(x, y + h).height - at(x, y - h).height) / (2 * h), 1e-7);
        EXPECT_NEAR(g.curve_xx, (at(x + h, y).slope_x - at(x - h, y).slope_x) / (2 * h), 1e-6);
        EXPECT_NEAR(g.curve_xy, (at(x + h, y).slope_y - at(x - h, y).slope_y) / (2 * h), 1e-6);
        EXPECT_NEAR(g.curve_yy, (at(x, y + h).slope_y - at(x, y - h).slope_y) / (2 * h), 1e-6);
        EXPECT_LE(std::abs(g.curve_xx), terrain.curvature_bound() + pond.curvature_bound());
        EXPECT_LE(std::abs(terrain.height(x, y)), terrain.highest());
    }
}

// From the origin to (2, 2, 2).
ConvexSolid make_box() {
    ConvexSolid box;
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {0.0, 2.0}) {
            Vec3d point = Vec3d::Zero(), normal = Vec3d::Zero();
            point[axis] = side;
            normal[axis] = side > 0.0 ? 1.0 : -1.0;
            box.add_plane(normal, point, Part::wall);
        }
    box.close();
    return box;
}

// Beams that the quick tests turn away are those that miss: a box is its own bounds, and a crown by its quadratic equation.
TEST(QuickTests, TurnAwayOnlyBeamsThatMiss) {
    const ConvexSolid box = make_box();
    const Crown crown{.center = Vec3d(1.0, 1.0, 1.0), .radius = 0.7, .half_height = 1.9};
    Random random(8);
    int hits = 0, spans = 0;
    for (int i = 0; i < 20'000; ++i) {
        Vec3d direction(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0));
        if (i % 4 == 0) direction[i / 4 % 3] = 0.0;
        if (i % 8 == 0) direction[(i / 4 + 1) % 3] = 0.0;
        if (direction.norm() < 1e-3) continue;
        const Ray ray{Vec3d(random.uniform(-4.0, 6.0), random.uniform(-4.0, 6.0), random.uniform(-4.0, 6.0)), direction.normalized()};
        RayHit hit;
        const bool met = box.meet(ray, hit), may = box.may_meet(ray, ray.direction.cwiseInverse(), INFINITY);
        const bool inside = box.contains(ray.origin, 0.0);
        ASSERT_EQ(may, met || inside) << i;
        if (met) {
            ASSERT_FALSE(box.may_meet(ray, ray.direction.cwiseInverse(), hit.distance - 1e-3)) << i;
        }
        hits += met;

        const Vec3d scale(1.0 / 0.7, 1.0 / 0.7, 1.0 / 1.9);
        const Vec3d o = (ray.origin - crown.center).cwiseProduct(scale), d = ray.direction.cwiseProduct(scale);
        const double nearest2 = (o - o.dot(d) / d.squaredNorm() * d).squaredNorm();
        const bool through = nearest2 < 1.0 && (o.squaredNorm() < 1.0 || o.dot(d) < 0.0);
        double enter = 0.0, leave = 0.0;
        ASSERT_EQ(crown.span(ray, enter, leave), through) << i;
        spans += through;
    }
    EXPECT_GT(hits, 300);
    EXPECT_GT(spans, 300);
}

// A cube with one opening: distances by hand.
TEST(ConvexSolid, NearestPointsOfABoxWithAWindow) {
    ConvexSolid box = make_box();
    for (Face& face : box.faces)
        if (face.normal.x() > 0.5) face.openings.push_back({0.5, 1.5, 0.5, 1.5});
    const auto distance = [&](const Vec3d& query) {
        NearestPoint best;
        box.nearest_points(query, [&](const Vec3d& p, const Vec3d& n, Part part, const Face&) { best.offer(query, p, n, part); });
        return best.distance;
    };
    EXPECT_NEAR(distance({3.0, 0.25, 1.0}), 1.0, 1e-12);                          // to the wall beside the window
    EXPECT_NEAR(distance({3.0, 1.0, 1.0}), std::hypot(1.0, 0.5), 1e-12);          // to the window's edge, nearer than the pane
    EXPECT_NEAR(distance({2.0, 1.0, 1.0}), kRecess, 1e-12);                       // to the pane
    EXPECT_NEAR(distance({5.0, 6.0, 1.0}), 5.0, 1e-12);                           // to an edge of the box
    EXPECT_TRUE(box.contains({1.0, 1.0, 1.0}, 0.5));
    EXPECT_FALSE(box.contains({1.95, 1.0, 1.0}, 0.0));                            // in the recess
    EXPECT_TRUE(box.contains({1.95, 0.2, 1.0}, 0.0));                             // beside it

    RayHit hit;
    ASSERT_TRUE(box.meet({Vec3d(5.0, 1.0, 1.0), -Vec3d::UnitX()}, hit));
    EXPECT_NEAR(hit.distance, 3.0 + kRecess, 1e-12);
    EXPECT_EQ(hit.part, Part::pane);
    hit = RayHit{};
    ASSERT_TRUE(box.meet({Vec3d(5.0, 0.2, 1.0), -Vec3d::UnitX()}, hit));
    EXPECT_NEAR(hit.distance, 3.0, 1e-12);
    EXPECT_EQ(hit.part, Part::wall);
}

TEST(Wire, NearestParameterIsAFootOfThePerpendicular) {
    const Wire wire{.begin = Vec3d(0, 0, 8), .end = Vec3d(40, 3, 9), .sag = 0.8, .radius = 0.01};
    Random random(3);
    for (int i = 0; i < 100; ++i) {
        const Vec3d query(random.uniform(1.0, 39.0), random.uniform(-4.0, 6.0), random.uniform(5.0, 11.0));
        const double s = wire.nearest_parameter(query);
        if (s > 0.0 && s < 1.0) {
            EXPECT_NEAR((query - wire.at(s)).dot(wire.tangent(s).normalized()), 0.0, 1e-9);
        }
        for (int k = 0; k <= 1000; ++k) EXPECT_LE((query - wire.at(s)).norm(), (query - wire.at(k / 1000.0)).norm() + 1e-9);
    }
}

// On level enough ground the nearest point of the terrain is stationary: no point of a fine grid around is nearer.
TEST(SceneProbe, NearestGroundBeatsAGrid) {
    const VillageScene scene(1);
    SceneProbe probe(scene);
    Random random(7);
    for (int i = 0; i < 20; ++i) {
        Vec3d query(random.uniform(-200.0, 200.0), random.uniform(-200.0, 200.0), 0.0);
        query.z() = probe.ground(query.x(), query.y()).height + random.uniform(0.0, 5.0);
        if (probe.buried(query, 0.0)) continue;
        const NearestPoint nearest = probe.nearest_surface(query);
        EXPECT_NEAR(nearest.normal.norm(), 1.0, 1e-12);
        for (int u = -20; u <= 20; ++u)
            for (int v = -20; v <= 20; ++v) {
                Vec3d p(query.x() + 0.1 * u, query.y() + 0.1 * v, 0.0);
                p.z() = probe.ground(p.x(), p.y()).height;
                EXPECT_GE((p - query).norm(), nearest.distance - 1e-9);
            }
    }
}

// Two ways to find the first surface on a ray that share no code but the shapes: solving for it, and creeping up to it by
// the distance to the nearest surface, which can never overshoot. Wires have no width for a ray without one.
TEST(SceneProbe, TraceAgreesWithSphereTracing) {
    const VillageScene scene(1);
    SceneProbe probe(scene);
    const Vec2d crossing = scene.land().crossing(0, 0);
    const Vec3d eye(crossing.x() + 3.0, crossing.y() + 2.0, probe.ground(crossing.x() + 3.0, crossing.y() + 2.0).height + 1.8);
    Random random(11);
    int compared = 0;
    for (int i = 0; i < 150; ++i) {
        const double azimuth = random.uniform(0.0, 2.0 * M_PI), elevation = random.uniform(-0.5, 0.35);
        const Ray ray{eye, Vec3d(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation))};
        constexpr double kFarthest = 60.0;
        BeamPath path;
        probe.trace(ray, kFarthest, 0.0, path);
        double t = 0.0;
        bool grazing = false;
        for (int step = 0; step < 3000; ++step) {
            const NearestPoint nearest = probe.nearest_surface(ray.at(t));
            grazing |= nearest.part == Part::wire && nearest.distance < 0.05;
            if (nearest.distance < 1e-7 || t > kFarthest) break;
            t += nearest.distance;
        }
        if (grazing) continue;
        ++compared;
        // 1e-7 from a surface that is met at more than 1e-3 rad; the sky is farther than the farthest.
        EXPECT_NEAR(std::min(t, kFarthest), std::min(path.hard.distance, kFarthest), 1e-4) << "ray " << i;
    }
    EXPECT_GT(compared, 100);
}

TEST(SceneProbe, SameTileWhicheverWayItIsReached) {
    const VillageScene scene(4);
    SceneProbe first(scene), second(scene);
    for (int64_t far = 3; far < 40; ++far) second.ground(double(far) * kTileSize, 0.0);  // pushes tiles out of the cache
    BeamPath a, b;
    const Ray ray{Vec3d(10.0, 20.0, 300.0), Vec3d(0.1, 0.05, -1.0).normalized()};
    first.trace(ray, 1e9, 0.0, a);
    second.trace(ray, 1e9, 0.0, b);
    EXPECT_EQ(a.hard.distance, b.hard.distance);
    EXPECT_EQ(a.leaf_count, b.leaf_count);
}

}  // namespace
}  // namespace strata
