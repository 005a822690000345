#include "render/renderer.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/math/random.h"
#include "render/named_view.h"
#include "render/srgb.h"
#include "tests/support/test_cloud.h"
#include "tests/support/test_meshes.h"
#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

// Rolling ground with a tower: 20,000 points in one node.
TestCloud hill_cloud() {
    Random random(7);
    std::vector<Vec3i> quanta;
    for (int i = 0; i < 20000; ++i) {
        const double x = random.uniform(0, 100), y = random.uniform(0, 60);
        const double z = i % 20 == 0 ? random.uniform(0, 30) : 3.0 * std::sin(x / 7) * std::cos(y / 5);
        const bool tower = i % 20 == 0;
        quanta.emplace_back(int(1000 * (tower ? 40 + x / 30 : x)), int(1000 * (tower ? 30 + y / 30 : y)), int(1000 * z));
    }
    return single_node_cloud(quanta, {.scale = Vec3d::Constant(0.001), .offset = Vec3d(6e5, 5.3e6, 200)}, 0.8);
}

RenderSettings settings_of(const LayeredCloud& cloud) {
    RenderSettings settings;
    settings.width = 320;
    settings.height = 200;
    settings.color = find_color_channel(cloud.info(), "rgb");
    settings.threads = 2;
    return settings;
}

struct Frame {
    RenderReport report;
    std::vector<Rgba8> colors;
    std::vector<float> depths;
    std::vector<PixelId> ids;
};

Frame render(TestCloud& cloud, const Camera& camera, const RenderSettings& settings, Renderer&& renderer = Renderer()) {
    Frame frame;
    frame.report = renderer.render_frame(cloud, camera, settings, [&](const RenderedRows& rows) {
        EXPECT_EQ(size_t(rows.first_row) * settings.width, frame.colors.size());
        frame.colors.insert(frame.colors.end(), rows.colors.begin(), rows.colors.end());
        frame.depths.insert(frame.depths.end(), rows.depths.begin(), rows.depths.end());
        frame.ids.insert(frame.ids.end(), rows.ids.begin(), rows.ids.end());
    });
    return frame;
}

Camera view_of(TestCloud& cloud, std::string_view name, Projection projection, double fov_rad, const RenderSettings& settings) {
    Camera camera = named_view(name, projection, fov_rad, sample_positions(cloud), double(settings.width) / settings.height);
    fit_depth_range(camera, cloud.info().bounds);
    return camera;
}

void expect_strips_and_threads_do_not_show(RenderSettings settings, const std::vector<uint32_t>& strips = {1, 7, 64}) {
    TestCloud cloud = hill_cloud();
    for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
        settings.tile_rows = 0;
        const Camera camera = view_of(cloud, "iso", projection, 0.8, settings);
        const Frame whole = render(cloud, camera, settings);
        EXPECT_EQ(whole.report.points_drawn, 20000u);
        EXPECT_EQ(whole.report.edl_by.empty(), settings.edl.strength == 0.0f);
        EXPECT_EQ(whole.report.gl_renderer.empty(), whole.report.edl_by != "gl" && whole.report.rasterizer == Rasterizer::cpu);
        for (const uint32_t rows : strips) {
            settings.tile_rows = rows;
            settings.threads = rows == 7 ? 7 : 1;
            const Frame tiled = render(cloud, camera, settings);
            EXPECT_EQ(whole.colors, tiled.colors) << rows;
            EXPECT_EQ(whole.depths, tiled.depths) << rows;
        }
    }
}

