#include "render/pass/isosurface_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/math/random.h"
#include "core/surface/contour.h"
#include "render/pass/mesh_pass.h"
#include "render/srgb.h"
#include "tests/support/empty_gbuffer.h"
#include "tests/support/field_source.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 120, kHeight = 90;
constexpr double kRadius = 13.0;
const Vec3d kMiddle(16.4, 15.2, 17.1);

GBuffer empty_gbuffer(uint32_t first_row = 0, uint32_t rows = kHeight) { return test::empty_gbuffer(kWidth, first_row, rows); }

// Steps of a quarter, half and a whole unit, at UTM coordinates, turned about z, left-handed.
GridPlacement far_placement() {
    GridPlacement placement;
    placement.origin = Vec3d(500000.0, 5300000.0, 120.0);
    placement.axes << 0.0, -0.5, 0.0, 0.25, 0.0, 0.0, 0.0, 0.0, -1.0;
    return placement;
}

FieldBricks sphere_field(const GridPlacement& placement = {}) {
    test::FunctionSlices source(
        {34, 33, 35}, [](int i, int j, int k) { return (Vec3d(i, j, k) - kMiddle).norm() - kRadius; }, placement);
    return FieldBricks::of_slices(source, uint64_t{1} << 30, 2);
}

IsosurfaceModel model_of(const FieldBricks& field, const char* color = "plain") {
    return {{field, {0.0, ContourInside::below}}, IsosurfaceColors(field, color, 0, std::nullopt, {})};
}

Camera camera_from(const Vec3d& eye, const Vec3d& target, Projection projection, double height) {
    Camera camera;
    camera.projection = projection;
    camera.eye = eye;
    camera.view_from_world = look_along(target - eye, {0.1, 0.2, 1.0});
    camera.fov_rad = 2.0 * std::atan(0.5 * height / (target - eye).norm());
    camera.height = height;
    camera.near_depth = 0.01;
    camera.far_depth = 1000;
    return camera;
}

IsosurfaceView view_of(const Camera& camera, std::span<const ClipBox> clips = {}, int threads = 2) {
    return {camera, kWidth, kHeight, Vec2f::Zero(), clips, threads};
}

// A sphere of cells of unit size: pixels, depths and light as of the sphere itself.
TEST(IsosurfacePass, ASphereLooksLikeOne) {
    const FieldBricks field = sphere_field();
    const Camera camera = camera_from(kMiddle + Vec3d(0, -50, 0), kMiddle, Projection::orthographic, 30);
    GBuffer gbuffer = empty_gbuffer();
    const IsosurfacesDrawn drawn = draw_isosurface(model_of(field, "normal"), 5, view_of(camera), gbuffer);
    EXPECT_EQ(drawn.rays, uint64_t{kWidth} * kHeight);
    EXPECT_EQ(drawn.hits, uint64_t(std::count_if(gbuffer.depths.begin(), gbuffer.depths.end(), [](float depth) { return depth != kNoDepth; })));
    size_t covered = 0;
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const size_t pixel = y * kWidth + x;
            const Vec2d aside((x + 0.5 - 0.5 * kWidth) / 3.0, (0.5 * kHeight - y - 0.5) / 3.0);
            const double square = kRadius * kRadius - aside.squaredNorm();
            if (aside.norm() > kRadius + 0.03) ASSERT_EQ(gbuffer.depths[pixel], kNoDepth) << x << ' ' << y;
            if (aside.norm() > kRadius - 0.03) continue;
            ++covered;
            ASSERT_NEAR(gbuffer.depths[pixel], 50.0 - std::sqrt(square), 0.03 * kRadius / std::sqrt(square)) << x << ' ' << y;
            ASSERT_EQ(drawable_of(gbuffer.ids[pixel]), 5u);
            ASSERT_EQ(gbuffer.splat_px[pixel], 1);
            // The color of the normal towards the eye, -y.
            ASSERT_NEAR(int(green_of(gbuffer.colors[pixel])), 127.5 - 127.5 * std::sqrt(square) / kRadius, 4.0);
        }
    EXPECT_GT(covered, 4500u);
}

