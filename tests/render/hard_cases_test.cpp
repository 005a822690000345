// Whole frames where numbers are hard: compared with a projection of every point in double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "core/math/random.h"
#include "core/octree/memory_cloud.h"
#include "render/renderer.h"
#include "tests/support/memory_source.h"

namespace strata {
namespace {

// MemorySource's own; a tree may count its quanta from elsewhere.
Vec3d world_of(const Vec3d& quanta) { return Vec3d(500'000.0, 5'300'000.0, 0.0) + 0.001 * quanta; }

std::vector<float> depths_of(LayeredCloud& cloud, const Camera& camera, uint32_t width, uint32_t height) {
    RenderSettings settings;
    settings.width = width;
    settings.height = height;
    settings.color = find_color_channel(cloud.info(), "elevation");
    settings.splat = {.shape = SplatShape::square, .fixed_px = 1.0f};
    settings.selection.error_px = 1e-9;  // every point
    settings.edl.strength = 0.0f;
    settings.threads = 2;
    std::vector<float> depths;
    Renderer().render_frame(cloud, camera, settings,
                            [&](const RenderedRows& rows) { depths.insert(depths.end(), rows.depths.begin(), rows.depths.end()); });
    return depths;
}

// Each pixel has the depth of the nearest point whose center lies in it, to the rounding of a float; pixels with a point within a
// thousandth of their border do not count.
void expect_every_point(LayeredCloud& cloud, const std::vector<Vec3i>& quanta, const Camera& camera, uint32_t width, uint32_t height,
                        size_t least_drawn) {
    std::map<size_t, double> nearest;
    std::map<size_t, bool> unsure;
    for (const Vec3i& q : quanta) {
        const Vec3d p = camera.view_from_world * (world_of(q.cast<double>()) - camera.eye);
        if (-p.z() < 0.9 * camera.near_depth) continue;
        const double scale = pixels_per_unit(camera, -p.z(), height), x = 0.5 * width + scale * p.x(), y = 0.5 * height - scale * p.y();
        const bool at_near = -p.z() < 1.1 * camera.near_depth;
        for (const double dx : {-1e-3, 1e-3})
            for (const double dy : {-1e-3, 1e-3}) {
                const double column = std::floor(x + dx), row = std::floor(y + dy);
                if (column < 0 || row < 0 || column >= width || row >= height) continue;
                const size_t pixel = size_t(row) * width + size_t(column);
                if (at_near || column != std::floor(x) || row != std::floor(y) || std::floor(x - dx) != std::floor(x) ||
                    std::floor(y - dy) != std::floor(y))
                    unsure[pixel] = true;
                const auto [place, is_new] = nearest.emplace(pixel, -p.z());
                if (!is_new) place->second = std::min(place->second, -p.z());
            }
    }
    const std::vector<float> depths = depths_of(cloud, camera, width, height);
    size_t drawn = 0;
    for (size_t pixel = 0; pixel < depths.size(); ++pixel) {
        if (unsure.contains(pixel)) continue;
        const auto found = nearest.find(pixel);
        ASSERT_EQ(depths[pixel] == kNoDepth, found == nearest.end()) << pixel;
        if (found == nearest.end()) continue;
        ++drawn;
        ASSERT_NEAR(depths[pixel], found->second, 1e-6 * found->second) << pixel;
    }
    EXPECT_GE(drawn, least_drawn);
}

// The eye in metres from quanta zero.
Camera camera_at(const Vec3d& eye, const Vec3d& forward, double near_depth) {
    Camera camera;
    camera.eye = world_of(1000.0 * eye);
    camera.view_from_world = look_along(forward, Vec3d::UnitZ());
    camera.near_depth = near_depth;
    return camera;
}

std::vector<Vec3i> wall() {
    Random random(31);
    std::vector<Vec3i> quanta;
    for (int i = 0; i < 20'000; ++i)
        quanta.emplace_back(int(random.uniform(-3000, 3000)), 1000 + int(random.uniform(-30, 30)), int(random.uniform(-2000, 2000)));
    return quanta;
}

// The root is a thousand kilometres wide and its children are empty but for the wall: not a pixel of the wall changes.
TEST(HardCases, AnOutlierDoesNotShow) {
    std::vector<Vec3i> quanta = wall();
    const auto alone = build_memory_cloud(MemorySource(quanta), {});
    const Camera camera = camera_at({0, 0, 0}, {0, 1, 0}, 0.1);
    const std::vector<float> expected = depths_of(*alone, camera, 160, 120);
    quanta.emplace_back(1'000'000'000, -5, 7);
    const auto wide = build_memory_cloud(MemorySource(quanta), {});
    ASSERT_GT((wide->node(wide->root()).bounds.max - wide->node(wide->root()).bounds.min).maxCoeff(), 9.9e5);
    const std::vector<float> depths = depths_of(*wide, camera, 160, 120);
    for (size_t i = 0; i < depths.size(); ++i)
        if (depths[i] != expected[i]) ASSERT_NEAR(depths[i], expected[i], 1e-6) << i;
    expect_every_point(*wide, quanta, camera, 160, 120, 500);
}

// Points 0.2 m and 2,000 km away in one picture: a ratio of 10^7. Each is where it belongs, with a depth to seven digits.
TEST(HardCases, NearAndFarByTenMillion) {
    Random random(32);
    std::vector<Vec3i> quanta;
    for (int i = 0; i < 4000; ++i) {
        const double depth = std::pow(10.0, random.uniform(2.3, 9.3));  // quanta
        quanta.emplace_back(int(depth * random.uniform(-0.5, 0.5)), int(depth), int(depth * random.uniform(-0.4, 0.4)));
    }
    const auto cloud = build_memory_cloud(MemorySource(quanta), {});
    expect_every_point(*cloud, quanta, camera_at({0, 0, 0}, {0, 1, 0}, 0.2), 320, 240, 2500);
}

// The eye is inside the cloud, so that nodes reach through the eye's plane: what is behind does not show, and nothing before it is missing.
// Pictures of a single pixel, of odd sides, and as wide or as high as pictures may be.
TEST(HardCases, TheEyeInsideTheCloudAtAnySize) {
    Random random(33);
    std::vector<Vec3i> quanta;
    for (int i = 0; i < 30'000; ++i)
        quanta.emplace_back(int(random.uniform(-20'000, 20'000)), int(random.uniform(-20'000, 20'000)),
                            int(random.uniform(-20'000, 20'000)));
    const auto cloud = build_memory_cloud(MemorySource(quanta), {});
    struct Size {
        uint32_t width, height;
        size_t least_drawn;
    };
    for (const Size size : {Size{1, 1, 0}, {161, 97, 1500}, {16384, 1, 10}, {1, 16384, 0}}) {
        for (const Vec3d& forward : {Vec3d(0.3, 0.8, -0.1), Vec3d(-0.9, 0.1, 0.4)}) {
            SCOPED_TRACE(std::to_string(size.width) + " x " + std::to_string(size.height));
            expect_every_point(*cloud, quanta, camera_at({1.25, -2.5, 0.75}, forward, 0.5), size.width, size.height, size.least_drawn);
        }
    }
}

}  // namespace
}  // namespace strata
