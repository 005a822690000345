// Frames of one renderer that keeps nodes, against frames that start with none.
#include "render/stream/resident_cloud.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/error.h"
#include "core/math/random.h"
#include "core/octree/memory_cloud.h"
#include "render/renderer.h"
#include "tests/support/memory_source.h"

namespace strata {
namespace {

// A cloud whose reads can be held up or fail.
class HeldCloud : public LayeredCloud {
public:
    explicit HeldCloud(std::unique_ptr<LayeredCloud> cloud) : cloud_(std::move(cloud)) {}

    const CloudInfo& info() const override { return cloud_->info(); }
    size_t node_count() const override { return cloud_->node_count(); }
    const LayeredNode& node(NodeId id) const override { return cloud_->node(id); }
    void read_node(NodeId id, std::span<const int> wanted, PointBatch& out) const override {
        held.wait(true);
        if (id == failing) throw Error(ErrorKind::io, "node " + std::to_string(id) + " is gone");
        cloud_->read_node(id, wanted, out);
    }
    void hold(bool on) {
        held = on;
        held.notify_all();
    }

    std::atomic<bool> held = false;
    NodeId failing = kNoNode;

protected:
    std::unique_ptr<LayeredCloud> cloud_;
};

// The same with the children of every node on a page of their own.
class PagedCloud : public HeldCloud {
public:
    explicit PagedCloud(std::unique_ptr<LayeredCloud> cloud) : HeldCloud(std::move(cloud)), nodes_(cloud_->node_count()) {
        for (NodeId id = 0; id < nodes_.size(); ++id) {
            nodes_[id] = cloud_->node(id);
            nodes_[id].children_pending = nodes_[id].child_count > 0;
        }
    }

    const LayeredNode& node(NodeId id) const override { return nodes_[id]; }
    std::unique_ptr<HierarchyPage> read_page(NodeId id) const override {
        held.wait(true);
        if (id == failing_page) throw Error(ErrorKind::io, "page " + std::to_string(id) + " is gone");
        return std::make_unique<HierarchyPage>();
    }
    void add_page(NodeId id, const HierarchyPage&) override { nodes_[id].children_pending = false; }

