#include "render/pass/points_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/math/random.h"
#include "tests/support/point_frame.h"

namespace strata {
namespace {

using namespace test;

constexpr uint32_t kWidth = kFrameWidth, kHeight = kFrameHeight;
constexpr SplatShape kShapes[] = {SplatShape::square, SplatShape::disc, SplatShape::paraboloid, SplatShape::gaussian, SplatShape::surfel};

// By hand: 2 units ahead, a pixel covers 0.02 units; 0.51 to the right is 25.5 pixels from the middle, 0.31 up 15.5.
TEST(PointsPass, AKnownPointLandsOnItsPixel) {
    const std::vector<ResidentNode> nodes = {node_of({kMillimeters.offset + Vec3d(0.51, 2, 0.31)}, kMillimeters)};
    const GBuffer perspective = draw_points(nodes, camera_north(Projection::perspective), {.fixed_px = 1});
    ASSERT_EQ(drawn(perspective), 1u);
    const size_t pixel = (50 - 16) * kWidth + 100 + 25;
    EXPECT_EQ(perspective.ids[pixel], make_pixel_id(0, 0));
    EXPECT_FLOAT_EQ(perspective.depths[pixel], 2.0f);
    EXPECT_EQ(perspective.colors[pixel], make_rgba(1, 0, 0));

    // Parallel: 100 pixels a unit at any depth, so 51 to the right and 31 up; the lower left pixel of the four that meet.
    const GBuffer parallel = draw_points(nodes, camera_north(Projection::orthographic), {.fixed_px = 1});
    ASSERT_EQ(drawn(parallel), 1u);
    const size_t hit = size_t(std::find(parallel.ids.begin(), parallel.ids.end(), make_pixel_id(0, 0)) - parallel.ids.begin());
    EXPECT_NEAR(double(hit % kWidth), 151, 1);  // on the pixels' common corner: rounding decides
    EXPECT_NEAR(double(hit / kWidth), 19, 1);
    EXPECT_NEAR(parallel.depths[hit], 2.0f, 100 * 0x1p-23);  // half a step at most, of the whole range
}

TEST(PointsPass, WhatIsBehindTheEyeIsNotDrawn) {
    const std::vector<ResidentNode> nodes = {node_of({kMillimeters.offset + Vec3d(0, -2, 0), kMillimeters.offset}, kMillimeters)};
    EXPECT_EQ(drawn(draw_points(nodes, camera_north(Projection::perspective), {.fixed_px = 5})), 0u);
}

TEST(PointsPass, TheNearestShowsAndTiesGoToTheLowerRank) {
    const Vec3d p = kMillimeters.offset;
    const std::vector<ResidentNode> nodes = {node_of({p + Vec3d(0.01, 3, 0.01)}, kMillimeters),
                                             node_of({p + Vec3d(0.01, 2, 0.01), p + Vec3d(0.01, 2, 0.01)}, kMillimeters),
                                             node_of({p + Vec3d(0.01, 2, 0.01)}, kMillimeters)};
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        const GBuffer gbuffer = draw_points(nodes, camera_north(projection), {.fixed_px = 3});
        for (const PixelId id : gbuffer.ids)
            if (id != kNoPixelId) EXPECT_TRUE(id == make_pixel_id(1, 0) || id == make_pixel_id(0, 0));
        EXPECT_GT(std::count(gbuffer.ids.begin(), gbuffer.ids.end(), make_pixel_id(1, 0)), 0);
        EXPECT_EQ(std::count(gbuffer.ids.begin(), gbuffer.ids.end(), make_pixel_id(1, 1)), 0);
    }
}

// A square of n pixels covers n x n centers wherever it lies; a disc covers about its area.
TEST(PointsPass, SplatsCoverTheirArea) {
    Random random(3);
    for (const float size : {1.0f, 2.0f, 3.0f, 8.0f}) {
        double squares = 0, discs = 0;
        for (int i = 0; i < 200; ++i) {
            const std::vector<ResidentNode> nodes = {
                node_of({kMillimeters.offset + Vec3d(random.uniform(-0.3, 0.3), 1, random.uniform(-0.3, 0.3))}, kMillimeters)};
            const Camera camera = camera_north(Projection::perspective);
            const size_t square = drawn(draw_points(nodes, camera, {.shape = SplatShape::square, .fixed_px = size}));
            EXPECT_EQ(square, size_t(size * size));
            squares += double(square);
            discs += double(drawn(draw_points(nodes, camera, {.shape = SplatShape::disc, .fixed_px = size})));
        }
        if (size >= 3) EXPECT_NEAR(discs / squares, 3.14159 / 4, 0.03) << size;  // 200 random places
    }
}

// Diameter = factor * spacing * pixels a unit: 2 * 0.1 * 100 at depth 1, half of it at depth 2.
TEST(PointsPass, AdaptiveSizesFollowSpacingAndDepth) {
    for (const double depth : {1.0, 2.0}) {
        const std::vector<ResidentNode> nodes = {node_of({kMillimeters.offset + Vec3d(0, depth, 0)}, kMillimeters)};
        const GBuffer gbuffer = draw_points(nodes, camera_north(Projection::perspective), {.shape = SplatShape::square});
        EXPECT_NEAR(std::sqrt(double(drawn(gbuffer))), 20 / depth, 0.5);
        EXPECT_EQ(*std::max_element(gbuffer.splat_px.begin(), gbuffer.splat_px.end()), uint8_t(20 / depth));
    }
}

// Of two paraboloids at the same depth each shows on its own side of the line between their centers.
TEST(PointsPass, ParaboloidsMeetHalfway) {
    const std::vector<ResidentNode> nodes = {
        node_of({kMillimeters.offset + Vec3d(-0.05, 1, 0), kMillimeters.offset + Vec3d(0.05, 1, 0)}, kMillimeters)};
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        const GBuffer gbuffer = draw_points(nodes, camera_north(projection), {.shape = SplatShape::paraboloid, .fixed_px = 20});
        size_t right = 0;
        for (uint32_t x = 0; x < kWidth; ++x) {
            const PixelId id = gbuffer.ids[50 * kWidth + x];
            if (id == kNoPixelId) continue;
            EXPECT_EQ(uint32_t(id), x < 100 ? 0u : 1u) << x;
            ++right;
        }
        EXPECT_NEAR(double(right), 30, 1);  // 10 pixels apart, 20 wide
    }
}