// The frames of both rasterizers are equal with software GL. One that was drawn before brings no point to the GPU, but those that
// a clip box cuts out; a cloud that is forgotten is brought anew.
TEST(Renderer, ARasterizerOnTheGpuKeepsItsPoints) {
    TestCloud cloud = hill_cloud();
    RenderSettings settings = settings_of(cloud);
    settings.with_ids = true;
    const Camera camera = view_of(cloud, "iso", Projection::perspective, 0.8, settings);
    Renderer renderer;
    const auto uploaded = [&] {
        settings.rasterizer = Rasterizer::gpu;
        const Frame gpu = render(cloud, camera, settings, std::move(renderer));
        EXPECT_EQ(gpu.report.rasterizer, Rasterizer::gpu);
        settings.rasterizer = Rasterizer::cpu;
        const Frame cpu = render(cloud, camera, settings, std::move(renderer));
        EXPECT_EQ(cpu.report.rasterizer, Rasterizer::cpu);
        EXPECT_EQ(cpu.report.uploaded_bytes, 0u);
        if (gpu.report.gl_renderer.find("llvmpipe") != std::string::npos) {
            EXPECT_EQ(gpu.colors, cpu.colors);
            EXPECT_EQ(gpu.depths, cpu.depths);
            EXPECT_EQ(gpu.ids, cpu.ids);
        }
        return gpu.report.uploaded_bytes;
    };
    try {
        EXPECT_EQ(uploaded(), 20000u * 20);
    } catch (const Error& error) {
        ASSERT_EQ(error.kind, ErrorKind::device);
        GTEST_SKIP() << error.what();
    }
    EXPECT_EQ(uploaded(), 0u);
    settings.clips = {{.box = {.min = Vec3d(6e5 + 20, -1e9, -1e9), .max = Vec3d::Constant(1e9)}}};
    const uint64_t cut = uploaded();
    EXPECT_GT(cut, 10000u * 20);
    EXPECT_LT(cut, 20000u * 20);
    EXPECT_EQ(uploaded(), cut);
    settings.clips.clear();
    EXPECT_EQ(uploaded(), 0u);
    renderer.forget_cloud();
    EXPECT_EQ(uploaded(), 20000u * 20);
}

// Each has a GL context of its own, and the last that was used is current.
TEST(Renderer, SeveralRenderersTakeTurns) {
    TestCloud cloud = hill_cloud();
    RenderSettings settings = settings_of(cloud);
    settings.rasterizer = Rasterizer::gpu;
    const Camera camera = view_of(cloud, "iso", Projection::perspective, 0.8, settings);
    const auto first = std::make_unique<Renderer>();
    Renderer second;
    try {
        const Frame alone = render(cloud, camera, settings, std::move(*first));
        for (int turn = 0; turn < 2; ++turn) {
            EXPECT_EQ(render(cloud, camera, settings, std::move(second)).colors, alone.colors);
            EXPECT_EQ(render(cloud, camera, settings).colors, alone.colors);  // one that is gone at once
            EXPECT_EQ(render(cloud, camera, settings, std::move(*first)).colors, alone.colors);
        }
    } catch (const Error& error) {
        ASSERT_EQ(error.kind, ErrorKind::device);
        GTEST_SKIP() << error.what();
    }
}

TEST(Renderer, StripsAndThreadsDoNotShow) {
    RenderSettings settings = settings_of(hill_cloud());
    settings.edl.strength = 0.0f;
    expect_strips_and_threads_do_not_show(settings);
}

TEST(Renderer, StripsAndThreadsDoNotShowInLighting) {
    RenderSettings settings = settings_of(hill_cloud());
    settings.edl.strength = 1.0f;
    expect_strips_and_threads_do_not_show(settings);
}

// Small points leave holes, which are filled alike whatever the strips; a pass works on what the one before made of the rows around.
TEST(Renderer, StripsAndThreadsDoNotShowInFilledHoles) {
    TestCloud cloud = hill_cloud();
    RenderSettings settings = settings_of(cloud);
    settings.splat = {.shape = SplatShape::disc, .fixed_px = 3.0f};
    settings.fill.gap_px = FillSettings::kWidestGap;
    settings.fill.follow_splats = false;
    settings.edl.strength = 0.0f;
    expect_strips_and_threads_do_not_show(settings);

    const Camera camera = view_of(cloud, "iso", Projection::perspective, 0.8, settings);
    const auto holes = [&] {
        const Frame frame = render(cloud, camera, settings);
        return std::count(frame.depths.begin(), frame.depths.end(), kNoDepth);
    };
    const auto filled = holes();
    settings.fill.gap_px = 0.0f;
    EXPECT_LT(filled, holes() - 500);
}

