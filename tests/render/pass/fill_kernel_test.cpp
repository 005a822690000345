#include "render/pass/fill_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/math/random.h"
#include "render/reference/fill_reference.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr int kWidth = 240, kHeight = 180;
constexpr int kBorder = 40;  // beyond the reach of any ray

Camera camera_of(Projection projection) {
    Camera camera;
    camera.projection = projection;
    camera.height = 18.0;  // 0.1 a pixel
    return camera;
}

// Depth of a pixel, kNoDepth where there is nothing.
using DepthAt = std::function<float(int x, int y)>;

GBuffer make_gbuffer(uint8_t splat_px, const DepthAt& depth_at) {
    GBuffer gbuffer{.width = kWidth, .rows = kHeight};
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const float depth = depth_at(x, y);
            const bool empty = depth == kNoDepth;
            gbuffer.depths.push_back(depth);
            gbuffer.colors.push_back(empty ? 0 : make_rgba(90, 160, uint8_t(x)));
            gbuffer.splat_px.push_back(empty ? uint8_t(0) : splat_px);
            gbuffer.ids.push_back(empty ? kNoPixelId : make_pixel_id(7, uint32_t(y * kWidth + x)));
        }
    return gbuffer;
}

// A plane that is tilted both ways: nearness is linear across a picture.
DepthAt tilted_plane(Projection projection) {
    return [projection](int x, int y) {
        const double across = (x - 120) * 1e-3, down = (y - 90) * 2e-3;
        return projection == Projection::perspective ? float(20.0 / (1.0 + across + down)) : float(20.0 - 40.0 * across - 40.0 * down);
    };
}

GBuffer filled(GBuffer gbuffer, const FillSettings& settings, Projection projection, int threads = 2) {
    fill_holes(gbuffer, settings, camera_of(projection), kHeight, threads);
    return gbuffer;
}

size_t holes(const GBuffer& gbuffer, int border = 0) {
    size_t count = 0;
    for (int y = border; y < kHeight - border; ++y)
        for (int x = border; x < kWidth - border; ++x) count += gbuffer.depths[size_t(y * kWidth + x)] == kNoDepth;
    return count;
}

// What random discs of that diameter cover, with a mean overlap of lambda.
std::vector<bool> random_discs(double diameter, double lambda, uint64_t seed) {
    Random random(seed);
    std::vector<bool> covered(size_t(kWidth) * kHeight, false);
    const double radius = 0.5 * diameter, area = (kWidth + diameter) * (kHeight + diameter);
    const int discs = int(lambda * area / (std::numbers::pi * radius * radius));
    for (int i = 0; i < discs; ++i) {
        const double cx = random.uniform(-radius, kWidth + radius), cy = random.uniform(-radius, kHeight + radius);
        for (int y = std::max(0, int(cy - radius)); y < std::min<double>(kHeight, cy + radius); ++y)
            for (int x = std::max(0, int(cx - radius)); x < std::min<double>(kWidth, cx + radius); ++x)
                if (std::hypot(x + 0.5 - cx, y + 0.5 - cy) < radius) covered[size_t(y * kWidth + x)] = true;
    }
    return covered;
}

// Random discs of mean overlap lambda leave e^-lambda uncovered. After filling nothing is, but for the odd hole wider than a
// disc where few overlap, and depths lie on the plane: it is linear in what is fitted, so float32's rounding remains.
TEST(FillKernel, ARandomlySampledPlaneCloses) {
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const double lambda : {2.0, 3.0}) {
            const DepthAt plane = tilted_plane(projection);
            const std::vector<bool> covered = random_discs(8.0, lambda, 11);
            const GBuffer sampled =
                make_gbuffer(8, [&](int x, int y) { return covered[size_t(y * kWidth + x)] ? plane(x, y) : kNoDepth; });
            EXPECT_NEAR(double(holes(sampled)) / (kWidth * kHeight), std::exp(-lambda), 0.012);
            ASSERT_GT(holes(sampled, kBorder), 500u);
            const GBuffer closed = filled(sampled, {.gap_px = 16.0f}, projection);
            EXPECT_LE(holes(closed, kBorder), lambda < 3.0 ? holes(sampled, kBorder) / 25 : 0u);
            for (int y = kBorder; y < kHeight - kBorder; ++y)
                for (int x = kBorder; x < kWidth - kBorder; ++x)
                    if (const float depth = closed.depths[size_t(y * kWidth + x)]; depth != kNoDepth)
                        EXPECT_NEAR(depth, plane(x, y), 20.0 * 0x1p-20);
        }
}

