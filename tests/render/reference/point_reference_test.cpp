#include "render/reference/point_reference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/math/random.h"
#include "render/gbuffer.h"
#include "render/renderer.h"
#include "tests/support/test_cloud.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 64, kHeight = 40;
constexpr Rgba8 kBackground = make_rgba(10, 20, 30);

// 20 m x 20 m at random on the plane z = slope * x, far from the origin; 4 points a square metre or `strip_density`, where x > 0.
TestCloud plane_cloud(double slope, double strip_density = 4.0) {
    Random random(11);
    std::vector<Vec3i> quanta;
    const auto fill = [&](double low, double high, double density) {
        for (int i = 0; i < int(density * 20 * (high - low)); ++i) {
            const double x = random.uniform(low, high), y = random.uniform(-10, 10);
            quanta.emplace_back(int(std::lround(1e5 * x)), int(std::lround(1e5 * y)), int(std::lround(1e5 * slope * x)));
        }
    };
    fill(-10, 0, 4.0);
    fill(0, 10, strip_density);
    return single_node_cloud(quanta, {.scale = Vec3d::Constant(1e-5), .offset = Vec3d(5e5, 5e6, 0)}, 0.5);
}

PointReference reference_of(TestCloud& cloud, int threads = 2) {
    const ColorChannel channel = find_color_channel(cloud.info(), "rgb");
    return PointReference(cloud, PointColorizer(cloud.info(), channel, derive_range(cloud, channel)), threads);
}

// Looks straight down on the middle 10 m x 6 m from a height of 20 m.
Camera camera_above(Projection projection) {
    Camera camera;
    camera.projection = projection;
    camera.eye = Vec3d(5e5, 5e6, 20);
    camera.view_from_world = look_along(-Vec3d::UnitZ(), Vec3d::UnitY());
    camera.height = 6.0;
    camera.fov_rad = 2.0 * std::atan(3.0 / 20.0);
    return camera;
}

class TiltedPlane : public testing::TestWithParam<Projection> {};

// Discs lie in the plane, so that each pixel has the plane's own depth: z = slope x, depth = 20 - z, and in perspective
// x = depth * u. What a sample is off the pixel's middle moves the median by at most half a pixel.
TEST_P(TiltedPlane, HasTheDepthOfThePlaneAndNoHoles) {
    for (const double slope : {0.0, 0.5, -1.0}) {
        TestCloud cloud = plane_cloud(slope);
        const ReferencePicture picture = reference_of(cloud).draw(camera_above(GetParam()), kWidth, kHeight, kBackground, 2);
        const double pixel = 6.0 / kHeight;
        for (uint32_t y = 0; y < kHeight; ++y)
            for (uint32_t x = 0; x < kWidth; ++x) {
                const double across = (x + 0.5 - 0.5 * kWidth) * pixel;
                const double depth = GetParam() == Projection::orthographic ? 20.0 - slope * across : 20.0 / (1.0 + slope * across / 20.0);
                ASSERT_NEAR(picture.depths[size_t(y) * kWidth + x], depth, 0.5 * pixel * std::abs(slope) * 1.2 + 1e-3)
                    << "slope " << slope << " at " << x << ", " << y;
            }
    }
}

// Two strips of which one is 40 times as dense: still no holes, on either side and between them.
TEST_P(TiltedPlane, ClosesWhereDensityJumps) {
    TestCloud cloud = plane_cloud(0.3, 160.0);
    const ReferencePicture picture = reference_of(cloud).draw(camera_above(GetParam()), kWidth, kHeight, kBackground, 2);
    EXPECT_EQ(std::count(picture.depths.begin(), picture.depths.end(), kNoDepth), 0);
}

INSTANTIATE_TEST_SUITE_P(Both, TiltedPlane, testing::Values(Projection::orthographic, Projection::perspective));

// Two wires, a point every 0.3 m, 1 m apart: each shows, and what is between them stays open. As planes of their
// neighbors they would become a ribbon.
TEST(PointReference, KeepsWiresApart) {
    std::vector<Vec3i> quanta;
    for (int i = -80; i <= 80; ++i)
        for (const int side : {-1, 1}) quanta.emplace_back(300 * i + 70 * side, 500 * side, (i * i) % 7);
    TestCloud cloud = single_node_cloud(quanta, {.scale = Vec3d::Constant(1e-3), .offset = Vec3d(5e5, 5e6, 0)}, 0.5);
    const ReferencePicture picture = reference_of(cloud).draw(camera_above(Projection::orthographic), kWidth, kHeight, kBackground, 2);
    const auto row_of = [](double y) { return uint32_t((3.0 - y) / 6.0 * kHeight); };
    for (uint32_t x = 0; x < kWidth; ++x) {
        EXPECT_NE(picture.image.at(x, row_of(0.5)), kBackground);
        EXPECT_NE(picture.image.at(x, row_of(-0.5)), kBackground);
        EXPECT_EQ(picture.image.at(x, row_of(0.0)), kBackground);
        EXPECT_EQ(picture.image.at(x, row_of(1.5)), kBackground);
    }
}