// A wall that is seen at 60 degrees: 3 points a row, 0.1 apart, whose splats overlap twice over. Each pixel shows the point
// with the nearest center, measured along the wall, and has the wall's depth.
TEST(PointsPass, ParaboloidsLieInTheirPlane) {
    const Vec3d along = Vec3d(0.5, std::sqrt(0.75), 0);  // of the wall
    const Vec3d normal = Vec3d(-along.y(), along.x(), 0);
    std::vector<Vec3d> positions;
    for (int i = -2; i <= 2; ++i)
        for (int j = -2; j <= 2; ++j) positions.push_back(Vec3d(0, 2, 0) + 0.1 * i * along + Vec3d(0, 0, 0.1 * j));
    std::vector<Vec3d> placed;
    for (const Vec3d& p : positions) placed.push_back(kMillimeters.offset + p);
    std::vector<ResidentNode> nodes = {node_of(placed, kMillimeters)};
    const Vec3d scaled = 127 * normal;
    nodes[0].shapes.assign(positions.size(), PointShape{.spacing = 0.15f, .normal = {int8_t(std::lround(scaled.x())), int8_t(std::lround(scaled.y())), 0}});
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        const GBuffer gbuffer = draw_points(nodes, camera_north(projection), {});
        size_t seen = 0, wrong = 0;
        for (uint32_t y = 0; y < kHeight; ++y)
            for (uint32_t x = 0; x < kWidth; ++x) {
                const PixelId id = gbuffer.ids[y * kWidth + x];
                if (id == kNoPixelId) continue;
                const double u = (x + 0.5 - 100) / 100, v = -(y + 0.5 - 50) / 100;
                // Where the pixel's ray meets the wall.
                const bool perspective = projection == Projection::perspective;
                const Vec3d ray = perspective ? Vec3d(u, 1, v) : Vec3d(0, 1, 0), from = perspective ? Vec3d(0, 0, 0) : Vec3d(u, 0, v);
                const double depth = normal.dot(Vec3d(0, 2, 0) - from) / normal.dot(ray);
                const Vec3d hit = from + depth * ray;
                if (std::abs((hit - Vec3d(0, 2, 0)).dot(along)) > 0.25 || std::abs(hit.z()) > 0.25) continue;
                ++seen;
                EXPECT_NEAR(gbuffer.depths[y * kWidth + x], depth, 0.005);  // half a degree of a byte's normal over 0.3 units, and a quantum
                double nearest = 1e9;
                for (const Vec3d& p : positions) nearest = std::min(nearest, (p - hit).norm());
                wrong += (positions[uint32_t(id)] - hit).norm() > nearest + 0.005;
            }
        EXPECT_GT(seen, 250u);
        EXPECT_LT(double(wrong), 0.03 * double(seen));  // in perspective, falling back is measured along the ray
    }
}

// Neither threads nor strips.
TEST(PointsPass, ThreadsDoNotShow) {
    const std::vector<ResidentNode> nodes = random_nodes(kMillimeters);
    for (const SplatShape shape : kShapes) {
        const SplatStyle style = {.shape = shape, .fixed_px = shape == SplatShape::square ? 1.0f : 0.0f};
        const GBuffer one = draw_points(nodes, camera_north(Projection::perspective), style, 1);
        EXPECT_TRUE(equal(one, draw_points(nodes, camera_north(Projection::perspective), style, 2)));
        EXPECT_TRUE(equal(one, draw_points(nodes, camera_north(Projection::perspective), style, 7)));
        EXPECT_TRUE(equal(one, draw_points(nodes, camera_north(Projection::perspective), style, 3, kMillimeters, best_simd_level(), 7)));
    }
}

