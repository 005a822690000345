#include "core/octree/node_selection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "tests/support/test_cloud.h"

namespace strata {
namespace {

// Straight down on the cube [0, 128]^3 whose root has spacing 1, with so many pixels a unit.
Camera top_camera(uint32_t size_px, double pixels_per_unit) {
    Camera camera;
    camera.projection = Projection::orthographic;
    camera.view_from_world = look_along({0, 0, -1}, {0, 1, 0});
    camera.eye = {64, 64, 1000};
    camera.height = size_px / pixels_per_unit;
    fit_depth_range(camera, {.min = Vec3d::Zero(), .max = Vec3d::Constant(128)});
    return camera;
}

constexpr uint32_t kSize = 512;

// Spacing halves a level: at 4 px a unit, levels are 4, 2, 1 px apart, so the third level meets an error of 1 px.
TEST(NodeSelection, StopsAtTheLevelThatMeetsTheError) {
    TestCloud cloud = full_octree(128, 5, 10);
    const Selection selection = select_nodes(cloud, top_camera(kSize, 4), kSize, kSize, {.error_px = 1.0});
    EXPECT_EQ(selection.nodes.size(), 1u + 8 + 64);
    EXPECT_EQ(selection.points, 730u);
    EXPECT_DOUBLE_EQ(selection.error_px, 1.0);
    EXPECT_EQ(selection.bound_by, BoundBy::error);
}

TEST(NodeSelection, LeavesHaveNoError) {
    TestCloud cloud = full_octree(128, 2, 10);
    const Selection selection = select_nodes(cloud, top_camera(kSize, 4), kSize, kSize, {.error_px = 0.001});
    EXPECT_EQ(selection.nodes.size(), 9u);
    EXPECT_EQ(selection.error_px, 0.0);
}

// The budget ends refinement; the error reached is that of the coarsest place that was left.
TEST(NodeSelection, KeepsTheBudgetAndSaysWhatItCost) {
    TestCloud cloud = full_octree(128, 5, 10);
    for (const uint64_t budget : {1u, 10u, 55u, 90u, 95u, 700u}) {
        const Selection selection = select_nodes(cloud, top_camera(kSize, 4), kSize, kSize, {.error_px = 1.0, .point_budget = budget});
        EXPECT_EQ(selection.points, std::max<uint64_t>(budget / 10 * 10, 10)) << budget;  // the root always comes
        EXPECT_EQ(selection.bound_by, BoundBy::budget);
        EXPECT_DOUBLE_EQ(selection.error_px, budget < 90 ? 4.0 : 2.0) << budget;
    }
    const Selection selection =
        select_nodes(cloud, top_camera(kSize, 4), kSize, kSize, {.error_px = 1.0, .point_budget = 600, .memory_bytes = 500});
    EXPECT_EQ(selection.bound_by, BoundBy::memory);
    EXPECT_EQ(selection.points, 500u);
}

// Zoomed onto a corner column of the finest level, only the nodes over it are drawn: of each level those at x = y = 0.
TEST(NodeSelection, LeavesOutWhatIsOutOfSight) {
    TestCloud cloud = full_octree(128, 4, 10);
    Camera camera = top_camera(kSize, 64);  // 8 units wide; a cell of the last level has 16
    camera.eye = {8, 8, 1000};
    const Selection selection = select_nodes(cloud, camera, kSize, kSize, {.error_px = 1.0});
    EXPECT_EQ(selection.nodes.size(), 1u + 2 + 4 + 8);
    for (const NodeId id : selection.nodes) EXPECT_TRUE(cloud.node(id).key.x == 0 && cloud.node(id).key.y == 0);
}

TEST(NodeSelection, NodesComeInKeyOrderWithTheirParents) {
    TestCloud cloud = full_octree(128, 5, 10);
    Camera camera;
    camera.eye = {150, -40, 90};
    camera.view_from_world = look_along({-1, 1, -0.4}, {0, 0, 1});
    const Selection selection = select_nodes(cloud, camera, 640, 480, {.error_px = 2.0, .point_budget = 4000});
    EXPECT_GT(selection.nodes.size(), 50u);
    for (size_t i = 1; i < selection.nodes.size(); ++i)
        EXPECT_LT(cloud.node(selection.nodes[i - 1]).key, cloud.node(selection.nodes[i]).key);
    for (const NodeId id : selection.nodes)
        if (cloud.node(id).parent != kNoNode)
            EXPECT_NE(std::find(selection.nodes.begin(), selection.nodes.end(), cloud.node(id).parent), selection.nodes.end());
}

TEST(NodeSelection, LoadsHierarchyOnlyWhereItGoes) {
    TestCloud cloud = full_octree(128, 4, 10);
    for (TestCloud::Node& entry : cloud.nodes) entry.node.children_pending = entry.node.child_count > 0;
    select_nodes(cloud, top_camera(kSize, 2), kSize, kSize, {.error_px = 1.0});
    EXPECT_EQ(cloud.loads, 1u);  // 2 px at the root, 1 px at its children
}

// Without leave to load pages the view ends above them, and says where and how far off that is.
TEST(NodeSelection, NamesThePagesItMayNotLoad) {
    TestCloud cloud = full_octree(128, 4, 10);
    for (TestCloud::Node& entry : cloud.nodes) entry.node.children_pending = entry.node.key.level == 1 && entry.node.child_count > 0;
    const SelectionSettings settings = {.error_px = 0.3, .load_pages = false};
    const Selection selection = select_nodes(cloud, top_camera(kSize, 2), kSize, kSize, settings);  // 2 px at the root
    EXPECT_EQ(cloud.loads, 0u);
    std::vector<NodeId> first_level;
    for (const NodeId id : selection.nodes)
        if (cloud.node(id).key.level == 1) first_level.push_back(id);
    EXPECT_GT(first_level.size(), 0u);
    EXPECT_EQ(selection.nodes.size(), 1 + first_level.size());
    EXPECT_EQ(selection.pending, first_level);  // of one error: in the order of their keys
    EXPECT_DOUBLE_EQ(selection.error_px, 1.0);
    EXPECT_EQ(selection.bound_by, BoundBy::error);
}

// Nodes that a clip box leaves nothing of are not drawn, not counted and not looked below; all else is as without it.
TEST(NodeSelection, LeavesOutWhatIsCutAway) {
    TestCloud cloud = full_octree(128, 4, 10);
    for (TestCloud::Node& entry : cloud.nodes) entry.node.children_pending = entry.node.child_count > 0;
    const ClipBox corner = {.box = {.min = Vec3d::Constant(-1), .max = Vec3d::Constant(15)}};
    const ClipRegion keep({&corner, 1}, {});
    const SelectionSettings kept = {.error_px = 0.001, .point_budget = 45, .clip = &keep};
    const Selection selection = select_nodes(cloud, top_camera(kSize, 4), kSize, kSize, kept);
    ASSERT_EQ(selection.nodes.size(), 4u);  // one a level: the budget has room for it, and for nothing else
    EXPECT_EQ(selection.bound_by, BoundBy::error);
    EXPECT_EQ(cloud.loads, 3u);
    for (const NodeId id : selection.nodes) EXPECT_EQ(cloud.node(id).key.x + cloud.node(id).key.y + cloud.node(id).key.z, 0u);

    const ClipBox half = {.box = {.min = {-1, -1, -1}, .max = {64.5, 200, 200}}, .action = ClipBox::Action::remove};
    const ClipRegion remove({&half, 1}, {});
    const Selection rest = select_nodes(cloud, top_camera(kSize, 4), kSize, kSize, {.error_px = 0.001, .clip = &remove});
    EXPECT_EQ(rest.nodes.size(), 1u + 4 + 32 + 256);
    const ClipBox away = {.box = {.min = Vec3d::Constant(200), .max = Vec3d::Constant(300)}};
    const ClipRegion nothing({&away, 1}, {});
    EXPECT_TRUE(select_nodes(cloud, top_camera(kSize, 4), kSize, kSize, {.clip = &nothing}).nodes.empty());
}

// A node that is cut in part takes more memory: its copy without what is cut.
TEST(NodeSelection, CutNodesTakeTheMemoryOfTheirCopy) {
    TestCloud cloud = full_octree(128, 2, 10);
    const ClipBox half = {.box = {.min = Vec3d::Constant(-1), .max = {96, 200, 200}}};
    const ClipRegion clip({&half, 1}, {});
    // The root and four children are cut: 5 (5 + 10 (1 + 2)) bytes; the other four: 4 (5 + 10).
    for (const uint64_t spare : {0, 1}) {
        const SelectionSettings settings = {.error_px = 0.001, .memory_bytes = 235 - spare, .node_bytes = 5, .cut_point_bytes = 2, .clip = &clip};
        const Selection selection = select_nodes(cloud, top_camera(kSize, 4), kSize, kSize, settings);
        EXPECT_EQ(selection.nodes.size(), 9u - spare);
        EXPECT_EQ(selection.bound_by, spare == 0 ? BoundBy::error : BoundBy::memory);
    }
}

// The bound on depth is a bound: no point of the box that is in sight is nearer.
TEST(NodeSelection, LeastDepthIsABound) {
    Camera camera;
    camera.view_from_world = look_along({1, 0, 0}, {0, 0, 1});
    camera.near_depth = 0.5;
    const Box3d box = {.min = {-5, 2, -1}, .max = {5, 3, 1}};  // beside the eye, reaching behind it
    const double aspect = 1.5, slope = std::tan(0.5 * camera.fov_rad), bound = least_depth(camera, aspect, box);
    double least = 1e9;
    for (double x = -5; x <= 5; x += 0.01)
        for (double y = 2; y <= 3; y += 0.1)
            if (x > 0 && y <= x * slope * aspect) least = std::min(least, x);
    EXPECT_LE(bound, least + 1e-9);
    EXPECT_GT(bound, 0.5 * least);  // and not a useless one
}

}  // namespace
}  // namespace strata