// The picture is that of the mesh that marching cubes makes, to a quarter of a cell in depth where the surface is not seen from the side:
// the mesh is flat within cells, by h^2 / 8 R, and the interpolant is not.
TEST(IsosurfacePass, AgreesWithTheMesh) {
    const std::array<uint32_t, 3> size = {40, 38, 36};
    const auto value = [](int i, int j, int k) {
        return std::sin(0.35 * i) * std::cos(0.3 * j) + std::sin(0.3 * j) * std::cos(0.4 * k) + std::sin(0.4 * k) * std::cos(0.35 * i);
    };
    test::FunctionSlices source(size, value), again(size, value);
    const FieldBricks field = FieldBricks::of_slices(source, uint64_t{1} << 30, 2);
    std::vector<float> values(size_t{40} * 38 * 36);
    again.read(36, 0.0, values);
    ContourSettings settings;
    settings.isovalues = {0.2};
    ContourMesh contour;
    contour_grid({}, size, values, settings, contour);
    TriangleMesh mesh;
    for (size_t i = 0; i < contour.positions.size(); ++i) mesh.positions.push_back(contour.origin + contour.positions[i].cast<double>());
    for (size_t i = 0; i < contour.triangles.size(); ++i) mesh.triangles.push_back(contour.triangles[i]);
    const MeshModel mesh_model(mesh, MeshColors(mesh, "plain", std::nullopt, {}));
    const IsosurfaceModel iso_model = {{field, {0.2, ContourInside::above}}, IsosurfaceColors(field, "plain", 0, std::nullopt, {})};
    Random random(3);
    size_t covered = 0, differ = 0, apart = 0;
    for (int round = 0; round < 6; ++round) {
        const Vec3d middle(20, 19, 18), away = Vec3d(random.normal(), random.normal(), random.normal()).normalized();
        const Camera camera =
            camera_from(middle + 90 * away, middle, round % 2 == 0 ? Projection::perspective : Projection::orthographic, 45);
        GBuffer by_mesh = empty_gbuffer(), by_rays = empty_gbuffer();
        MeshPass pass;
        pass.draw(mesh_model, 1, {camera, kWidth, kHeight, Vec2f::Zero(), {}, 2}, by_mesh);
        draw_isosurface(iso_model, 1, view_of(camera), by_rays);
        for (size_t pixel = 0; pixel < by_mesh.depths.size(); ++pixel) {
            if (by_mesh.depths[pixel] == kNoDepth && by_rays.depths[pixel] == kNoDepth) continue;
            ++covered;
            if (std::abs(by_mesh.depths[pixel] - by_rays.depths[pixel]) > 0.25f) {  // NaN never; infinite: only one has it
                ++apart;
                continue;
            }
            for (const auto channel : {red_of, green_of, blue_of})
                if (std::abs(int(channel(by_mesh.colors[pixel])) - int(channel(by_rays.colors[pixel]))) > 12) {
                    ++differ;
                    break;
                }
        }
    }
    EXPECT_GT(covered, 20000u);
    EXPECT_LT(double(apart) / double(covered), 0.02);   // borders
    EXPECT_LT(double(differ) / double(covered), 0.02);  // cells at the grid's border
}

// Neither threads nor strips nor the place in the world show.
TEST(IsosurfacePass, ThreadsAndStripsDoNotShow) {
    const FieldBricks field = sphere_field(far_placement());
    const Vec3d middle = far_placement().world_from_index(kMiddle);
    const Camera camera = camera_from(middle + Vec3d(9, -14, 20), middle, Projection::perspective, 22);
    GBuffer whole = empty_gbuffer();
    ASSERT_GT(draw_isosurface(model_of(field), 1, view_of(camera), whole).hits, 0u);
    EXPECT_GT(std::count_if(whole.depths.begin(), whole.depths.end(), [](float depth) { return depth != kNoDepth; }), 800);
    for (const int threads : {1, 3, 5}) {
        GBuffer parts = empty_gbuffer();
        for (uint32_t row = 0; row < kHeight; row += 19) {
            const uint32_t rows = std::min(19u, kHeight - row);
            GBuffer strip = empty_gbuffer(row, rows);
            draw_isosurface(model_of(field), 1, view_of(camera, {}, threads), strip);
            std::copy(strip.colors.begin(), strip.colors.end(), parts.colors.begin() + ptrdiff_t(row) * kWidth);
            std::copy(strip.depths.begin(), strip.depths.end(), parts.depths.begin() + ptrdiff_t(row) * kWidth);
            std::copy(strip.ids.begin(), strip.ids.end(), parts.ids.begin() + ptrdiff_t(row) * kWidth);
        }
        EXPECT_EQ(parts.colors, whole.colors);
        EXPECT_EQ(parts.depths, whole.depths);
        EXPECT_EQ(parts.ids, whole.ids);
    }
    // An ellipsoid with half axes of 3.25, 6.5 and 13: depths within a fifth of the largest step.
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            const float depth = whole.depths[y * kWidth + x];
            if (depth == kNoDepth) continue;
            const double unit = pixels_per_unit(camera, depth, kHeight);
            const Vec3d view((x + 0.5 - 0.5 * kWidth) / unit, (0.5 * kHeight - y - 0.5) / unit, -double(depth));
            const Vec3d place = camera.eye + camera.view_from_world.transpose() * view;
            const Vec3d index(4.0 * (place.y() - 5300000.0), -2.0 * (place.x() - 500000.0), -(place.z() - 120.0));
            ASSERT_NEAR((index - kMiddle).norm(), kRadius, 0.05) << x << ' ' << y;
        }
}

