#include "render/pass/edl_kernel.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "render/reference/edl_reference.h"

namespace strata {
namespace {

GBuffer make_gbuffer(uint32_t width, uint32_t rows) {
    GBuffer gbuffer{.width = width, .rows = rows};
    gbuffer.colors.assign(size_t(width) * rows, make_rgba(200, 180, 90));
    gbuffer.depths.assign(size_t(width) * rows, 1.0f);
    gbuffer.splat_px.assign(size_t(width) * rows, 1);
    return gbuffer;
}

Camera camera_of(Projection projection, double height) {
    Camera camera;
    camera.projection = projection;
    camera.height = height;
    return camera;
}

std::vector<Rgba8> shade(const GBuffer& gbuffer, const EdlSettings& settings, const Camera& camera, int threads = 2,
                         SimdLevel level = best_simd_level()) {
    std::vector<Rgba8> out(gbuffer.colors.size());
    shade_edl(gbuffer, settings, camera, gbuffer.rows, 0, gbuffer.rows, threads, out, level);
    return out;
}

// Bumps, cliffs and holes, drawn at random, in every color; wider than a segment, smaller than the reach of some splats.
GBuffer random_gbuffer(uint32_t width, uint32_t rows, unsigned most_splat_px) {
    Random random(6);
    GBuffer gbuffer = make_gbuffer(width, rows);
    for (size_t i = 0; i < gbuffer.depths.size(); ++i) {
        gbuffer.depths[i] = float(40.0 + random.normal() * (random.uniform() < 0.2 ? 3.0 : 0.03));
        gbuffer.colors[i] = make_rgba(uint8_t(random.bits()), uint8_t(random.bits()), uint8_t(random.bits()));
        gbuffer.splat_px[i] = uint8_t(random.bits() % most_splat_px);
        if (random.uniform() < 0.2) {
            gbuffer.depths[i] = kNoDepth;
            gbuffer.colors[i] = 0;
        }
    }
    return gbuffer;
}

TEST(EdlKernel, AgreesWithTheDoublePrecisionTwin) {
    const GBuffer gbuffer = random_gbuffer(261, 143, 90);
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const float strength : {0.05f, 0.8f, 100.0f})
            for (const bool follow : {false, true}) {
                const Camera camera = camera_of(projection, 5.0);
                const EdlSettings settings = {.strength = strength, .radius = 0.02f, .follow_splats = follow};
                const std::vector<Rgba8> shaded = shade(gbuffer, settings, camera);
                const Vec2d pixel_world = pixel_world_size(camera, 143).cast<double>();
                double worst = 0.0;
                for (int y = 0; y < 143; ++y)
                    for (int x = 0; x < 261; ++x) {
                        const Vec4d truth = edl_shaded(gbuffer, settings, pixel_world, 143, x, y);
                        const Rgba8 pixel = shaded[size_t(y) * 261 + size_t(x)];
                        const Vec4d found(red_of(pixel), green_of(pixel), blue_of(pixel), alpha_of(pixel));
                        worst = std::max(worst, (found - truth).cwiseAbs().maxCoeff());
                        ASSERT_EQ(found[3], truth[3]);
                    }
                EXPECT_LT(worst, 0.52) << strength;  // half a step of rounding, and 1/50 for float32
            }
}

// One kernel, compiled for each instruction set; rows go to threads as they come.
TEST(EdlKernel, ThreadsAndInstructionSetsDoNotShow) {
    const GBuffer gbuffer = random_gbuffer(333, 97, 12);
    const Camera camera = camera_of(Projection::perspective, 5.0);
    const std::vector<Rgba8> plain = shade(gbuffer, {.strength = 2.0f}, camera, 1, SimdLevel::baseline);
    for (const SimdLevel level : simd_levels())
        for (const int threads : {1, 2, 7}) EXPECT_EQ(shade(gbuffer, {.strength = 2.0f}, camera, threads, level), plain) << name_of(level);
}

// Rows of a strip, with the neighbors that it was drawn with, are those of the whole picture.
TEST(EdlKernel, StripsDoNotShow) {
    const GBuffer whole = random_gbuffer(90, 60, 8);
    const Camera camera = camera_of(Projection::perspective, 5.0);
    const EdlSettings settings = {.radius = 0.05f};  // 3, 6 and 12 px
    const std::vector<Rgba8> expected = shade(whole, settings, camera);
    GBuffer strip{.width = 90, .first_row = 8, .rows = 30};  // rows 20 to 26 and 12 on either side
    strip.colors.assign(whole.colors.begin() + 8 * 90, whole.colors.begin() + 38 * 90);
    strip.depths.assign(whole.depths.begin() + 8 * 90, whole.depths.begin() + 38 * 90);
    strip.splat_px.assign(whole.splat_px.begin() + 8 * 90, whole.splat_px.begin() + 38 * 90);
    std::vector<Rgba8> out(6 * 90);
    shade_edl(strip, settings, camera, 60, 12, 6, 2, out);
    EXPECT_EQ(out, std::vector<Rgba8>(expected.begin() + 20 * 90, expected.begin() + 26 * 90));
}

// A plane that faces the viewer keeps its colors exactly, up to the picture's borders and beside the background.
TEST(EdlKernel, FacingPlanesKeepTheirColor) {
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        GBuffer gbuffer = make_gbuffer(200, 100);
        for (uint32_t y = 10; y < 20; ++y)
            for (uint32_t x = 10; x < 90; ++x) {
                gbuffer.depths[y * 200 + x] = kNoDepth;
                gbuffer.colors[y * 200 + x] = 0;
            }
        EXPECT_EQ(shade(gbuffer, {.strength = 3.0f}, camera_of(projection, 2.0)), gbuffer.colors);
    }
}