// Occlusion reaches far, and its pattern turns from row to row of the whole picture.
TEST(Renderer, StripsAndThreadsDoNotShowInAmbientOcclusion) {
    TestCloud cloud = hill_cloud();
    RenderSettings settings = settings_of(cloud);
    settings.edl.strength = 0.0f;
    settings.fill.gap_px = FillSettings::kWidestGap;
    settings.ssao.radius = 8.0f;
    expect_strips_and_threads_do_not_show(settings, {7, 64});

    const Camera camera = view_of(cloud, "iso", Projection::perspective, 0.8, settings);
    const Frame lit = render(cloud, camera, settings);
    settings.ssao.radius = 0.0f;
    const Frame plain = render(cloud, camera, settings);
    size_t darker = 0;
    for (size_t i = 0; i < lit.colors.size(); ++i) {
        EXPECT_LE(red_of(lit.colors[i]), red_of(plain.colors[i]));
        darker += red_of(lit.colors[i]) < red_of(plain.colors[i]);
    }
    EXPECT_GT(darker, lit.colors.size() / 20);
}

// Ground scanned in lines three times as far apart as the points on them, seen aslant: no gap, at any distance.
TEST(Renderer, ScanLinesAreClosed) {
    Random random(11);
    std::vector<Vec3i> quanta;
    for (int line = 0; line < 60; ++line)
        for (int i = 0; i < 180; ++i)
            quanta.emplace_back(int(1000 * random.uniform(0, 60)), 1000 * line, int(20 * random.normal()));
    TestCloud cloud = single_node_cloud(quanta, {.scale = Vec3d::Constant(0.001), .offset = Vec3d(6e5, 5.3e6, 200)}, 0.5);
    RenderSettings settings = settings_of(cloud);
    settings.edl.strength = 0.0f;
    for (const double away : {10.0, 30.0, 100.0}) {
        Camera camera;
        camera.eye = Vec3d(6e5 + 30, 5.3e6 + 30 - 0.8 * away, 200 + 0.6 * away);
        camera.view_from_world = look_along({0, 0.8, -0.6}, {0, 0, 1});
        camera.fov_rad = 6.0 / away;
        fit_depth_range(camera, cloud.info().bounds);
        const Frame frame = render(cloud, camera, settings);
        const auto holes = std::count_if(frame.depths.begin(), frame.depths.end(), [](float depth) { return depth == kNoDepth; });
        EXPECT_LT(double(holes), 0.003 * double(frame.depths.size())) << away;  // e^-(1.5^2 pi) of random points is 0.1 %
    }
}

// A named view shows the whole cloud: every point inside, the picture nearly full.
TEST(Renderer, NamedViewsFrameTheCloud) {
    TestCloud cloud = hill_cloud();
    RenderSettings settings = settings_of(cloud);
    settings.edl.strength = 0.0f;
    settings.splat.fixed_px = 1.0f;
    for (const char* name : {"iso", "top", "front", "back", "left", "right"})
        for (const Projection projection : {Projection::perspective, Projection::orthographic}) {
            const Frame frame = render(cloud, view_of(cloud, name, projection, 0.8, settings), settings);
            uint32_t left = settings.width, right = 0, top = settings.height, bottom = 0;
            for (uint32_t y = 0; y < settings.height; ++y)
                for (uint32_t x = 0; x < settings.width; ++x)
                    if (frame.depths[y * settings.width + x] != kNoDepth) {
                        left = std::min(left, x);
                        right = std::max(right, x);
                        top = std::min(top, y);
                        bottom = std::max(bottom, y);
                    }
            const double margin_x = 0.03 * settings.width, margin_y = 0.03 * settings.height;  // kViewMargin
            const double least = std::min({left - margin_x, settings.width - 1 - right - margin_x, top - margin_y,
                                           settings.height - 1 - bottom - margin_y});
            EXPECT_NEAR(least, 0.0, 1.5) << name;  // a pixel on either side
        }
    EXPECT_THROW(named_view("above", Projection::perspective, 0.8, {}, 1.0), Error);
}

