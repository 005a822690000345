// Gaussian splats.
#include "render/pass/blend_kernel.h"

#include <gtest/gtest.h>

#include <cmath>

#include "render/srgb.h"
#include "tests/support/point_frame.h"

namespace strata {
namespace {

using namespace test;

constexpr Rgba8 kWhite = make_rgba(255, 255, 255), kBlack = make_rgba(0, 0, 0);
constexpr Projection kProjections[] = {Projection::perspective, Projection::orthographic};

SplatStyle gaussian(float size_px) { return {.shape = SplatShape::gaussian, .fixed_px = size_px}; }

// Two splats of 20 pixels at depth 1, at the centers of pixels 95 and 101 of row 50. By hand: pixel 97 is 2 and 4 pixels from them, 0.2 and 0.4
// of their radius; weights e^(-4 * 0.04) and e^(-4 * 0.16), 0.852 and 0.527.
TEST(Blend, TwoSplatsByHand) {
    ResidentNode node = node_of({kMillimeters.offset + Vec3d(-0.045, 1, -0.005), kMillimeters.offset + Vec3d(0.015, 1, -0.005)});
    node.colors = {kWhite, make_rgba(0, 188, 0)};
    for (const Projection projection : kProjections) {
        const GBuffer gbuffer = draw_points({node}, camera_north(projection), gaussian(20));
        for (const uint32_t column : {95u, 97u, 98u, 100u}) {
            const double to_first = (column - 95.0) / 10, to_second = (101.0 - column) / 10;
            const double first = std::exp(-4 * to_first * to_first), second = std::exp(-4 * to_second * to_second);
            const double green = (first + second * linear_from_srgb(188 / 255.0)) / (first + second);
            const Rgba8 color = gbuffer.colors[50 * kFrameWidth + column];
            EXPECT_NEAR(red_of(color), 255 * srgb_from_linear(first / (first + second)), 0.6) << column;  // half a code, and weights to 2^-12
            EXPECT_EQ(red_of(color), blue_of(color));
            EXPECT_NEAR(green_of(color), 255 * srgb_from_linear(green), 0.6);
        }
        EXPECT_EQ(gbuffer.colors[50 * kFrameWidth + 87], kWhite);  // out of the second's reach
    }
}

// Depths and identities are those of the nearest splat, whatever is averaged.
TEST(Blend, DepthAndIdentityAreTheNearestSplats) {
    const std::vector<ResidentNode> nodes = random_nodes();
    for (const Projection projection : kProjections)
        for (const float size : {0.0f, 1.0f, 6.0f}) {
            const GBuffer blended = draw_points(nodes, camera_north(projection), gaussian(size));
            const GBuffer plain = draw_points(nodes, camera_north(projection), {.shape = SplatShape::paraboloid, .fixed_px = size});
            EXPECT_EQ(blended.depths, plain.depths);
            EXPECT_EQ(blended.ids, plain.ids);
            EXPECT_EQ(blended.splat_px, plain.splat_px);
            EXPECT_NE(blended.colors, plain.colors);
        }
}

TEST(Blend, OneColorStaysAsItIs) {
    std::vector<ResidentNode> nodes = random_nodes();
    for (const Rgba8 color : {make_rgba(200, 13, 77), make_rgba(1, 2, 254)}) {
        for (ResidentNode& node : nodes) std::fill(node.colors.begin(), node.colors.end(), color);
        const GBuffer gbuffer = draw_points(nodes, camera_north(Projection::perspective), gaussian(0));
        for (size_t pixel = 0; pixel < gbuffer.colors.size(); ++pixel) ASSERT_EQ(gbuffer.colors[pixel], gbuffer.ids[pixel] == kNoPixelId ? 0 : color);
    }
}

// A million points on one pixel, a quarter of them white: exactly a quarter of the light, with nothing lost.
TEST(Blend, AMillionPointsOnOnePixel) {
    constexpr size_t kPoints = 1'000'000;
    ResidentNode node = node_of({kMillimeters.offset + Vec3d(0.005, 1, 0.005)});
    node.x.assign(kPoints, node.x[0]);
    node.y.assign(kPoints, node.y[0]);
    node.z.assign(kPoints, node.z[0]);
    node.colors.assign(kPoints, kBlack);
    for (size_t i = 0; i < kPoints; i += 4) node.colors[i] = kWhite;
    const GBuffer gbuffer = draw_points({node}, camera_north(Projection::perspective), gaussian(1), 3);
    ASSERT_EQ(drawn(gbuffer), 1u);
    const uint8_t quarter = srgb8_from_linear(0.25f);
    EXPECT_EQ(gbuffer.colors[49 * kFrameWidth + 100], make_rgba(quarter, quarter, quarter));
    EXPECT_EQ(gbuffer.ids[49 * kFrameWidth + 100], make_pixel_id(0, 0));
}

// Two walls, 0.1 of radius, the far one more than twice that behind: what is hidden adds nothing. Nearer than the radius, it does.
TEST(Blend, WhatIsBehindDoesNotShowThrough) {
    Random random(9);
    const auto wall = [&](double depth, Rgba8 color) {
        std::vector<Vec3d> positions;
        for (int i = 0; i < 3000; ++i) positions.push_back(kMillimeters.offset + Vec3d(random.uniform(-2, 2), depth, random.uniform(-1, 1)));
        ResidentNode node = node_of(positions);
        std::fill(node.colors.begin(), node.colors.end(), color);
        for (PointShape& shape : node.shapes) shape.normal = {0, 127, 0};
        return node;
    };
    const ResidentNode front = wall(1.0, kWhite), behind = wall(1.25, kBlack), close = wall(1.01, kBlack);
    for (const Projection projection : kProjections) {
        const GBuffer alone = draw_points({front}, camera_north(projection), gaussian(0));
        ASSERT_EQ(drawn(alone), size_t(kFrameWidth) * kFrameHeight);
        EXPECT_EQ(alone.colors, draw_points({front, behind}, camera_north(projection), gaussian(0)).colors);
        // As many white as black ones: half of the light, give or take what chance makes of the 25 or so that meet on a pixel.
        const GBuffer mixed = draw_points({front, close}, camera_north(projection), gaussian(0));
        double light = 0;
        for (const Rgba8 color : mixed.colors) light += linear_from_srgb(green_of(color) / 255.0) / double(mixed.colors.size());
        EXPECT_NEAR(light, 0.5, 0.05);
    }
}

// A wall of 1:3 points, seen under 75 degrees: the mean is a quarter, by planes as from the front.
TEST(Blend, AWallSeenAslantLosesNothing) {
    Random random(10);
    std::vector<Vec3d> positions;
    for (int i = 0; i < 20000; ++i) {
        const double along = random.uniform(-1, 1);
        positions.push_back(kMillimeters.offset + Vec3d(0.25 * along, 2 + along, random.uniform(-0.6, 0.6)));
    }
    ResidentNode node = node_of(positions);
    for (size_t i = 0; i < positions.size(); ++i) node.colors[i] = random.uniform() < 0.25 ? kWhite : kBlack;
    for (PointShape& shape : node.shapes) shape.normal = {123, -31, 0};
    const GBuffer gbuffer = draw_points({node}, camera_north(Projection::orthographic), gaussian(0));
    double light = 0;
    for (uint32_t row = 10; row < 90; ++row)
        for (uint32_t column = 82; column < 118; ++column) light += linear_from_srgb(red_of(gbuffer.colors[row * kFrameWidth + column]) / 255.0) / (80 * 36);
    EXPECT_NEAR(light, 0.25, 0.02);
}

}  // namespace
}  // namespace strata