    NodeId failing_page = kNoNode;

private:
    std::vector<LayeredNode> nodes_;
};

// Rolling ground, 200 by 200 m, 150,000 points.
std::unique_ptr<LayeredCloud> hills() {
    Random random(3);
    std::vector<Vec3i> quanta;
    for (int i = 0; i < 150'000; ++i) {
        const double x = random.uniform(0, 200), y = random.uniform(0, 200);
        quanta.emplace_back(int(1000 * x), int(1000 * y), int(5000 * std::sin(x / 20) * std::cos(y / 15)));
    }
    return build_memory_cloud(MemorySource(std::move(quanta)), {});
}

RenderSettings settings_of(const LayeredCloud& cloud) {
    RenderSettings settings;
    settings.width = 240;
    settings.height = 160;
    settings.color = find_color_channel(cloud.info(), "elevation");
    settings.edl.strength = 0.0f;
    settings.selection.error_px = 1.0;
    settings.threads = 3;
    return settings;
}

Camera camera_at(const LayeredCloud& cloud, double x, double y, double height, double heading) {
    Camera camera;
    camera.eye = cloud.info().quantization.world_from_quanta({0, 0, 0}) + Vec3d(x, y, height);
    camera.view_from_world = look_along({std::cos(heading), std::sin(heading), -0.5}, {0, 0, 1});
    fit_depth_range(camera, cloud.info().bounds);
    return camera;
}

// A flight over the cloud, in steps small enough that views overlap.
std::vector<Camera> flight(const LayeredCloud& cloud, int frames) {
    Random random(23);
    std::vector<Camera> cameras;
    double x = 20, y = 20, heading = 0.8;
    for (int i = 0; i < frames; ++i) {
        heading += random.uniform(-0.3, 0.35);
        x = std::clamp(x + 8 * std::cos(heading), 0.0, 180.0);
        y = std::clamp(y + 8 * std::sin(heading), 0.0, 180.0);
        cameras.push_back(camera_at(cloud, x, y, 25 + 15 * std::sin(i / 3.0), heading));
    }
    return cameras;
}

struct Frame {
    RenderReport report;
    std::vector<Rgba8> colors;
};

Frame render(Renderer& renderer, LayeredCloud& cloud, const Camera& camera, const RenderSettings& settings) {
    Frame frame;
    frame.report = renderer.render_frame(cloud, camera, settings, [&](const RenderedRows& rows) {
        frame.colors.insert(frame.colors.end(), rows.colors.begin(), rows.colors.end());
    });
    return frame;
}

Frame render_cold(LayeredCloud& cloud, const Camera& camera, const RenderSettings& settings) {
    Renderer renderer;
    return render(renderer, cloud, camera, settings);
}

// Strips take a part of the memory; what is left is for nodes.
uint64_t strip_bytes(const RenderSettings& settings) { return uint64_t{settings.width} * settings.height * 48; }

// Bit for bit, at any cap; the cap binds selection, never the cache's past.
TEST(ResidentCloud, WarmFramesAreColdFrames) {
    HeldCloud cloud(hills());
    RenderSettings settings = settings_of(cloud);
    settings.tile_rows = settings.height;
    for (const uint64_t room : {uint64_t{600'000}, uint64_t{1} << 30}) {
        settings.memory_bytes = strip_bytes(settings) + room;
        Renderer renderer;
        bool bound = false;
        for (const Camera& camera : flight(cloud, 15)) {
            settings.threads = 1 + settings.threads % 4;
            const Frame warm = render(renderer, cloud, camera, settings);
            EXPECT_EQ(warm.colors, render_cold(cloud, camera, settings).colors);
            EXPECT_LE(renderer.resident_bytes(), room);
            EXPECT_EQ(warm.report.nodes_missing, 0u);
            bound = bound || warm.report.bound_by == BoundBy::memory;
        }
        EXPECT_EQ(bound, room == 600'000);
    }
}

TEST(ResidentCloud, AWarmFrameReadsNothing) {
    HeldCloud cloud(hills());
    RenderSettings settings = settings_of(cloud);
    const Camera camera = flight(cloud, 1)[0];
    Renderer renderer;
    const Frame first = render(renderer, cloud, camera, settings);
    const uint64_t reads = renderer.nodes_read();
    EXPECT_EQ(reads, first.report.nodes_drawn);
    // Neither what does not change colors, nor a clip box, reads again.
    settings.splat.fixed_px = 2.0f;
    settings.clips = {{.box = {.min = camera.eye - Vec3d::Constant(60), .max = camera.eye + Vec3d::Constant(60)}}};
    cloud.hold(true);
    const Frame second = render(renderer, cloud, camera, settings);
    cloud.hold(false);
    EXPECT_EQ(renderer.nodes_read(), reads);
    EXPECT_LT(second.report.points_drawn, first.report.points_drawn);
    EXPECT_GT(second.report.points_drawn, 0u);

    settings.filter = PointFilter(cloud.info(), std::vector<FilterTerm>{{"lod", {{0, 0}}}});
    EXPECT_EQ(render(renderer, cloud, camera, settings).report.points_drawn > 0, true);
    renderer.forget_cloud();
    EXPECT_EQ(renderer.resident_bytes(), 0u);
}

// Frames that do not wait always show something, stay under the cap, and come to the picture of one that waits as soon as
// the camera rests.
TEST(ResidentCloud, FramesThatDoNotWaitArriveAtThePicture) {
    HeldCloud cloud(hills());
    RenderSettings settings = settings_of(cloud);
    settings.tile_rows = settings.height;
    constexpr uint64_t kRoom = 900'000;
    settings.memory_bytes = strip_bytes(settings) + kRoom;
    Renderer renderer;
    const std::vector<Camera> cameras = flight(cloud, 40);
    for (size_t i = 0; i < cameras.size(); ++i) {
        settings.wait = false;
        Frame frame = render(renderer, cloud, cameras[i], settings);
        EXPECT_GT(frame.report.points_drawn, 0u);
        EXPECT_LE(renderer.resident_bytes(), kRoom);
        if (i % 10 != 9) continue;
        while (frame.report.nodes_missing > 0) {
            EXPECT_EQ(frame.report.bound_by, BoundBy::time);
            frame = render(renderer, cloud, cameras[i], settings);
        }
        settings.wait = true;
        EXPECT_EQ(frame.colors, render_cold(cloud, cameras[i], settings).colors);
    }
}

// While the disk gives nothing: the first frame had to have the root; after that the frames go on with what is there, and
// what the last one drew stays.
TEST(ResidentCloud, WithoutTheDiskTheLastNodesStay) {
    HeldCloud cloud(hills());
    RenderSettings settings = settings_of(cloud);
    const Camera near = camera_at(cloud, 30, 30, 12, 0.8), aside = camera_at(cloud, 30, 30, 12, 1.5);
    Renderer renderer;
    const Frame before = render(renderer, cloud, near, settings);
    settings.wait = false;
    cloud.hold(true);
    const Frame turned = render(renderer, cloud, aside, settings);
    EXPECT_GT(turned.report.nodes_missing, 0u);
    EXPECT_GE(turned.report.points_drawn, before.report.points_drawn);
    EXPECT_GT(turned.report.error_px, settings.selection.error_px);
    const Frame back = render(renderer, cloud, near, settings);
    EXPECT_EQ(back.report.nodes_missing, 0u);
    EXPECT_EQ(back.colors, before.colors);
    cloud.hold(false);
}

// Frames that do not wait do so for no page of the hierarchy either, and arrive at the whole picture.
TEST(ResidentCloud, PagesOfTheHierarchyComeLater) {
    PagedCloud cloud(hills());
    RenderSettings settings = settings_of(cloud);
    const Camera camera = camera_at(cloud, 30, 30, 12, 0.8);
    settings.wait = false;
    Renderer renderer;
    Frame frame = render(renderer, cloud, camera, settings);  // waits for the root alone
    EXPECT_GT(frame.report.nodes_missing, 0u);
    EXPECT_EQ(frame.report.nodes_drawn, 1u);
    EXPECT_EQ(frame.report.bound_by, BoundBy::time);
    cloud.hold(true);  // whatever is being read now ends at most one level lower
    for (int i = 0; i < 3; ++i) {
        frame = render(renderer, cloud, camera, settings);
        EXPECT_GT(frame.report.nodes_missing, 0u);
        EXPECT_GT(frame.report.error_px, settings.selection.error_px);
    }
    cloud.hold(false);
    while (frame.report.nodes_missing > 0) frame = render(renderer, cloud, camera, settings);
    settings.wait = true;
    EXPECT_EQ(frame.colors, render_cold(cloud, camera, settings).colors);
}

TEST(ResidentCloud, AFailedPageIsReportedOnceAndTheNodeAboveItDrawn) {
    PagedCloud cloud(hills());
    RenderSettings settings = settings_of(cloud);
    settings.range = ColorRange{-5, 5};
    const Camera camera = camera_at(cloud, 100, 100, 60, 0.8);
    cloud.failing_page = cloud.node(cloud.root()).first_child;
    settings.wait = false;
    Renderer renderer;
    uint64_t failures = 0;
    Frame frame;
    do {
        frame = render(renderer, cloud, camera, settings);
        failures += frame.report.failures.count;
        if (frame.report.failures.count > 0) EXPECT_EQ(frame.report.failures.first, "page 1 is gone");
    } while (frame.report.nodes_missing > 0);
    EXPECT_EQ(failures, 1u);
    EXPECT_GT(frame.report.nodes_drawn, 5u);
    EXPECT_GT(frame.report.error_px, settings.selection.error_px);
}

TEST(ResidentCloud, AFailedNodeIsReportedOnceAndItsParentDrawn) {
    HeldCloud cloud(hills());
    RenderSettings settings = settings_of(cloud);
    settings.range = ColorRange{-5, 5};
    const Camera camera = camera_at(cloud, 100, 100, 60, 0.8);
    const Frame whole = render_cold(cloud, camera, settings);
    cloud.failing = cloud.node(cloud.root()).first_child;
    Renderer renderer;
    const Frame first = render(renderer, cloud, camera, settings);
    EXPECT_EQ(first.report.failures.count, 1u);
    EXPECT_EQ(first.report.failures.first, "node 1 is gone");
    EXPECT_EQ(whole.report.points_drawn - first.report.points_drawn, cloud.node(cloud.failing).points);
    const Frame second = render(renderer, cloud, camera, settings);
    EXPECT_EQ(second.report.failures.count, 0u);
    EXPECT_EQ(second.colors, first.colors);
}

// However little time there is, the root is drawn; at rest each frame may take twice as long, until nothing is missing.
TEST(ResidentCloud, LittleTimeDrawsLittleAndRestDrawsAll) {
    HeldCloud cloud(hills());
    RenderSettings settings = settings_of(cloud);
    const Camera camera = flight(cloud, 1)[0];
    Renderer renderer;
    settings.time_budget_ms = 1e-5;
    Frame frame = render(renderer, cloud, camera, settings);
    EXPECT_EQ(frame.report.bound_by, BoundBy::time);
    EXPECT_EQ(frame.report.points_drawn, cloud.node(cloud.root()).points);
    EXPECT_GT(frame.report.error_px, settings.selection.error_px);
    int frames = 0;
    for (; frame.report.bound_by == BoundBy::time && frames < 60; ++frames) frame = render(renderer, cloud, camera, settings);
    EXPECT_LT(frames, 60);
    settings.time_budget_ms = 0;
    EXPECT_EQ(frame.colors, render_cold(cloud, camera, settings).colors);
}

}  // namespace
}  // namespace strata
