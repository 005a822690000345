#include "render/pass/ssao_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "core/error.h"
#include "core/math/random.h"
#include "render/gl/egl_context.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 151, kHeight = 113;  // odd, so that the last samples stand alone

// A noisy floor with a step, before a wall, with a wire and empty sky; wide splats on one side.
GBuffer busy_scene(uint32_t first_row) {
    Random random(5);
    GBuffer gbuffer{.width = kWidth, .first_row = first_row, .rows = kHeight};
    for (int y = 0; y < int(kHeight); ++y)
        for (int x = 0; x < int(kWidth); ++x) {
            float depth = std::min(float(30.0 - 0.15 * y), 24.0f) + 0.02f * float(random.normal());
            if (x > 90 && y > 60) depth -= 2.0f;
            if (std::abs(x - 40 - y / 3) < 1) depth = 9.0f;
            if (y < 20 && x < 70) depth = kNoDepth;
            const bool drawn = depth != kNoDepth;
            gbuffer.depths.push_back(depth);
            gbuffer.colors.push_back(drawn ? make_rgba(uint8_t(random.bits()), uint8_t(random.bits()), uint8_t(random.bits())) : 0);
            gbuffer.splat_px.push_back(drawn ? uint8_t(x < 75 ? 1 : 12) : uint8_t(0));
        }
    return gbuffer;
}

// GL may round a division or a root otherwise, and its atan is not the kernel's (1e-5 off): a step of visibility in 255, which is at
// most two of a dark color.
TEST(SsaoPass, AgreesWithTheKernel) {
    std::unique_ptr<EglContext> context;
    try {
        context = std::make_unique<EglContext>(2);
    } catch (const Error& error) {
        GTEST_SKIP() << "no EGL with OpenGL 4.5 here: " << error.what();
    }
    SsaoPass pass(*context);
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const uint32_t first_row : {0u, 7u}) {
            Camera camera;
            camera.projection = projection;
            camera.height = 11.0;
            const GBuffer before = busy_scene(first_row);
            GBuffer kernel = before, shader = before;
            const SsaoSettings settings = {.radius = 3.0f};
            SsaoKernel().shade(kernel, settings, camera, kHeight + 20, 2);
            pass.shade(shader, settings, camera, kHeight + 20);
            size_t dimmed = 0, off = 0;
            for (size_t i = 0; i < before.colors.size(); ++i) {
                dimmed += kernel.colors[i] != before.colors[i];
                off += kernel.colors[i] != shader.colors[i];
                EXPECT_NEAR(red_of(shader.colors[i]), red_of(kernel.colors[i]), 2) << i;
                EXPECT_NEAR(green_of(shader.colors[i]), green_of(kernel.colors[i]), 2) << i;
                EXPECT_NEAR(blue_of(shader.colors[i]), blue_of(kernel.colors[i]), 2) << i;
                EXPECT_EQ(alpha_of(shader.colors[i]), alpha_of(kernel.colors[i]));
            }
            EXPECT_GT(dimmed, 3000u);
            EXPECT_LT(off, before.colors.size() / 20);
        }
}

}  // namespace
}  // namespace strata