// Perspective from far away with a small angle is orthographic, up to points that straddle a pixel's edge.
TEST(Renderer, SmallAnglesTendToOrthographic) {
    TestCloud cloud = hill_cloud();
    RenderSettings settings = settings_of(cloud);
    settings.edl.strength = 0.0f;
    settings.splat = {.shape = SplatShape::square, .fixed_px = 3.0f};
    const Frame parallel = render(cloud, view_of(cloud, "iso", Projection::orthographic, 0.8, settings), settings);
    double before = 1.0;
    for (const double fov : {0.04, 0.004, 0.0004}) {
        const Frame frame = render(cloud, view_of(cloud, "iso", Projection::perspective, fov, settings), settings);
        size_t differing = 0;
        for (size_t i = 0; i < frame.colors.size(); ++i) differing += frame.colors[i] != parallel.colors[i];
        const double share = double(differing) / double(frame.colors.size());
        EXPECT_LT(share, 0.5 * before) << fov;
        before = share;
    }
    EXPECT_LT(before, 0.05);
}

TEST(Renderer, BackgroundAndDepthAreAsStated) {
    TestCloud cloud = single_node_cloud({{0, 0, 0}}, {}, 1);
    RenderSettings settings = settings_of(cloud);
    settings.edl.strength = 0.0f;
    settings.splat.fixed_px = 1.0f;
    settings.background = make_rgba(1, 2, 3);
    Camera camera;
    camera.eye = {0, 0, 5};
    camera.near_depth = 1;
    const Frame frame = render(cloud, camera, settings);
    EXPECT_EQ(std::count(frame.colors.begin(), frame.colors.end(), make_rgba(1, 2, 3)), 320 * 200 - 1);
    EXPECT_FLOAT_EQ(*std::min_element(frame.depths.begin(), frame.depths.end()), 5.0f);
}

TEST(Renderer, AbsurdRequestsAreRefused) {
    TestCloud cloud = hill_cloud();
    RenderSettings settings = settings_of(cloud);
    settings.width = kLargestSide + 1;
    EXPECT_THROW(render(cloud, Camera(), settings), Error);
    settings.width = 10;
    Camera camera;
    camera.eye.x() = std::nan("");
    EXPECT_THROW(render(cloud, camera, settings), Error);
}

// Cutting takes pixels away and leaves those of the points that are left as they were: color, depth, size, and the
// identity of the point.
TEST(Renderer, CutsTakePointsAwayAndChangeNoOther) {
    TestCloud cloud = hill_cloud();
    RenderSettings settings = settings_of(cloud);
    settings.edl.strength = 0.0f;
    settings.with_ids = true;
    for (const float fixed_px : {1.0f, 0.0f}) {
        settings.splat.fixed_px = fixed_px;
        const Camera camera = view_of(cloud, "top", Projection::orthographic, 0.8, settings);
        const Frame whole = render(cloud, camera, settings);
        RenderSettings cut_settings = settings;
        const Vec3d offset = cloud.cloud_info.quantization.offset;
        cut_settings.clips = {{.box = {.min = offset + Vec3d(-1, -1, -10), .max = offset + Vec3d(60, 100, 2)}},
                              {.box = {.min = offset + Vec3d(5, 5, -10), .max = offset + Vec3d(30, 30, 40)}, .action = ClipBox::Action::remove}};
        cut_settings.filter = PointFilter(cloud.info(), std::vector<FilterTerm>{{"rgb[0]", {{0, 40000}}}});
        const Frame cut = render(cloud, camera, cut_settings);

        // What is left, by the test's own arithmetic.
        std::vector<bool> left;
        PointBatch batch;
        const int wanted[] = {0};
        cloud.read_node(0, wanted, batch);
        for (size_t i = 0; i < batch.size; ++i) {
            const Vec3i p(batch.x[i], batch.y[i], batch.z[i]);
            const bool removed = (p.array() >= Vec3i(5000, 5000, -10000).array()).all() && (p.array() <= Vec3i(30000, 30000, 40000).array()).all();
            left.push_back(p.x() <= 60000 && p.z() <= 2000 && !removed && batch.column<uint16_t>(0)[3 * i] <= 40000);
        }
        EXPECT_EQ(cut.report.points_drawn, size_t(std::count(left.begin(), left.end(), true)));
        size_t same = 0;
        for (size_t i = 0; i < whole.ids.size(); ++i) {
            if (cut.ids[i] != kNoPixelId) ASSERT_TRUE(left[uint32_t(cut.ids[i])]);
            if (whole.ids[i] == kNoPixelId || !left[uint32_t(whole.ids[i])]) continue;
            ++same;  // it was on top of all, so it is still
            EXPECT_EQ(cut.ids[i], whole.ids[i]);
            EXPECT_EQ(cut.colors[i], whole.colors[i]);
            EXPECT_EQ(cut.depths[i], whole.depths[i]);
        }
        EXPECT_GT(same, 3000u);
    }
}