// What shows through the holes is closed too when it lies far behind, and nothing else changes.
TEST(FillKernel, AFarWallBehindTheHolesIsNoObstacle) {
    const std::vector<bool> covered = random_discs(8.0, 3.0, 5);
    const DepthAt plane = tilted_plane(Projection::perspective);
    const auto is_far = [](int x, int y) { return (x / 3 + y / 2) % 2 == 0; };  // the far wall has holes of its own
    const GBuffer sampled = make_gbuffer(
        8, [&](int x, int y) { return covered[size_t(y * kWidth + x)] ? plane(x, y) : is_far(x, y) ? 90.0f : kNoDepth; });
    const GBuffer closed = filled(sampled, {.gap_px = 16.0f}, Projection::perspective);
    for (int y = kBorder; y < kHeight - kBorder; ++y)
        for (int x = kBorder; x < kWidth - kBorder; ++x) {
            const size_t i = size_t(y * kWidth + x);
            EXPECT_NEAR(closed.depths[i], plane(x, y), 20.0 * 0x1p-20);
            if (covered[i]) EXPECT_EQ(closed.colors[i], sampled.colors[i]);
        }
}

// A wire before a wall with holes of its own: the holes close, the wire is as wide as before, to the pixel.
TEST(FillKernel, AWireKeepsItsWidth) {
    const std::vector<bool> covered = random_discs(6.0, 2.5, 3);
    for (const double angle : {0.0, 0.3, 0.7854, 1.2, 1.5708})
        for (const double width : {1.0, 2.0, 3.0, 5.0})
            for (const bool two : {false, true}) {
                const auto on_wire = [&](int x, int y) {
                    const double off = (x - 120) * std::sin(angle) - (y - 90) * std::cos(angle);
                    return std::abs(off) < 0.5 * width || (two && std::abs(off - 24.0) < 0.5 * width);
                };
                const GBuffer before = make_gbuffer(6, [&](int x, int y) {
                    return on_wire(x, y) ? 5.0f : covered[size_t(y * kWidth + x)] ? 50.0f : kNoDepth;
                });
                const GBuffer after = filled(before, {.gap_px = 12.0f}, Projection::perspective);
                EXPECT_LT(holes(after, kBorder), holes(before, kBorder) / 2);
                for (size_t i = 0; i < before.depths.size(); ++i)
                    EXPECT_EQ(after.depths[i] < 10.0f, before.depths[i] < 10.0f) << angle << ' ' << width << ' ' << i;
            }
}

// Edges at any angle, round shapes, and right angles that stick out or go in: what is nothing stays nothing.
TEST(FillKernel, SilhouettesStay) {
    for (const bool before_a_wall : {false, true})
        for (int degrees = 0; degrees < 180; degrees += 5) {
            const double c = std::cos(degrees * std::numbers::pi / 180), s = std::sin(degrees * std::numbers::pi / 180);
            const std::function<bool(double, double)> shapes[] = {
                [&](double x, double y) { return c * x + s * y < 0; },
                [&](double x, double y) { return std::hypot(x, y) < 5.0 + degrees / 5.0; },
                [&](double x, double y) { return c * x + s * y < 0 && c * y - s * x < 0; },
                [&](double x, double y) { return c * x + s * y < 0 || c * y - s * x < 0; },
            };
            for (const auto& inside : shapes) {
                const GBuffer before = make_gbuffer(10, [&](int x, int y) {
                    return inside(x - 119.7, y - 90.2) ? 8.0f : before_a_wall ? 60.0f : kNoDepth;
                });
                const GBuffer after = filled(before, {.gap_px = 16.0f, .follow_splats = false}, Projection::perspective);
                EXPECT_EQ(after.depths, before.depths) << degrees << ' ' << (&inside - shapes) << ' ' << before_a_wall;
                EXPECT_EQ(after.colors, before.colors);
            }
        }
}