TEST(PointReference, SamePixelsForAnyThreads) {
    TestCloud cloud = plane_cloud(0.5);
    const Camera camera = camera_above(Projection::perspective);
    const ReferencePicture one = reference_of(cloud, 1).draw(camera, kWidth, kHeight, kBackground, 1);
    const ReferencePicture many = reference_of(cloud, 7).draw(camera, kWidth, kHeight, kBackground, 7);
    EXPECT_EQ(one.image.pixels, many.image.pixels);
    EXPECT_EQ(one.depths, many.depths);
}

// On a plane each place has the color of the point nearest to it: compared in a picture whose pixels are smaller than the
// gaps. The average of 16 samples is that color wherever the whole pixel is nearest to one point.
TEST(PointReference, ShowsTheNearestPoint) {
    TestCloud cloud = plane_cloud(0.0);
    const ColorChannel channel = find_color_channel(cloud.info(), "rgb");
    const PointColorizer colorizer(cloud.info(), channel, derive_range(cloud, channel));
    PointBatch batch;
    cloud.read_node(0, colorizer.wanted(), batch);
    std::vector<Rgba8> colors(batch.size);
    colorizer.color(batch, 0, colors);
    const ReferencePicture picture = reference_of(cloud).draw(camera_above(Projection::orthographic), kWidth, kHeight, kBackground, 2);
    const double pixel = 6.0 / kHeight;
    size_t whole = 0;
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const Vec2d place((x + 0.5 - 0.5 * kWidth) * pixel, (0.5 * kHeight - y - 0.5) * pixel);
            double nearest = 1e9, next = 1e9;
            size_t best = 0;
            for (size_t i = 0; i < batch.size; ++i) {
                const double distance = (Vec2d(batch.x[i], batch.y[i]) * 1e-5 - place).norm();
                if (distance < nearest) {
                    next = nearest;
                    nearest = distance;
                    best = i;
                } else {
                    next = std::min(next, distance);
                }
            }
            if (next - nearest < 2.0 * std::numbers::sqrt2 * 0.5 * pixel) continue;
            ++whole;
            ASSERT_EQ(picture.image.at(x, y), colors[best]) << x << ", " << y;
        }
    EXPECT_GT(whole, kWidth * kHeight / 8u);
}

// The projection is the rasterizer's, though neither knows the other: with points of one pixel, far apart, both put each
// into the same pixel.
TEST(PointReference, AgreesWithTheRasterizerWhereAPointIs) {
    Random random(2);
    std::vector<Vec3i> quanta;
    for (int i = 0; i < 40; ++i)
        for (int copy = 0; copy < 20; ++copy)  // coincident but for a millimetre: a splat far smaller than a pixel
            quanta.emplace_back(i % 8 * 1200 - 4200 + copy % 5, i / 8 * 1000 - 2000 + copy / 5, int(random.uniform(0, 3)));
    TestCloud cloud = single_node_cloud(quanta, {.scale = Vec3d::Constant(1e-3), .offset = Vec3d(5e5, 5e6, 0)}, 0.5);
    Camera camera = camera_above(Projection::perspective);
    camera.view_from_world = look_along(Vec3d(0.1, 0.05, -1), Vec3d(0.2, 1, 0));
    RenderSettings settings;
    settings.width = 1600;  // a millimetre is a fifth of a pixel
    settings.height = 1000;
    settings.color = find_color_channel(cloud.info(), "rgb");
    settings.edl.strength = 0.0f;
    settings.splat.fixed_px = 1.0f;
    std::vector<float> depths;
    Renderer().render_frame(cloud, camera, settings, [&](const RenderedRows& rows) { depths.insert(depths.end(), rows.depths.begin(), rows.depths.end()); });
    const ReferencePicture picture = reference_of(cloud).draw(camera, settings.width, settings.height, kBackground, 2);
    size_t points = 0;
    for (size_t i = 0; i < depths.size(); ++i) {
        if (depths[i] == kNoDepth) continue;
        ++points;
        // The reference shows it in one of its samples at least: the pixel is no longer background.
        bool near = false;
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) near |= picture.image.pixels[size_t(int64_t(i) + dy * int64_t(settings.width) + dx)] != kBackground;
        EXPECT_TRUE(near) << i % settings.width << ", " << i / settings.width;
    }
    EXPECT_GT(points, 40u);
}

}  // namespace
}  // namespace strata