// The right edge of a white square, at any place in a pixel, lights the pixel by the share of N samples that the square
// covers: levels of 1 / N, all of them as the edge moves on.
TEST(Renderer, AnEdgeShowsInAsManyLevelsAsSamples) {
    TestCloud cloud = single_node_cloud({{0, 0, 0}}, {}, 1);
    RenderSettings settings = settings_of(cloud);
    settings.range = ColorRange{-2, -1};  // every color is white
    settings.color = find_color_channel(cloud.info(), "rgb");
    settings.edl.strength = 0.0f;
    settings.background = make_rgba(0, 0, 0);
    settings.splat = {.shape = SplatShape::square, .fixed_px = 20.0f};
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = settings.height;  // a pixel a unit
    camera.near_depth = 1;
    for (const uint32_t samples : {2u, 5u, 8u}) {
        settings.samples = samples;
        std::vector<Rgba8> levels;
        for (uint32_t step = 0; step < 4 * samples; ++step) {
            camera.eye = {-0.25 - (step + 0.5) / (4.0 * samples), 0.25, 5};
            const Frame frame = render(cloud, camera, settings);
            const Rgba8* row = &frame.colors[size_t(settings.height / 2) * settings.width + settings.width / 2];
            uint32_t edge = 0;
            while (red_of(row[edge]) == 255) ++edge;
            const uint8_t code = red_of(row[edge]);
            bool is_level = false;
            for (uint32_t covered = 0; covered <= samples; ++covered)
                is_level = is_level || code == std::lround(255.0 * srgb_from_linear(double(covered) / samples));
            EXPECT_TRUE(is_level) << samples << ' ' << int(code);
            levels.push_back(row[edge]);
        }
        std::sort(levels.begin(), levels.end());
        EXPECT_EQ(std::unique(levels.begin(), levels.end()) - levels.begin(), samples) << samples;  // full is the next pixel's none
    }
}

// The light of a disc tends to its area; strips, threads and transparency do not change what is averaged, and depth and
// identity are those of one sample.
TEST(Renderer, SamplesConvergeToTheArea) {
    TestCloud cloud = single_node_cloud({{0, 0, 0}}, {}, 1);
    RenderSettings settings = settings_of(cloud);
    settings.range = ColorRange{-2, -1};
    settings.edl.strength = 0.0f;
    settings.background = 0;
    settings.with_ids = true;
    settings.splat = {.shape = SplatShape::disc, .fixed_px = 9.0f};
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = settings.height;
    camera.near_depth = 1;
    camera.eye = {0.3, 0.1, 5};
    const Frame one = render(cloud, camera, settings);
    double worst_before = 1e9;
    for (const uint32_t samples : {4u, 32u, 256u}) {
        settings.samples = samples;
        const Frame frame = render(cloud, camera, settings);
        double area = 0.0;
        for (const Rgba8 color : frame.colors) area += alpha_of(color) / 255.0;
        const double exact = 3.14159265358979 * 4.5 * 4.5;
        const double off = std::abs(area - exact);
        EXPECT_LT(off, worst_before);
        EXPECT_LT(off, 40.0 / samples + 0.2);  // its outline crosses 36 pixels; codes round by 1 / 510 each
        worst_before = off;
        EXPECT_EQ(frame.depths, one.depths);
        EXPECT_EQ(frame.ids, one.ids);

        RenderSettings other = settings;
        other.tile_rows = 37;
        other.threads = 5;
        EXPECT_EQ(render(cloud, camera, other).colors, frame.colors);
    }
}

// An empty cloud makes an empty picture.
TEST(Renderer, NothingIsBackground) {
    TestCloud cloud = single_node_cloud({}, {}, 1);
    RenderSettings settings = settings_of(cloud);
    settings.edl.strength = 0.0f;
    const Frame frame = render(cloud, Camera(), settings);
    EXPECT_EQ(std::count(frame.colors.begin(), frame.colors.end(), settings.background), 320 * 200);
    EXPECT_EQ(frame.report.points_drawn, 0u);
}