TEST(IsosurfacePass, NearerPixelsStayAndBoxesCut) {
    const FieldBricks field = sphere_field();
    const Camera camera = camera_from(kMiddle + Vec3d(0, -50, 0), kMiddle, Projection::orthographic, 30);
    GBuffer whole = empty_gbuffer(), gbuffer = empty_gbuffer();
    draw_isosurface(model_of(field), 2, view_of(camera), whole);
    for (size_t pixel = 0; pixel < gbuffer.depths.size(); pixel += 2) gbuffer.depths[pixel] = pixel % 4 == 0 ? 20.0f : whole.depths[pixel];
    draw_isosurface(model_of(field), 2, view_of(camera), gbuffer);
    for (size_t pixel = 0; pixel < gbuffer.depths.size(); ++pixel)
        ASSERT_EQ(gbuffer.ids[pixel] != kNoPixelId, pixel % 2 == 1 && whole.ids[pixel] != kNoPixelId);
    // Without its near half the far one is seen from within; without both nothing is.
    std::vector<ClipBox> clips = {
        {.box = {.min = Vec3d(-100, -100, -100), .max = Vec3d(100, kMiddle.y(), 100)}, .action = ClipBox::Action::remove}};
    GBuffer cut = empty_gbuffer();
    draw_isosurface(model_of(field), 2, view_of(camera, clips), cut);
    const size_t middle = kHeight / 2 * kWidth + kWidth / 2;
    EXPECT_NEAR(whole.depths[middle], 50.0 - kRadius, 0.05);
    EXPECT_NEAR(cut.depths[middle], 50.0 + kRadius, 0.05);
    clips.push_back({.box = {.min = Vec3d(-100, 0, -100), .max = Vec3d(100, 100, 100)}, .action = ClipBox::Action::remove});
    GBuffer none = empty_gbuffer();
    EXPECT_EQ(draw_isosurface(model_of(field), 2, view_of(camera, clips), none).hits, 0u);
}

// Of a half hidden sphere each pixel shows the front over the back over what is behind, where that is not between: in linear light.
TEST(IsosurfacePass, LayersHideWhatIsBehindInTheirOrder) {
    const FieldBricks field = sphere_field();
    const Camera camera = camera_from(kMiddle + Vec3d(0, -50, 0), kMiddle, Projection::orthographic, 30);
    std::vector<IsosurfaceModel> models;
    for (const double radius : {0.0, -6.0})
        models.emplace_back(FieldSurface(field, {radius, ContourInside::below}), IsosurfaceColors(field, "normal", 0, std::nullopt, {}), radius == 0.0 ? 0.5f : 0.25f);
    // Opaque surfaces by themselves: the front, and the back by cutting the front away.
    const std::vector<ClipBox> cut = {{.box = {.min = Vec3d(-100, -100, -100), .max = Vec3d(100, kMiddle.y(), 100)}, .action = ClipBox::Action::remove}};
    std::array<GBuffer, 4> sides;  // outer front, inner front, inner back, outer back
    for (size_t side = 0; side < 4; ++side) {
        sides[side] = empty_gbuffer();
        draw_isosurface(models[side == 0 || side == 3 ? 0 : 1], 7, view_of(camera, side >= 2 ? cut : std::vector<ClipBox>()), sides[side]);
    }
    const auto behind = [&](GBuffer& out) {
        for (size_t pixel = 0; pixel < out.depths.size(); ++pixel) {
            if (pixel % 3 == 0) continue;
            out.colors[pixel] = make_rgba(200, 40, 90);
            out.depths[pixel] = pixel % 3 == 1 ? 50.0f : 90.0f;  // in the middle of the spheres, behind them
        }
    };
    GBuffer seen = empty_gbuffer();
    behind(seen);
    const IsosurfacesDrawn drawn = draw_translucent(models, 7, view_of(camera), seen);
    EXPECT_EQ(drawn.hits, uint64_t(std::count_if(sides[0].depths.begin(), sides[0].depths.end(), [](float depth) { return depth != kNoDepth; })));
    size_t four = 0;
    const auto light_of = [](uint8_t code) { return linear_from_srgb(code / 255.0); };
    for (size_t pixel = 0; pixel < seen.depths.size(); ++pixel) {
        if (sides[0].depths[pixel] == kNoDepth) continue;
        // Near outlines a ray may meet a sphere twice before its middle, or behind it.
        const auto near_outline = [&](size_t front, size_t back) {
            const float a = sides[front].depths[pixel], b = sides[back].depths[pixel];
            return (a == kNoDepth) != (b == kNoDepth) || (a != kNoDepth && b - a < 2.0f);
        };
        if (near_outline(0, 3) || near_outline(1, 2)) continue;
        ASSERT_EQ(seen.depths[pixel], sides[0].depths[pixel]);
        ASSERT_EQ(drawable_of(seen.ids[pixel]), 7u);
        double passing = 1.0;
        Vec3d light = Vec3d::Zero();
        size_t layers = 0;
        const auto add = [&](Rgba8 color, double opacity) {
            light += passing * opacity * Vec3d(light_of(red_of(color)), light_of(green_of(color)), light_of(blue_of(color)));
            passing *= 1.0 - opacity;
        };
        for (size_t side = 0; side < 4; ++side) {
            if (sides[side].depths[pixel] == kNoDepth || (pixel % 3 == 1 && side >= 2)) continue;
            add(sides[side].colors[pixel], side == 0 || side == 3 ? 0.5 : 0.25);
            ++layers;
        }
        four += layers == 4;
        if (pixel % 3 != 0) add(make_rgba(200, 40, 90), 1.0);
        ASSERT_NEAR(int(alpha_of(seen.colors[pixel])), 255.0 * (1.0 - passing), 0.51) << pixel;
        light /= 1.0 - passing;
        ASSERT_NEAR(int(red_of(seen.colors[pixel])), 255.0 * srgb_from_linear(light.x()), 1.01) << pixel;
        ASSERT_NEAR(int(green_of(seen.colors[pixel])), 255.0 * srgb_from_linear(light.y()), 1.01) << pixel;
        ASSERT_NEAR(int(blue_of(seen.colors[pixel])), 255.0 * srgb_from_linear(light.z()), 1.01) << pixel;
    }
    EXPECT_GT(four, 200u);
    for (const int threads : {1, 3}) {
        GBuffer again = empty_gbuffer();
        behind(again);
        draw_translucent(models, 7, view_of(camera, {}, threads), again);
        EXPECT_EQ(again.colors, seen.colors);
        EXPECT_EQ(again.depths, seen.depths);
        EXPECT_EQ(again.ids, seen.ids);
    }
}

