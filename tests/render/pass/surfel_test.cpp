// Surfels against rays and planes in double precision.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/math/random.h"
#include "tests/support/point_frame.h"

namespace strata {
namespace {

using namespace test;

constexpr double kUnit = 100.0;  // pixels a unit at depth 1, or in ortho

Vec3d vector_of(const PackedNormal& n) { return {double(n[0]), double(n[1]), double(n[2])}; }

struct Ray {
    Vec3d from, direction;  // from camera_north's eye; the depth grows as the parameter
};
Ray ray_of(Projection projection, uint32_t column, uint32_t row) {
    const double x = (column + 0.5 - 0.5 * kFrameWidth) / kUnit, z = -(row + 0.5 - 0.5 * kFrameHeight) / kUnit;
    return projection == Projection::perspective ? Ray{Vec3d::Zero(), {x, 1, z}} : Ray{{x, 0, z}, Vec3d::UnitY()};
}

ResidentNode surfel_at(const Vec3d& from_eye, const PackedNormal& normal) {
    ResidentNode node = node_of({kMillimeters.offset + from_eye});
    node.normals = {normal};
    return node;
}

// 3 4 5 triangles and such, whose bytes are exact: a disc of radius r tilted by phi covers pi r^2 cos phi pixels.
TEST(Surfel, ATiltedDiscCoversItsEllipse) {
    constexpr float kRadius = 30.0f;  // pixels
    constexpr struct {
        PackedNormal normal;
        double cosine;
    } kTilts[] = {{{0, -127, 0}, 1.0}, {{93, -124, 0}, 0.8}, {{0, 72, 96}, 0.6}, {{-120, 35, 0}, 0.28}};
    for (const auto& [normal, cosine] : kTilts) {
        const GBuffer gbuffer = draw_points({surfel_at({0.003, 2, -0.004}, normal)}, camera_north(Projection::orthographic),
                                            {.shape = SplatShape::surfel, .fixed_px = 2 * kRadius});
        const double area = std::numbers::pi * kRadius * kRadius * cosine;
        EXPECT_NEAR(double(drawn(gbuffer)), area, 0.02 * area) << cosine;
    }
}

// Near and far, askew, beside the middle of the picture, with radii up to a seventh of the distance: a pixel is covered where its ray meets the
// disc, and nowhere else but at the disc's own pixel, and has the plane's depth.
TEST(Surfel, OutlineAndDepthAreThoseOfRaysThroughTheDisc) {
    Random random(5);
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (int i = 0; i < 300; ++i) {
            const Vec3d center(0.001 * int(random.uniform(-700, 700)), 0.001 * int(random.uniform(900, 2000)), 0.001 * int(random.uniform(-300, 300)));
            const PackedNormal normal = {int8_t(int(random.bits() % 255) - 127), int8_t(int(random.bits() % 255) - 127), 127};
            const float size = float(random.uniform(2, 30));
            const GBuffer gbuffer = draw_points({surfel_at(center, normal)}, camera_north(projection), {.shape = SplatShape::surfel, .fixed_px = size});
            const bool perspective = projection == Projection::perspective;
            const double radius = 0.5 * size / kUnit * (perspective ? center.y() : 1.0);
            const double own_x = 100 + center.x() * kUnit / (perspective ? center.y() : 1.0), own_y = 50 - center.z() * kUnit / (perspective ? center.y() : 1.0);
            const Vec3d n = vector_of(normal);
            for (uint32_t row = 0; row < kFrameHeight; ++row)
                for (uint32_t column = 0; column < kFrameWidth; ++column) {
                    const Ray ray = ray_of(projection, column, row);
                    const double depth = n.dot(center - ray.from) / n.dot(ray.direction);
                    const double off = (ray.from + depth * ray.direction - center).norm() / radius;
                    const bool covered = gbuffer.ids[row * kFrameWidth + column] != kNoPixelId;
                    const bool near_own = std::abs(column + 0.5 - own_x) < 0.51 && std::abs(row + 0.5 - own_y) < 0.51;
                    if (depth > 0 && off < 0.999) {
                        EXPECT_TRUE(covered) << off;
                        EXPECT_NEAR(gbuffer.depths[row * kFrameWidth + column], depth, 3e-5);  // steps of 2^-24 of the range of 100
                    } else if (!(depth > 0 && off < 1.001) && !near_own) {
                        EXPECT_FALSE(covered) << off;
                    }
                }
            if (::testing::Test::HasFailure()) return;
        }
}

// A wall of discs that overlap many times over has its own depth at every pixel; quanta and bytes hold it exactly.
TEST(Surfel, AWallHasItsOwnDepthEverywhere) {
    const PackedNormal normal = {63, -126, 0};  // y = 2 + x / 2
    Random random(6);
    std::vector<Vec3d> positions;
    for (int i = 0; i < 15000; ++i) {
        const int x = 2 * int(random.uniform(-700, 2100));
        positions.push_back(kMillimeters.offset + Vec3d(0.001 * x, 2 + 0.0005 * x, random.uniform(-2.1, 2.1)));
    }
    ResidentNode wall = node_of(positions);
    wall.normals.assign(positions.size(), normal);
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        const GBuffer gbuffer = draw_points({wall}, camera_north(projection), {.shape = SplatShape::surfel});
        for (uint32_t row = 0; row < kFrameHeight; ++row)
            for (uint32_t column = 0; column < kFrameWidth; ++column) {
                const Ray ray = ray_of(projection, column, row);
                const double depth = (2 + 0.5 * ray.from.x()) / (1 - 0.5 * ray.direction.x());
                ASSERT_NEAR(gbuffer.depths[row * kFrameWidth + column], depth, 3e-5);
            }
    }
}

TEST(Surfel, WithoutANormalItFacesTheViewer) {
    std::vector<ResidentNode> nodes = random_nodes();
    for (ResidentNode& node : nodes) {
        node.normals.assign(node.size(), PackedNormal{});
        for (PointShape& shape : node.shapes) shape.normal = {};
    }
    for (const Projection projection : {Projection::perspective, Projection::orthographic})
        for (const float size : {0.0f, 1.0f, 7.0f})
            EXPECT_TRUE(equal(draw_points(nodes, camera_north(projection), {.shape = SplatShape::surfel, .fixed_px = size}),
                              draw_points(nodes, camera_north(projection), {.shape = SplatShape::disc, .fixed_px = size})));
}

// Seen edge on a disc has no area, and still shows at its own pixel, at its center's depth to within its radius.
TEST(Surfel, EdgeOnItsOwnPixelIsCovered) {
    Random random(8);
    for (const PackedNormal& normal : {PackedNormal{127, 0, 0}, PackedNormal{0, 0, 127}, PackedNormal{80, 0, -127}})
        for (int i = 0; i < 50; ++i) {
            const Vec3d center(0.001 * int(random.uniform(-700, 700)) + 0.0002, 2, 0.001 * int(random.uniform(-300, 300)) + 0.0002);
            const Quantization fine = {.scale = Vec3d::Constant(0.0001), .offset = kMillimeters.offset};
            ResidentNode node = node_of({kMillimeters.offset + center}, fine);
            node.normals = {normal};
            const GBuffer gbuffer = draw_points({node}, camera_north(Projection::orthographic), {.shape = SplatShape::surfel, .fixed_px = 20}, 1, fine);
            const size_t pixel = size_t(50 - center.z() * kUnit) * kFrameWidth + size_t(100 + center.x() * kUnit);
            EXPECT_EQ(gbuffer.ids[pixel], make_pixel_id(0, 0));
            EXPECT_NEAR(gbuffer.depths[pixel], 2.0, 0.1 + 3e-5);
            EXPECT_LE(drawn(gbuffer), 21u);
        }
}

}  // namespace
}  // namespace strata