// A scene without drawables does, too, lit or not.
TEST(Renderer, AnEmptySceneIsBackground) {
    RenderSettings settings = settings_of(hill_cloud());
    settings.with_ids = true;
    settings.fill.gap_px = FillSettings::kWidestGap;
    settings.ssao.radius = 1.0f;
    EXPECT_TRUE(Scene().bounds().empty());
    std::vector<Rgba8> colors;
    std::vector<PixelId> ids;
    Renderer().render_frame(Scene(), Camera(), settings, [&](const RenderedRows& rows) {
        colors.insert(colors.end(), rows.colors.begin(), rows.colors.end());
        ids.insert(ids.end(), rows.ids.begin(), rows.ids.end());
    });
    EXPECT_EQ(colors, std::vector<Rgba8>(320 * 200, settings.background));
    EXPECT_EQ(ids, std::vector<PixelId>(320 * 200, kNoPixelId));
}

// Points and voxels hide each other by depth, whatever strips and threads: a floor of points at height 5 beside a step of voxels at 4 and 6,
// which at 5 itself belongs to the points.
TEST(Renderer, PointsAndVoxelsMeet) {
    std::vector<Vec3i> quanta;
    for (int x = 0; x < 64; ++x)
        for (int y = 0; y < 64; ++y) quanta.emplace_back(x * 250 + 125, y * 250 + 125, 5000);
    TestCloud cloud = single_node_cloud(quanta, {.scale = Vec3d::Constant(0.001), .offset = Vec3d::Zero()}, 0.25);
    const VoxelTree tree = tree_of(cube_where(2, [](uint32_t x, uint32_t, uint32_t z) { return z < (x < 5 ? 4u : x < 10 ? 6u : 5u); }));
    Scene scene = cloud;
    scene.voxels.emplace_back(tree, VoxelColors(tree, "", std::nullopt, {}));
    EXPECT_EQ(scene.bounds().max.z(), 6.0);
    RenderSettings settings = settings_of(cloud);
    settings.width = settings.height = 64;
    settings.edl.strength = 0.0f;
    settings.splat = {.shape = SplatShape::square, .fixed_px = 1.0f};
    settings.with_ids = true;
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.height = 16;
    camera.eye = {8, 8, 20};
    camera.near_depth = 1;
    camera.far_depth = 33;
    for (const uint32_t rows : {0u, 5u}) {
        settings.tile_rows = rows;
        std::vector<PixelId> ids;
        std::vector<float> depths;
        const RenderReport report = Renderer().render_frame(scene, camera, settings, [&](const RenderedRows& strip) {
            ids.insert(ids.end(), strip.ids.begin(), strip.ids.end());
            depths.insert(depths.end(), strip.depths.begin(), strip.depths.end());
        });
        EXPECT_EQ(report.voxel_depth, 4);
        EXPECT_EQ(report.points_drawn, 4096u);
        for (uint32_t y = 0; y < 64; ++y)
            for (uint32_t x = 0; x < 64; ++x) {
                const bool voxel = x >= 20 && x < 40;
                ASSERT_EQ(drawable_of(ids[64 * y + x]), voxel ? 1u : 0u) << x << ' ' << y;
                ASSERT_EQ(depths[64 * y + x], voxel ? 14.0f : 15.0f);
            }
    }
}

// Draws a scene of points, of voxels or of a mesh with a renderer whose OpenGL draws and then, once, fails: an error that is pending stands in for a lack of room.
class AFailingGpu : public testing::TestWithParam<int> {
protected:
    AFailingGpu() : cloud_(hill_cloud()), tree_(tree_of(random_boxes(3, 60, 4))), mesh_(sphere_mesh(Vec3d::Constant(32), 20, 30)) {
        if (GetParam() == 0) scene_ = Scene(cloud_);
        if (GetParam() == 1) scene_.voxels.emplace_back(tree_, VoxelColors(tree_, "plain", std::nullopt, {}));
        if (GetParam() == 2) scene_.meshes.emplace_back(mesh_, MeshColors(mesh_, "plain", std::nullopt, {}));
        settings_ = settings_of(cloud_);
        settings_.edl.strength = 0.0f;
        settings_.tile_rows = 90;
        const Box3d box = scene_.bounds();
        camera_.projection = Projection::orthographic;
        camera_.height = 70;
        camera_.eye = 0.5 * (box.min + box.max) + Vec3d(0, 0, 100);
        camera_.near_depth = 1;
        camera_.far_depth = 200;
    }

