#include "render/pass/ssao_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/math/random.h"
#include "render/reference/ssao_reference.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr int kWidth = 480, kHeight = 360;

Camera camera_of(Projection projection) {
    Camera camera;
    camera.projection = projection;
    camera.height = 36.0;  // 0.1 a pixel
    camera.fov_rad = 0.8;
    return camera;
}

using DepthAt = std::function<double(double x, double y)>;  // of a place in the picture, in pixels from its middle

GBuffer make_gbuffer(const DepthAt& depth_at, uint8_t splat_px = 1) {
    GBuffer gbuffer{.width = kWidth, .rows = kHeight};
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) {
            const double depth = depth_at(x + 0.5 - kWidth / 2, y + 0.5 - kHeight / 2);
            gbuffer.depths.push_back(float(depth));
            gbuffer.colors.push_back(std::isinf(depth) ? 0 : make_rgba(255, 255, 255));
            gbuffer.splat_px.push_back(std::isinf(depth) ? uint8_t(0) : splat_px);
        }
    return gbuffer;
}

// What white turns into, as visibility, in 256 steps.
std::vector<double> visibility(GBuffer gbuffer, double radius, Projection projection) {
    SsaoKernel pass;
    pass.shade(gbuffer, {.radius = float(radius)}, camera_of(projection), kHeight, 2);
    std::vector<double> seen;
    for (const Rgba8 color : gbuffer.colors) seen.push_back(linear_from_srgb(red_of(color) / 255.0));
    return seen;
}

double at(const std::vector<double>& seen, int x, int y) { return seen[size_t(y) * kWidth + size_t(x)]; }

double reference(const GBuffer& gbuffer, double radius, Projection projection, int x, int y) {
    return visibility_reference(gbuffer, camera_of(projection), kHeight, radius, x, y, 48);
}

// Open planes of any tilt keep their color exactly, up to the picture's borders and beside nothing.
TEST(SsaoKernel, OpenPlanesKeepTheirColor) {
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const double across : {0.0, -2.0})
            for (const double down : {-0.9, 4.0}) {
                const GBuffer gbuffer = make_gbuffer([&](double x, double y) {
                    if (std::hypot(x - 100, y + 60) < 40 || y < -150) return double(kNoDepth);
                    // In perspective by nearness, which is linear across the picture: across and down are slopes in its middle.
                    const double unit = 2.0 * std::tan(0.4) / kHeight, slope = across * x + down * y;
                    return projection == Projection::perspective ? 50.0 / std::max(1.0 + 0.1 * unit * slope, 0.05) : 50.0 - 0.1 * slope;
                });
                for (const double radius : {0.5, 30.0}) {
                    const std::vector<double> seen = visibility(gbuffer, radius, projection);
                    for (size_t i = 0; i < seen.size(); ++i)
                        if (gbuffer.depths[i] != kNoDepth) ASSERT_EQ(seen[i], 1.0) << across << ' ' << down << ' ' << radius << ' ' << i;
                }
            }
}

// A floor seen from above beside a long wall of height h: V = (1 + x / sqrt(x^2 + h^2)) / 2 at the distance x.
double beside_wall(double distance, double height) { return 0.5 * (1.0 + distance / std::hypot(distance, height)); }

GBuffer floor_and_wall(double height, double angle) {
    return make_gbuffer([=](double x, double y) { return 50.0 - (x * std::cos(angle) + y * std::sin(angle) > 0.0 ? height : 0.0); });
}

TEST(SsaoReference, AgreesWithClosedForms) {
    const GBuffer wall = floor_and_wall(1.0, 0.0);
    for (const int px : {4, 10, 30})
        EXPECT_NEAR(reference(wall, 1e3, Projection::orthographic, 240 - px, 180), beside_wall(0.1 * px, 1.0), 0.012) << px;

    // Half a sphere of radius R on the floor, seen from above, H = d / R: V = 1 - (atan(1 / sqrt(H^2 - 1)) - sqrt(H^2 - 1) / H^2) / pi,
    // the sphere's form factor with its center on the horizon (J. Snyder, "Area light sources for real-time graphics", 1996).
    const GBuffer dome = make_gbuffer([](double x, double y) { return 50.0 - std::sqrt(std::max(9.0 - 0.01 * (x * x + y * y), 0.0)); });
    for (const double distance : {3.5, 5.0, 8.0}) {
        const double root = std::sqrt(distance * distance / 9.0 - 1.0);
        const double truth = 1.0 - (std::atan(1.0 / root) - root * 9.0 / (distance * distance)) / std::numbers::pi;
        EXPECT_NEAR(reference(dome, 1e3, Projection::orthographic, 240 + int(10 * distance), 180), truth, 0.01) << distance;
    }

    // A whole sphere in the air, V = 1 - (R / d)^2 cos(angle from the normal): from above what it hides counts as solid, so
    // it can only darken more than it should.
    const GBuffer ball = make_gbuffer([](double x, double y) {
        const double square = 4.0 - 0.01 * (x * x + y * y);
        return square > 0.0 ? 46.0 - std::sqrt(square) : 50.0;
    });
    for (const double aside : {3.0, 6.0}) {
        const double d = std::hypot(aside, 4.0);
        const double truth = 1.0 - 4.0 / (d * d) * 4.0 / d;
        const double seen = reference(ball, 1e3, Projection::orthographic, 240 + int(10 * aside), 180);
        EXPECT_LT(seen, truth + 0.01);
        EXPECT_GT(seen, truth - 0.35);
    }
}