// Every shape and both projections, through each compiled kernel; sizes from one pixel to many.
TEST(PointsPass, InstructionSetsDoNotShow) {
    std::vector<ResidentNode> nodes = random_nodes(kMillimeters);
    nodes.resize(1);
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const SplatShape shape : kShapes)
            for (const float fixed_px : {0.0f, 1.0f, 2.6f, 4.0f, 30.0f}) {
                const SplatStyle style = {.shape = shape, .fixed_px = fixed_px};
                Camera camera = camera_north(projection);
                camera.height = 4;
                const GBuffer plain = draw_points(nodes, camera, style, 1, kMillimeters, SimdLevel::baseline);
                EXPECT_GT(drawn(plain), 1000u);
                for (const SimdLevel level : simd_levels())
                    EXPECT_TRUE(equal(plain, draw_points(nodes, camera, style, 2, kMillimeters, level))) << name_of(level) << ' ' << fixed_px;
            }
}

// A second picture in the same memory, of another size, shows nothing of the first.
TEST(PointsPass, ClearForgets) {
    const std::vector<ResidentNode> nodes = random_nodes(kMillimeters);
    std::vector<PointNode> list = {{.points = &nodes[0], .first_rank = 0, .top_row = 0, .bottom_row = kHeight}};
    PointsPass pass;
    pass.clear(kWidth, 0, kHeight, 2);
    pass.draw(list, PointProjection(camera_north(Projection::perspective), kMillimeters, kWidth, kHeight), {}, 2);
    const PointProjection small(camera_north(Projection::perspective), kMillimeters, 50, 40);
    for (const auto& [first_row, rows] : {std::pair(0u, 40u), {10u, 7u}}) {
        pass.clear(50, first_row, rows, 2);
        GBuffer out;
        pass.resolve(list, small, {}, {.splat_px = true, .ids = true}, 2, out);
        EXPECT_EQ(out.colors, std::vector<Rgba8>(50 * rows, 0));
        EXPECT_EQ(out.splat_px, std::vector<uint8_t>(50 * rows, 0));
        EXPECT_EQ(drawn(out), 0u);
    }
}

// Cloud and eye move by 2^20 m; quanta and eye are dyadic, so nothing is rounded on the way and no bit may differ.
TEST(PointsPass, ADyadicTranslationDoesNotShow) {
    const Quantization here = {.scale = Vec3d::Constant(0x1p-10), .offset = Vec3d(1 << 19, 1 << 21, 128)};
    const Quantization there = {.scale = here.scale, .offset = here.offset + Vec3d::Constant(0x1p20)};
    const std::vector<ResidentNode> nodes = random_nodes(here);
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        Camera camera = camera_north(projection);
        camera.eye = here.offset + Vec3d(0.25, -0x1p-10, 0x3p-10);
        camera.height = 4;
        const GBuffer first = draw_points(nodes, camera, {}, 2, here);
        camera.eye += Vec3d::Constant(0x1p20);
        EXPECT_TRUE(equal(first, draw_points(nodes, camera, {}, 2, there)));
        EXPECT_GT(drawn(first), 10000u);
    }
}

// An eye beyond the reach of 32-bit quanta takes the wide path, which must agree with the narrow one: the same scene in
// quanta 256 times as large lies within reach again.
TEST(PointsPass, AFarEyeSeesTheSame) {
    const Quantization fine = {.scale = Vec3d::Constant(0x1p-20), .offset = Vec3d::Zero()};
    const Quantization coarse = {.scale = Vec3d::Constant(0x1p-12), .offset = Vec3d::Zero()};
    Random random(5);
    std::vector<Vec3d> positions;
    for (int i = 0; i < 5000; ++i)
        positions.emplace_back(std::floor(random.uniform(-800, 800)) * 0x1p-3, std::floor(random.uniform(-800, 800)) * 0x1p-3, 0);
    Camera camera = camera_north(Projection::perspective);
    camera.eye = {0, -16384, 4096};  // 2^34 fine quanta away
    camera.view_from_world = look_along(-camera.eye, {0, 0, 1});
    camera.fov_rad = 0.01;
    const std::vector<ResidentNode> narrow = {node_of(positions, coarse)}, wide = {node_of(positions, fine)};
    const GBuffer first = draw_points(narrow, camera, {.fixed_px = 2}, 1, coarse);
    EXPECT_TRUE(equal(first, draw_points(wide, camera, {.fixed_px = 2}, 1, fine)));
    EXPECT_GT(drawn(first), 1000u);
}

}  // namespace
}  // namespace strata