    RenderReport draw(Rasterizer rasterizer) {
        settings_.rasterizer = rasterizer;
        colors_.clear();
        return renderer_.render_frame(scene_, camera_, settings_, [&](const RenderedRows& rows) { colors_.insert(colors_.end(), rows.colors.begin(), rows.colors.end()); });
    }

    // Colors of voxels may be two steps off.
    size_t different(const std::vector<Rgba8>& expected) const {
        size_t count = 0;
        for (size_t i = 0; i < expected.size(); ++i)
            for (const auto channel : {red_of, green_of, blue_of})
                if (std::abs(int(channel(expected[i])) - int(channel(colors_[i]))) > 2) {
                    ++count;
                    break;
                }
        return count;
    }

    TestCloud cloud_;
    VoxelTree tree_;
    TriangleMesh mesh_;
    Scene scene_;
    RenderSettings settings_;
    Camera camera_;
    Renderer renderer_;
    std::vector<Rgba8> colors_;
};

// Where it was asked for, the frame fails, and the next one that is asked for is whole.
TEST_P(AFailingGpu, FailsTheFrameThatAskedForIt) {
    draw(Rasterizer::cpu);
    const std::vector<Rgba8> expected = colors_;
    ASSERT_GT(std::count_if(expected.begin(), expected.end(), [&](Rgba8 color) { return color != settings_.background; }), 10000);
    try {
        ASSERT_EQ(draw(Rasterizer::gpu).rasterizer, Rasterizer::gpu);
    } catch (const Error& error) {
        ASSERT_EQ(error.kind, ErrorKind::device);
        GTEST_SKIP() << error.what();
    }
    glEnable(GL_NONE);
    try {
        draw(Rasterizer::gpu);
        ADD_FAILURE() << "the frame was drawn";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::device);
        EXPECT_EQ(std::string(error.what()).find("the rasterizer gpu: "), 0u) << error.what();
    }
    EXPECT_EQ(draw(Rasterizer::gpu).rasterizer, Rasterizer::gpu);
    EXPECT_LE(different(expected), expected.size() / 200);
}

// Where it was not, the CPU draws this frame and all that follow.
TEST_P(AFailingGpu, LeavesTheFrameToTheCpu) {
    draw(Rasterizer::cpu);
    const std::vector<Rgba8> expected = colors_;
    if (draw(Rasterizer::automatic).rasterizer != Rasterizer::gpu) GTEST_SKIP() << "no GPU here that draws unless it is asked for";
    glEnable(GL_NONE);
    for (int frame = 0; frame < 2; ++frame) {
        EXPECT_EQ(draw(Rasterizer::automatic).rasterizer, Rasterizer::cpu);
        EXPECT_LE(different(expected), expected.size() / 200);
    }
    EXPECT_EQ(glGetError(), GLenum(GL_NO_ERROR));
}

INSTANTIATE_TEST_SUITE_P(OfPointsVoxelsAndMeshes, AFailingGpu, testing::Range(0, 3));

// Each part of an id comes back as it was, and none that is made is the one that stands for nothing.
TEST(PixelId, HoldsItsParts) {
    for (const uint32_t drawable : {0u, 1u, kMostDrawables - 1})
        for (const uint32_t slot : {0u, 5u, kMostSlots - 1})
            for (const uint32_t primitive : {0u, 77u, 0xffffffffu}) {
                const PixelId id = make_pixel_id(slot, primitive, drawable);
                EXPECT_EQ(drawable_of(id), drawable);
                EXPECT_EQ(slot_of(id), slot);
                EXPECT_EQ(primitive_of(id), primitive);
                EXPECT_NE(id, kNoPixelId);
            }
}

}  // namespace
}  // namespace strata