// The pass against the closed form: 4 directions in 4 turns, and distances half as long again from one to the next, come
// within 0.044.
TEST(SsaoKernel, AFloorBesideAWall) {
    double worst = 0.0;
    for (const double angle : {0.0, 0.5, 1.1, 1.5708, 2.5})
        for (const double height : {0.5, 1.0, 2.0}) {
            const std::vector<double> seen = visibility(floor_and_wall(height, angle), 1e3, Projection::orthographic);
            for (const double distance : {0.6, 1.0, 2.0, 4.0}) {
                const int x = int(240 - 10 * distance * std::cos(angle)), y = int(180 - 10 * distance * std::sin(angle));
                const double exact = -0.1 * ((x - 239.5) * std::cos(angle) + (y - 179.5) * std::sin(angle));
                worst = std::max(worst, std::abs(at(seen, x, y) - beside_wall(exact, height)));
            }
        }
    EXPECT_LT(worst, 0.05);
}

// Boxes, a slope, round hills and a pole, in both projections: differences to the twin. They are 0.008 and 0.004 in the mean; the
// largest are on edges, which half the resolution cannot tell apart.
TEST(SsaoKernel, AgreesWithTheDoublePrecisionTwin) {
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        const GBuffer gbuffer = make_gbuffer([&](double x, double y) {
            const double ground = 50.0 - 0.02 * y - 1.5 * std::sin(x / 37.0) * std::cos(y / 45.0);
            if (x > 60 && x < 140 && y > -100 && y < -20) return 46.0;
            if (x > -150 && x < -60 && y > 20 && y < 90) return 47.0 - 0.03 * x;
            return ground;
        });
        const std::vector<double> seen = visibility(gbuffer, 4.0, projection);
        std::vector<double> differences;
        double sum = 0.0;
        for (int y = 40; y < kHeight - 40; y += 7)
            for (int x = 40; x < kWidth - 40; x += 5) {
                differences.push_back(std::abs(at(seen, x, y) - reference(gbuffer, 4.0, projection, x, y)));
                sum += differences.back();
            }
        std::sort(differences.begin(), differences.end());
        EXPECT_LT(sum / double(differences.size()), 0.01);
        EXPECT_LT(differences[differences.size() * 99 / 100], 0.15);
    }
}

// What lies farther away than the radius, such as a wire before a wall, darkens nothing.
TEST(SsaoKernel, OnlyWhatIsNearOccludes) {
    const GBuffer wire = make_gbuffer([](double x, double) { return std::abs(x) < 2.0 ? 20.0 : 50.0; });
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        const std::vector<double> seen = visibility(wire, 5.0, projection);
        for (const double v : seen) ASSERT_EQ(v, 1.0);
    }
}

// Splats that bulge, at random places on a plane: neither dark nor noisy.
TEST(SsaoKernel, TheReliefOfSplatsDoesNotShow) {
    Random random(5);
    const double diameter = 12.0;
    GBuffer gbuffer = make_gbuffer([](double, double) { return 60.0; }, uint8_t(diameter));
    for (int i = 0; i < 9000; ++i) {
        const double cx = random.uniform(0, kWidth), cy = random.uniform(0, kHeight);
        for (int y = std::max(0, int(cy - 6)); y < std::min<double>(kHeight, cy + 6); ++y)
            for (int x = std::max(0, int(cx - 6)); x < std::min<double>(kWidth, cx + 6); ++x) {
                const double square = ((x + 0.5 - cx) * (x + 0.5 - cx) + (y + 0.5 - cy) * (y + 0.5 - cy)) / 36.0;
                float& depth = gbuffer.depths[size_t(y) * kWidth + size_t(x)];
                if (square < 1.0) depth = std::min(depth, float(50.0 + 0.6 * square));  // a pixel is 0.1
            }
    }
    const std::vector<double> seen = visibility(gbuffer, 5.0, Projection::orthographic);
    double sum = 0.0, squares = 0.0;
    int count = 0;
    for (int y = 20; y < kHeight - 20; ++y)
        for (int x = 20; x < kWidth - 20; ++x) {
            sum += at(seen, x, y);
            squares += at(seen, x, y) * at(seen, x, y);
            ++count;
        }
    const double mean = sum / count;
    EXPECT_GT(mean, 0.97);
    EXPECT_LT(std::sqrt(squares / count - mean * mean), 0.02);
}

TEST(SsaoKernel, ThreadsAndInstructionsDoNotShow) {
    const GBuffer gbuffer = floor_and_wall(1.5, 0.4);
    GBuffer one = gbuffer;
    SsaoKernel().shade(one, {.radius = 5.0f}, camera_of(Projection::perspective), kHeight, 1);
    EXPECT_NE(one.colors, gbuffer.colors);
    for (const SimdLevel level : simd_levels()) {
        GBuffer other = gbuffer;
        SsaoKernel().shade(other, {.radius = 5.0f}, camera_of(Projection::perspective), kHeight, 7, level);
        EXPECT_EQ(one.colors, other.colors) << name_of(level);
    }
}

}  // namespace
}  // namespace strata