// A thin cloud seen from above: level ground of which most pixels show nothing, and depths as exact as the rasterizer has them.
TEST(EdlKernel, ThinCloudsFromAboveKeepTheirColor) {
    Random random(8);
    GBuffer gbuffer = make_gbuffer(400, 300);
    for (size_t i = 0; i < gbuffer.depths.size(); ++i) {
        gbuffer.depths[i] = random.uniform() < 0.1 ? std::nextafter(500.0f, random.uniform() < 0.5 ? 0.0f : 1000.0f) : kNoDepth;
        if (gbuffer.depths[i] == kNoDepth) gbuffer.colors[i] = 0;
    }
    const std::vector<Rgba8> shaded = shade(gbuffer, {.strength = 1.0f}, camera_of(Projection::orthographic, 200.0));
    for (size_t i = 0; i < shaded.size(); ++i) EXPECT_LE(int(red_of(gbuffer.colors[i])) - int(red_of(shaded[i])), 0);
}

// A plane tilted by phi: the mean response is tan(phi) (1 + sqrt 2) / 8, whatever the resolution, the distance, the radius and
// the projection, up to the borders; only in the corners one diagonal of the two is missing.
TEST(EdlReference, TiltedPlaneFollowsTheClosedForm) {
    for (const double phi : {0.0, 0.2, 0.7, 1.2})
        for (const uint32_t side : {33u, 120u})
            for (const float radius : {0.01f, 0.05f, 0.2f})
                for (const double distance : {10.0, 1000.0}) {
                    GBuffer gbuffer = make_gbuffer(side, side);
                    const double unit = 7.0 / side;  // the picture shows 7 units
                    for (uint32_t y = 0; y < side; ++y)
                        for (uint32_t x = 0; x < side; ++x)
                            gbuffer.depths[y * side + x] = float(distance + std::tan(phi) * unit * (x + 0.5));
                    const EdlSettings settings = {.radius = radius, .follow_splats = false};
                    const double expected = std::tan(phi) * (1.0 + std::sqrt(2.0)) / 8.0;
                    // Depths are float32: an error of 2^-24 of the distance, over a step of a pixel.
                    const double tolerance = 1e-6 + distance * 0x1p-23 / unit;
                    const int middle = int(side / 2), last = int(side) - 1;
                    for (const auto& [x, y] : {std::pair(middle, middle), {0, middle}, {last, middle}, {middle, 0}, {middle, last}})
                        if (radius < 0.1f || (x == middle && y == middle))  // else both of a pair may lie outside
                            EXPECT_NEAR(edl_response(gbuffer, settings, Vec2d(0, unit), side, x, y), expected, tolerance)
                                << phi << ' ' << side << ' ' << radius << ' ' << x << ' ' << y;
                    for (const int x : {0, last})
                        EXPECT_NEAR(edl_response(gbuffer, settings, Vec2d(0, unit), side, x, x), expected, 0.06 * expected + tolerance);
                }
}

// The same plane in perspective: 1 / depth is linear in the picture. Neighbors on either side do not lie equally far, which
// cancels but for the square of the step.
TEST(EdlReference, PerspectiveAgreesWithOrthographic) {
    const uint32_t side = 201;
    for (const double slope : {-2.0, -0.4, 0.3, 1.5}) {
        const Camera camera = camera_of(Projection::perspective, 1.0);
        const Vec2d pixel_world = pixel_world_size(camera, side).cast<double>();
        GBuffer gbuffer = make_gbuffer(side, side);
        for (uint32_t y = 0; y < side; ++y)
            for (uint32_t x = 0; x < side; ++x)
                gbuffer.depths[y * side + x] = float(30.0 / (1.0 - slope * pixel_world.x() * (double(x) - side / 2)));
        const double response = edl_response(gbuffer, {.radius = 0.005f, .follow_splats = false}, pixel_world, side, side / 2, side / 2);
        EXPECT_NEAR(response / (std::abs(slope) * (1.0 + std::sqrt(2.0)) / 8.0), 1.0, 0.02) << slope;
    }
}

// The foot of a step is darker, the farther out the less; its top and what lies out of reach keep their color.
TEST(EdlKernel, AStepDarkensItsFoot) {
    GBuffer gbuffer = make_gbuffer(100, 100);
    for (uint32_t y = 0; y < 100; ++y)
        for (uint32_t x = 50; x < 100; ++x) gbuffer.depths[y * 100 + x] = 1.5f;
    const EdlSettings settings = {.radius = 0.02f};  // 2, 4 and 8 px
    const std::vector<Rgba8> shaded = shade(gbuffer, settings, camera_of(Projection::orthographic, 2.0));
    const auto green = [&](int x) { return int(green_of(shaded[50 * 100 + size_t(x)])); };
    EXPECT_EQ(green(49), 180);
    EXPECT_LT(green(50), green(52));
    EXPECT_LT(green(52), green(55));
    EXPECT_LT(green(55), 180);
    EXPECT_EQ(green(58), 180);
}

// A wire at the border before far ground: the jump behind it does not say that something nearer lies outside.
TEST(EdlKernel, JumpsAtTheBorderDoNotDarken) {
    GBuffer gbuffer = make_gbuffer(80, 80);
    for (uint32_t y = 0; y < 80; ++y)
        for (uint32_t x = 1; x < 80; ++x) gbuffer.depths[y * 80 + x] = 9.0f;
    const std::vector<Rgba8> shaded = shade(gbuffer, {.radius = 0.03f}, camera_of(Projection::orthographic, 2.0));
    EXPECT_EQ(shaded[40 * 80], gbuffer.colors[0]);
}

}  // namespace
}  // namespace strata