// Openings, a slot and a square: filled where they are no wider than asked for. Wider ones stay, but for corners and ends
// where they are less than 2.5 times as wide.
TEST(FillKernel, OpeningsWiderThanTheReachStay) {
    for (const int opening : {1, 4, 8, 9, 12, 15, 20, 30})
        for (const bool slot : {false, true}) {
            const auto is_open = [&](int x, int y) {
                return x >= 100 && x < 100 + opening && (slot ? y > 20 && y < 160 : y >= 80 && y < 80 + opening);
            };
            const GBuffer before = make_gbuffer(8, [&](int x, int y) { return is_open(x, y) ? kNoDepth : 10.0f; });
            for (const bool follow : {false, true}) {  // asked for 8 pixels, or by splats of 8
                const GBuffer after =
                    filled(before, {.gap_px = follow ? 16.0f : 8.0f, .follow_splats = follow}, Projection::orthographic);
                if (opening <= 8)
                    EXPECT_EQ(holes(after), 0u) << opening << slot;
                else if (!slot && opening >= 20)
                    EXPECT_EQ(after.depths, before.depths) << opening;
                else
                    for (int y = slot ? 60 : 80 + opening / 2; y < (slot ? 120 : 81 + opening / 2); ++y)
                        for (int x = 100; x < 100 + opening; ++x)
                            if (slot || x == 100 + opening / 2) EXPECT_EQ(after.depths[size_t(y * kWidth + x)], kNoDepth) << opening << slot;
            }
        }
}

// A ditch is seen as it is, however wide the gaps that are closed: it is no hole.
TEST(FillKernel, SmoothReliefStays) {
    const GBuffer before = make_gbuffer(4, [&](int x, int y) { return 20.0f + 0.6f * std::abs(float(x % 40 - 20)) * 0.1f + 0.01f * float(y); });
    const GBuffer after = filled(before, {.gap_px = 16.0f, .follow_splats = false}, Projection::orthographic);
    EXPECT_EQ(after.depths, before.depths);
}

// Colors are averaged in linear light; the identity is that of the nearest pixel that takes part.
TEST(FillKernel, ColorsAreMeansAndIdsAreNeighbors) {
    GBuffer before = make_gbuffer(4, [&](int x, int y) { return x == 120 && y == 90 ? kNoDepth : 10.0f; });
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x)
            if (x != 120 || y != 90) before.colors[size_t(y * kWidth + x)] = x < 120 ? make_rgba(0, 0, 0) : x > 120 ? make_rgba(255, 0, 0) : make_rgba(0, 0, 255);
    const GBuffer after = filled(before, {.gap_px = 16.0f}, Projection::perspective);
    const size_t hole = 90 * kWidth + 120;
    // By hand: weights 1/d^2 are 1 for 4, 1/2 for 4 and 1/5 for 8 neighbors, 7.6 in all; those above and below are blue, 2 of
    // them, and half of the rest are red.
    EXPECT_EQ(red_of(after.colors[hole]), srgb8_from_linear(float(2.8 / 7.6)));
    EXPECT_EQ(blue_of(after.colors[hole]), srgb8_from_linear(float(2.0 / 7.6)));
    EXPECT_EQ(alpha_of(after.colors[hole]), 255);
    EXPECT_EQ(after.ids[hole], make_pixel_id(7, 90 * kWidth + 121));  // of the four at distance 1, the first looked at
    EXPECT_EQ(after.splat_px[hole], 4);
    EXPECT_EQ(after.depths[hole], 10.0f);
}

