#include "render/pass/edl_pass.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "core/error.h"
#include "core/math/random.h"
#include "render/gl/egl_context.h"
#include "render/reference/edl_reference.h"

namespace strata {
namespace {

// One context for all tests; none where the machine has no EGL, which is the one reason to skip.
const EglContext* context() {
    static const std::unique_ptr<EglContext> made = []() -> std::unique_ptr<EglContext> {
        try {
            return std::make_unique<EglContext>(2);
        } catch (const Error& error) {
            std::printf("%s\n", error.what());
            return nullptr;
        }
    }();
    return made.get();
}

#define SKIP_WITHOUT_EGL() \
    if (context() == nullptr) GTEST_SKIP() << "no EGL with OpenGL 4.5 here"

GBuffer make_gbuffer(uint32_t width, uint32_t rows) {
    GBuffer gbuffer{.width = width, .rows = rows};
    gbuffer.colors.assign(size_t(width) * rows, make_rgba(200, 180, 90));
    gbuffer.depths.assign(size_t(width) * rows, 1.0f);
    gbuffer.splat_px.assign(size_t(width) * rows, 1);
    return gbuffer;
}

std::vector<Rgba8> shade(const GBuffer& gbuffer, const EdlSettings& settings, const Camera& camera, uint32_t height_px) {
    std::vector<Rgba8> out(gbuffer.colors.size());
    EdlPass pass(*context());
    pass.shade(gbuffer, settings, camera, height_px, 0, gbuffer.rows, out);
    return out;
}

Camera camera_of(Projection projection, double height) {
    Camera camera;
    camera.projection = projection;
    camera.height = height;
    return camera;
}

// Bumps, cliffs and holes, drawn at random; the shader's arithmetic is float32 and GL's exp and pow are less exact still.
TEST(EdlPass, AgreesWithTheDoublePrecisionTwin) {
    SKIP_WITHOUT_EGL();
    Random random(6);
    GBuffer gbuffer = make_gbuffer(61, 43);
    for (size_t i = 0; i < gbuffer.depths.size(); ++i) {
        gbuffer.depths[i] = float(40.0 + random.normal() * (random.uniform() < 0.2 ? 3.0 : 0.03));
        gbuffer.colors[i] = make_rgba(uint8_t(random.bits()), uint8_t(random.bits()), uint8_t(random.bits()));
        gbuffer.splat_px[i] = uint8_t(random.bits() % 12);
        if (random.uniform() < 0.2) {
            gbuffer.depths[i] = kNoDepth;
            gbuffer.colors[i] = 0;
        }
    }
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const bool follow : {false, true}) {
            const Camera camera = camera_of(projection, 5.0);
            const EdlSettings settings = {.strength = 0.8f, .radius_px = 3, .follow_splats = follow};
            const std::vector<Rgba8> shaded = shade(gbuffer, settings, camera, 43);
            const Vec2d pixel_world = pixel_world_size(camera, 43).cast<double>();
            for (int y = 0; y < 43; ++y)
                for (int x = 0; x < 61; ++x) {
                    const Vec4d truth = edl_shaded(gbuffer, settings, pixel_world, x, y);
                    const Rgba8 pixel = shaded[size_t(y) * 61 + size_t(x)];
                    // Half a step of rounding to 8 bits, and a tenth for float32 and the driver's pow.
                    EXPECT_NEAR(red_of(pixel), truth[0], 0.6);
                    EXPECT_NEAR(green_of(pixel), truth[1], 0.6);
                    EXPECT_NEAR(blue_of(pixel), truth[2], 0.6);
                    EXPECT_EQ(alpha_of(pixel), truth[3]);
                }
        }
}

// A plane tilted by phi in orthographic projection: the mean response is tan(phi) (1 + sqrt 2) / 8, whatever the
// resolution, the distance and the radius.
TEST(EdlReference, TiltedPlaneFollowsTheClosedForm) {
    for (const double phi : {0.0, 0.2, 0.7, 1.2})
        for (const uint32_t side : {33u, 120u})
            for (const float radius : {1.0f, 2.0f, 5.0f})
                for (const double distance : {10.0, 1000.0}) {
                    GBuffer gbuffer = make_gbuffer(side, side);
                    const double unit = 7.0 / side;  // the picture shows 7 units
                    for (uint32_t y = 0; y < side; ++y)
                        for (uint32_t x = 0; x < side; ++x)
                            gbuffer.depths[y * side + x] = float(distance + std::tan(phi) * unit * (x + 0.5));
                    const EdlSettings settings = {.radius_px = radius, .follow_splats = false};
                    const double response = edl_response(gbuffer, settings, Vec2d(0, unit), int(side / 2), int(side / 2));
                    // Depths are float32: an error of 2^-24 of the distance, over a step of a pixel.
                    const double tolerance = 1e-6 + distance * 0x1p-23 / unit;
                    EXPECT_NEAR(response, std::tan(phi) * (1.0 + std::sqrt(2.0)) / 8.0, tolerance) << phi << ' ' << side << ' ' << radius;
                }
}

// A plane that faces the viewer keeps its colors exactly, up to the picture's borders and beside the background.
TEST(EdlPass, FacingPlanesKeepTheirColor) {
    SKIP_WITHOUT_EGL();
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        GBuffer gbuffer = make_gbuffer(40, 30);
        for (uint32_t y = 10; y < 20; ++y)
            for (uint32_t x = 10; x < 20; ++x) {
                gbuffer.depths[y * 40 + x] = kNoDepth;
                gbuffer.colors[y * 40 + x] = 0;
            }
        EXPECT_EQ(shade(gbuffer, {.strength = 3.0f}, camera_of(projection, 2.0), 30), gbuffer.colors);
    }
}

// Only what lies behind its neighbours is darkened.
TEST(EdlPass, AStepDarkensItsFoot) {
    SKIP_WITHOUT_EGL();
    GBuffer gbuffer = make_gbuffer(20, 20);
    for (uint32_t y = 0; y < 20; ++y)
        for (uint32_t x = 10; x < 20; ++x) gbuffer.depths[y * 20 + x] = 1.5f;
    const std::vector<Rgba8> shaded = shade(gbuffer, {.radius_px = 2.0f}, camera_of(Projection::orthographic, 2.0), 20);
    EXPECT_EQ(shaded[10 * 20 + 9], gbuffer.colors[0]);
    EXPECT_LT(green_of(shaded[10 * 20 + 10]), 180);
    EXPECT_EQ(shaded[10 * 20 + 13], gbuffer.colors[0]);  // out of reach
}

}  // namespace
}  // namespace strata