// Walls one behind the other, each of the color of normals towards the eye: n of them let (1 - opacity)^n pass, however many they are.
TEST(IsosurfacePass, AHundredAndMoreLayersAreSeenThrough) {
    constexpr int kWalls = 199;
    test::FunctionSlices source({12, kWalls + 1, 12}, [](int, int j, int) { return j % 2 == 0 ? -1.0 : 1.0; });
    const FieldBricks field = FieldBricks::of_slices(source, uint64_t{1} << 30, 2);
    const Vec3d middle(5.5, 100, 5.5);
    const Camera camera = camera_from(middle + Vec3d(0, -150, 0), middle, Projection::orthographic, 30);
    const size_t pixel = kHeight / 2 * kWidth + kWidth / 2;
    for (const float opacity : {0.005f, 0.1f}) {
        const std::vector<IsosurfaceModel> models = {
            {{field, {0.0, ContourInside::below}}, IsosurfaceColors(field, "normal", 0, std::nullopt, {}), opacity}};
        const double passing = opacity < 0.1f ? std::pow(1.0 - double(opacity), kWalls) : 0.0;  // 0.1: 60 walls hide all
        GBuffer alone = empty_gbuffer(), before = empty_gbuffer();
        draw_translucent(models, 7, view_of(camera), alone);
        EXPECT_NEAR(int(alpha_of(alone.colors[pixel])), 255.0 * (1.0 - passing), 1.0);
        EXPECT_NEAR(alone.depths[pixel], 50.5, 1e-3);
        before.colors[pixel] = make_rgba(200, 40, 90);
        before.depths[pixel] = 300.0f;
        draw_translucent(models, 7, view_of(camera), before);
        const Rgba8 wall = alone.colors[pixel];
        for (const auto channel : {red_of, green_of, blue_of}) {
            const double light = (1.0 - passing) * linear_from_srgb(channel(wall) / 255.0) + passing * linear_from_srgb(channel(make_rgba(200, 40, 90)) / 255.0);
            EXPECT_NEAR(int(channel(before.colors[pixel])), 255.0 * srgb_from_linear(light), 1.01);
        }
    }
}

TEST(IsosurfaceModel, BoundsAreThoseOfItsCells) {
    const FieldBricks field = sphere_field();
    const Box3d box = model_of(field).bounds;
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_LE(box.min[axis], kMiddle[axis] - kRadius);
        EXPECT_GT(box.min[axis], kMiddle[axis] - kRadius - 1.01);
        EXPECT_GE(box.max[axis], kMiddle[axis] + kRadius);
        EXPECT_LT(box.max[axis], kMiddle[axis] + kRadius + 1.01);
    }
    EXPECT_TRUE(surface_bounds({field, {1e9, ContourInside::below}}).empty());
}

}  // namespace
}  // namespace strata