GBuffer busy_scene(uint64_t seed) {
    Random random(seed);
    const std::vector<bool> covered = random_discs(7.0, 1.5, seed);
    GBuffer gbuffer = make_gbuffer(7, [&](int x, int y) {
        const float noise = float(0.02 * random.normal());
        if (std::abs(x - 60 - y / 3) < 2) return 9.0f;
        if (covered[size_t(y * kWidth + x)]) return tilted_plane(Projection::perspective)(x, y) + noise + (x > 150 && y > 100 ? 8.0f : 0.0f);
        return random.uniform() < 0.4 ? 120.0f + noise : kNoDepth;
    });
    for (size_t i = 0; i < gbuffer.colors.size(); ++i) {
        if (gbuffer.depths[i] == kNoDepth) continue;
        gbuffer.colors[i] = make_rgba(uint8_t(random.bits()), uint8_t(random.bits()), uint8_t(random.bits()));
        gbuffer.splat_px[i] = uint8_t(3 + random.bits() % 12);
    }
    return gbuffer;
}

// The pass looks closer only at pixels that may be holes, and computes in float32: it must decide as the twin does, which
// looks at all of them in double precision, but for the rare pixel that lies on a criterion's very edge.
TEST(FillKernel, AgreesWithTheDoublePrecisionTwin) {
    for (const bool follow : {false, true})
        for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
            const GBuffer before = busy_scene(21);
            const FillSettings settings = {.gap_px = follow ? 16.0f : 7.0f, .follow_splats = follow};
            const GBuffer after = filled(before, settings, projection);
            size_t changed = 0, undecided = 0;
            for (int y = 0; y < kHeight; ++y)
                for (int x = 0; x < kWidth; ++x) {
                    const size_t i = size_t(y * kWidth + x);
                    const auto truth = fill_reference(before, settings, camera_of(projection), kHeight, x, y);
                    changed += truth.has_value();
                    if (truth.has_value() != (after.depths[i] != before.depths[i])) {
                        ++undecided;
                        continue;
                    }
                    if (!truth) continue;
                    EXPECT_NEAR(after.depths[i], truth->depth, 1e-5 * truth->depth);
                    EXPECT_EQ(after.ids[i], truth->id);
                    EXPECT_EQ(after.splat_px[i], truth->splat_px);
                    EXPECT_NEAR(red_of(after.colors[i]), 255.0 * srgb_from_linear(truth->linear_color[0]), 0.51);
                    EXPECT_NEAR(green_of(after.colors[i]), 255.0 * srgb_from_linear(truth->linear_color[1]), 0.51);
                    EXPECT_NEAR(blue_of(after.colors[i]), 255.0 * srgb_from_linear(truth->linear_color[2]), 0.51);
                }
            EXPECT_GT(changed, 1000u);
            EXPECT_LE(undecided, 3u);
        }
}

TEST(FillKernel, ThreadsAndInstructionsDoNotShow) {
    const GBuffer before = busy_scene(4);
    const FillSettings settings = {.gap_px = 16.0f};
    const GBuffer one = filled(before, settings, Projection::perspective, 1);
    EXPECT_NE(one.depths, before.depths);
    for (const SimdLevel level : simd_levels()) {
        GBuffer other = before;
        fill_holes(other, settings, camera_of(Projection::perspective), kHeight, 7, level);
        EXPECT_EQ(one.depths, other.depths) << name_of(level);
        EXPECT_EQ(one.colors, other.colors) << name_of(level);
        EXPECT_EQ(one.ids, other.ids) << name_of(level);
    }
}

}  // namespace
}  // namespace strata
