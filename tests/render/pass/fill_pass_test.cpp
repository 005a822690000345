#include "render/pass/fill_pass.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "core/error.h"
#include "core/math/random.h"
#include "render/gl/egl_context.h"
#include "render/pass/fill_kernel.h"

namespace strata {
namespace {

// Noisy samples of a tilted plane with holes, one part higher, before a far wall with holes of its own, and a wire.
GBuffer busy_scene() {
    constexpr int kWidth = 150, kHeight = 110;
    Random random(8);
    GBuffer gbuffer{.width = kWidth, .rows = kHeight};
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const bool open = std::sin(0.5 * x) * std::cos(0.4 * y) > 0.35 || random.uniform() < 0.1;
            float depth = float(20.0 + 0.01 * x + 0.03 * y + 0.01 * random.normal() - (x > 90 && y > 50 ? 6.0 : 0.0));
            if (open) depth = random.uniform() < 0.4 ? 120.0f : kNoDepth;
            if (std::abs(x - 40 - y / 3) < 2) depth = 9.0f;
            const bool drawn = depth != kNoDepth;
            gbuffer.depths.push_back(depth);
            gbuffer.colors.push_back(drawn ? make_rgba(uint8_t(random.bits()), uint8_t(random.bits()), uint8_t(random.bits())) : 0);
            gbuffer.splat_px.push_back(drawn ? uint8_t(3 + random.bits() % 12) : uint8_t(0));
            gbuffer.ids.push_back(drawn ? make_pixel_id(3, uint32_t(y * kWidth + x)) : kNoPixelId);
        }
    return gbuffer;
}

// The shader decides in float32 as the kernel does, but GL may round a division or a root otherwise: one pixel in a thousand
// may lie on a criterion's edge. All others agree to a step of 8 bits and 1e-5 of the depth.
TEST(FillPass, AgreesWithTheKernel) {
    std::unique_ptr<EglContext> context;
    try {
        context = std::make_unique<EglContext>(2);
    } catch (const Error& error) {
        GTEST_SKIP() << "no EGL with OpenGL 4.5 here: " << error.what();
    }
    FillPass pass(*context);
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const bool follow : {false, true}) {
            Camera camera;
            camera.projection = projection;
            camera.height = 11.0;
            const FillSettings settings = {.gap_px = follow ? 16.0f : 7.0f, .follow_splats = follow};
            const GBuffer before = busy_scene();
            GBuffer kernel = before, shader = before;
            fill_holes(kernel, settings, camera, before.rows, 2);
            pass.fill(shader, settings, camera, before.rows);
            size_t changed = 0, undecided = 0;
            for (size_t i = 0; i < before.depths.size(); ++i) {
                changed += kernel.depths[i] != before.depths[i];
                if ((kernel.depths[i] != before.depths[i]) != (shader.depths[i] != before.depths[i])) {
                    ++undecided;
                    continue;
                }
                if (before.depths[i] == shader.depths[i]) {
                    EXPECT_EQ(shader.colors[i], before.colors[i]);
                    continue;
                }
                EXPECT_NEAR(shader.depths[i], kernel.depths[i], 1e-5 * kernel.depths[i]);
                EXPECT_EQ(shader.ids[i], kernel.ids[i]);
                EXPECT_EQ(shader.splat_px[i], kernel.splat_px[i]);
                EXPECT_NEAR(red_of(shader.colors[i]), red_of(kernel.colors[i]), 1);
                EXPECT_NEAR(green_of(shader.colors[i]), green_of(kernel.colors[i]), 1);
                EXPECT_NEAR(blue_of(shader.colors[i]), blue_of(kernel.colors[i]), 1);
                EXPECT_EQ(alpha_of(shader.colors[i]), alpha_of(kernel.colors[i]));
            }
            EXPECT_GT(changed, 300u);
            EXPECT_LE(undecided, before.depths.size() / 1000);
        }
}

}  // namespace
}  // namespace strata
