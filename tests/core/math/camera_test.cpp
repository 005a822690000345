#include "core/math/camera.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/error.h"
#include "core/math/frustum.h"
#include "core/math/random.h"

namespace strata {
namespace {

TEST(Camera, RotationLooksAlongItsDirection) {
    const Mat3d view_from_world = look_along({3, 0, 0}, {0, 0, 7});
    EXPECT_TRUE((view_from_world * Vec3d(1, 0, 0)).isApprox(Vec3d(0, 0, -1)));  // ahead
    EXPECT_TRUE((view_from_world * Vec3d(0, 0, 1)).isApprox(Vec3d(0, 1, 0)));   // up
    EXPECT_TRUE((view_from_world * Vec3d(0, -1, 0)).isApprox(Vec3d(1, 0, 0)));  // looking east, south is to the right
}

TEST(Camera, AbsurdOnesAreRefused) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(look_along({0, 0, 0}, {0, 0, 1}), Error);
    EXPECT_THROW(look_along({0, 0, 2}, {0, 0, 1}), Error);
    EXPECT_THROW(look_along({nan, 0, 2}, {0, 0, 1}), Error);
    Camera camera;
    EXPECT_NO_THROW(check_camera(camera));
    for (const double fov : {0.0, -1.0, nan, std::numbers::pi}) {
        camera.fov_rad = fov;
        EXPECT_THROW(check_camera(camera), Error) << fov;
    }
    camera = {};
    camera.eye.x() = std::numeric_limits<double>::infinity();
    EXPECT_THROW(check_camera(camera), Error);
    camera = {.projection = Projection::orthographic, .height = 0.0};
    EXPECT_THROW(check_camera(camera), Error);
}

// Framed points lie within the picture less its margins, and in the tighter direction they touch both sides.
TEST(Camera, FramingIsTight) {
    Random random(1);
    std::vector<Vec3d> points;
    for (int i = 0; i < 200; ++i)
        points.emplace_back(5e5 + random.uniform(0, 80), 5.3e6 + random.uniform(0, 30), random.uniform(100, 110));
    const double aspect = 1.6, margin = 0.05;
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        Camera camera;
        camera.projection = projection;
        camera.view_from_world = look_along({1, 1, -0.7}, {0, 0, 1});
        frame_points(camera, points, aspect, margin);
        double least_x = 1, most_x = -1, least_y = 1, most_y = -1;  // of the picture's half sides
        for (const Vec3d& p : points) {
            const Vec3d q = camera.view_from_world * (p - camera.eye);
            ASSERT_LT(q.z(), 0.0);
            const double half = projection == Projection::perspective ? -q.z() * std::tan(0.5 * camera.fov_rad) : 0.5 * camera.height;
            least_x = std::min(least_x, q.x() / (half * aspect));
            most_x = std::max(most_x, q.x() / (half * aspect));
            least_y = std::min(least_y, q.y() / half);
            most_y = std::max(most_y, q.y() / half);
        }
        const double edge = 1.0 - 2.0 * margin, tolerance = 1e-9 * 5.3e6 / 30;  // rounding of the coordinates, of the extent
        EXPECT_NEAR(std::max({-least_x, most_x, -least_y, most_y}), edge, tolerance);
        EXPECT_TRUE(std::abs(most_x + least_x) < tolerance || std::abs(most_y + least_y) < tolerance);
    }
}

// A box is in sight whenever one of its points is; boxes behind the eye and beside the picture are not.
TEST(Frustum, NeverLosesAVisiblePoint) {
    Camera camera;
    camera.eye = {0, 0, 10};
    camera.view_from_world = look_along({0, 1, -0.2}, {0, 0, 1});
    const double aspect = 1.5, slope = std::tan(0.5 * camera.fov_rad);
    const Frustum frustum(camera, aspect);
    Random random(2);
    int seen = 0;
    for (int i = 0; i < 20000; ++i) {
        const Vec3d p(random.uniform(-60, 60), random.uniform(-60, 60), random.uniform(-60, 60));
        const Vec3d q = camera.view_from_world * (p - camera.eye);
        const bool visible = -q.z() > camera.near_depth && std::abs(q.x()) <= -q.z() * slope * aspect && std::abs(q.y()) <= -q.z() * slope;
        Box3d box;
        box.extend(p);
        if (visible != frustum.intersects(box)) ADD_FAILURE() << p.transpose();
        box.extend(p + Vec3d(random.uniform(), random.uniform(), random.uniform()));
        if (visible) EXPECT_TRUE(frustum.intersects(box));
        seen += visible;
    }
    EXPECT_GT(seen, 500);
}

}  // namespace
}  // namespace strata
