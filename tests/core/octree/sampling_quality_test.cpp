#include "core/octree/sampling_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>

#include "core/error.h"
#include "core/math/random.h"
#include "core/octree/layered_validation.h"
#include "core/octree/neighbor_grid.h"

namespace strata {
namespace {

/// A layered cloud in memory: points by node, cube of 1024 world units, a quantum of 1, spacing 8 at the root.
class HandMadeCloud : public LayeredCloud {
public:
    explicit HandMadeCloud(const std::map<NodeKey, std::vector<Vec3i>>& nodes) {
        info_.quantization.scale = Vec3d::Ones();
        add({}, kNoNode, nodes);
        for (NodeId id = 0; id < nodes_.size(); ++id) {
            const NodeKey key = nodes_[id].key;
            for (int octant = 0; octant < 8; ++octant) {
                if (!nodes.contains(key.child(octant))) continue;
                if (nodes_[id].child_count++ == 0) nodes_[id].first_child = NodeId(nodes_.size());
                add(key.child(octant), id, nodes);
            }
            nodes_[id].error = nodes_[id].child_count > 0 ? nodes_[id].spacing : 0.0;
        }
    }

    const CloudInfo& info() const override { return info_; }
    size_t node_count() const override { return nodes_.size(); }
    const LayeredNode& node(NodeId id) const override { return nodes_[id]; }
    void read_node(NodeId id, std::span<const int>, PointBatch& out) const override {
        resize_batch(out, points_[id].size(), {}, {});
        for (size_t i = 0; i < out.size; ++i) {
            out.x[i] = points_[id][i].x();
            out.y[i] = points_[id][i].y();
            out.z[i] = points_[id][i].z();
        }
    }

    CloudInfo info_;
    std::vector<LayeredNode> nodes_;

private:
    void add(const NodeKey& key, NodeId parent, const std::map<NodeKey, std::vector<Vec3i>>& nodes) {
        const double side = std::ldexp(1024.0, -int(key.level));
        LayeredNode node;
        node.key = key;
        node.parent = parent;
        node.bounds.min = side * Vec3d(key.x, key.y, key.z);
        node.bounds.max = node.bounds.min + Vec3d::Constant(side);
        node.spacing = std::ldexp(8.0, -int(key.level));
        node.points = nodes.at(key).size();
        node.byte_offset = bytes_;
        node.byte_size = 12 * node.points;
        bytes_ += node.byte_size;
        info_.points += node.points;
        nodes_.push_back(node);
        points_.push_back(nodes.at(key));
    }

    std::vector<std::vector<Vec3i>> points_;
    uint64_t bytes_ = 0;
};

/// The square lattice of a pitch in the plane z = 0, without what a coarser lattice holds; where `keep` says so.
std::vector<Vec3i> lattice(int pitch, int coarser, const std::function<bool(int, int)>& keep = [](int, int) { return true; }) {
    std::vector<Vec3i> points;
    for (int x = 0; x < 1024; x += pitch)
        for (int y = 0; y < 1024; y += pitch)
            if (!(coarser > 0 && x % coarser == 0 && y % coarser == 0) && keep(x, y)) points.emplace_back(x, y, 0);
    return points;
}

// The plane's lattice of pitch 8 at the root, of 4 one level below, of 2 in the leaves. What a level leaves out lies
// on the finer lattice: its worst point is in the middle of a square, sqrt(2)/2 of the pitch away.
std::map<NodeKey, std::vector<Vec3i>> three_lattices() {
    std::map<NodeKey, std::vector<Vec3i>> nodes;
    nodes[{}] = lattice(8, 0);
    for (uint32_t x = 0; x < 2; ++x)
        for (uint32_t y = 0; y < 2; ++y) nodes[{1, x, y, 0}] = lattice(4, 8, [&](int px, int py) { return uint32_t(px / 512) == x && uint32_t(py / 512) == y; });
    for (uint32_t x = 0; x < 4; ++x)
        for (uint32_t y = 0; y < 4; ++y) nodes[{2, x, y, 0}] = lattice(2, 4, [&](int px, int py) { return uint32_t(px / 256) == x && uint32_t(py / 256) == y; });
    return nodes;
}

constexpr double kRounding = 1e-6;  // distances are kept as float

TEST(SamplingQuality, LatticesOfTheSpacingMeasureOne) {
    HandMadeCloud cloud(three_lattices());
    EXPECT_NO_THROW(validate_layered(cloud, {.read_points = true}));
    const std::vector<LevelSampling> levels = measure_sampling(cloud, {});
    ASSERT_EQ(levels.size(), 2u);  // leaves are no sample
    for (const LevelSampling& level : levels) {
        EXPECT_EQ(level.inner_nodes, level.level == 0 ? 1u : 4u);
        EXPECT_EQ(level.measured_nodes, level.inner_nodes);
        EXPECT_EQ(level.kept_points, level.level == 0 ? 128u * 128 : 256u * 256);  // the union of levels
        EXPECT_EQ(level.removed_points, 512u * 512 - level.kept_points);
        EXPECT_EQ(level.removed_total, level.removed_points);
        EXPECT_EQ(level.reach, kSamplingReach);
        EXPECT_NEAR(level.neighbor_min, 1.0, kRounding);
        EXPECT_NEAR(level.neighbor_p5, 1.0, kRounding);
        EXPECT_NEAR(level.neighbor_median, 1.0, kRounding);
        // At the last row and column of the plane there is no lattice point beyond: (1022, 1022) is 6 from 1016 in both
        // axes at the root, 2 from 1020 one level below.
        EXPECT_NEAR(level.coverage_max, level.level == 0 ? std::sqrt(72.0) / 8.0 : std::sqrt(8.0) / 4.0, kRounding);
        EXPECT_NEAR(level.coverage_p99, std::sqrt(0.5), kRounding);
    }
}

TEST(SamplingQuality, SeesPairsAcrossTheBordersOfNodes) {
    auto nodes = three_lattices();
    nodes[{1, 0, 0, 0}].emplace_back(511, 100, 0);  // 1 from the lattice point (512, 100), which belongs to the node beyond x = 512
    HandMadeCloud cloud(nodes);
    const std::vector<LevelSampling> levels = measure_sampling(cloud, {});
    EXPECT_NEAR(levels[1].neighbor_min, 0.25, kRounding);  // spacing 4
    EXPECT_NEAR(levels[0].neighbor_min, 1.0, kRounding);   // the root keeps what it kept
}

TEST(SamplingQuality, SeesHolesInTheSample) {
    auto nodes = three_lattices();
    // A hole of 7 x 7 lattice points around (512, 512): its middle is 16 from what is kept.
    std::erase_if(nodes[{}], [](const Vec3i& p) { return std::abs(p.x() - 512) <= 24 && std::abs(p.y() - 512) <= 24; });
    nodes[{2, 2, 2, 0}].emplace_back(512, 512, 0);
    HandMadeCloud cloud(nodes);
    const std::vector<LevelSampling> levels = measure_sampling(cloud, {});
    EXPECT_NEAR(levels[0].coverage_max, 4.0, kRounding);  // (512, 512) to (480, 512)
}

TEST(SamplingQuality, LeavesAreNoSampleAndWhereTheTreeEndsNothingCounts) {
    auto nodes = three_lattices();
    for (uint32_t x = 2; x < 4; ++x)
        for (uint32_t y = 2; y < 4; ++y) nodes.erase({2, x, y, 0});  // the upper quarter is a leaf of level 1 now
    nodes[{1, 1, 1, 0}].emplace_back(777, 777, 0);                    // nearer than any spacing to its neighbors
    HandMadeCloud cloud(nodes);
    const std::vector<LevelSampling> levels = measure_sampling(cloud, {});
    ASSERT_EQ(levels.size(), 2u);
    EXPECT_EQ(levels[1].inner_nodes, 3u);
    EXPECT_EQ(levels[1].kept_points, 3u * 128 * 128);
    EXPECT_NEAR(levels[1].neighbor_min, 1.0, kRounding);
}

TEST(SamplingQuality, ABudgetPicksNodesAndStaysExactAroundThem) {
    HandMadeCloud cloud(three_lattices());
    const std::vector<LevelSampling> some = measure_sampling(cloud, {.point_budget = 40'000});
    EXPECT_EQ(some[0].measured_nodes, 1u);
    EXPECT_LT(some[0].removed_points, some[0].removed_total);  // of nodes below
    EXPECT_LT(some[1].measured_nodes, 4u);
    EXPECT_GT(some[1].kept_points, 0u);
    for (const LevelSampling& level : some) {
        EXPECT_NEAR(level.neighbor_min, 1.0, kRounding);
        EXPECT_NEAR(level.neighbor_median, 1.0, kRounding);
    }
    const std::vector<LevelSampling> again = measure_sampling(cloud, {.point_budget = 40'000, .threads = 3});
    for (size_t i = 0; i < some.size(); ++i) {
        EXPECT_EQ(some[i].kept_points, again[i].kept_points);
        EXPECT_EQ(some[i].removed_points, again[i].removed_points);
        EXPECT_EQ(some[i].coverage_max, again[i].coverage_max);
    }
}

TEST(SamplingQuality, ASingleLeafHasNoLevels) {
    HandMadeCloud cloud({{NodeKey{}, {Vec3i(1, 2, 3)}}});
    EXPECT_TRUE(measure_sampling(cloud, {}).empty());
}

TEST(NeighborGrid, AgreesWithTheSearchOfAllPairs) {
    Random random(3);
    std::vector<Vec3i> points;
    for (int i = 0; i < 2000; ++i) points.emplace_back(int(random.uniform(-500, 500)), int(random.uniform(-500, 500)), int(random.uniform(-90, 90)));
    points.emplace_back(INT32_MAX, INT32_MIN, 0);
    const Vec3d scale(0.5, 1.0, 2.0);
    for (const double reach : {3.0, 20.0, 400.0}) {
        const NeighborGrid grid(points, scale, reach);
        for (size_t i = 0; i < points.size(); ++i) {
            double nearest = reach;
            for (size_t j = 0; j < points.size(); ++j)
                if (j != i) nearest = std::min(nearest, (points[i].cast<double>() - points[j].cast<double>()).cwiseProduct(scale).norm());
            ASSERT_NEAR(grid.distance(points[i], i), nearest, 1e-9);
        }
    }
}

TEST(LayeredValidation, NamesChildrenThatLieElsewhere) {
    const auto message = [](const std::function<void(HandMadeCloud&)>& bend) {
        HandMadeCloud cloud(three_lattices());
        bend(cloud);
        try {
            validate_layered(cloud, {.read_points = true});
        } catch (const Error& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(message([](HandMadeCloud&) {}), "");
    EXPECT_EQ(message([](HandMadeCloud& c) { c.nodes_[1].key = {1, 0, 0, 3}; }), "node r1: not an octant of its parent r");
    EXPECT_EQ(message([](HandMadeCloud& c) { c.nodes_[2].bounds.max.x() = 1100; }), "node r2: reaches beyond its parent r");
    EXPECT_EQ(message([](HandMadeCloud& c) { std::swap(c.nodes_[1].key, c.nodes_[2].key); }).substr(0, 8), "node r0:");
    EXPECT_EQ(message([](HandMadeCloud& c) { c.nodes_[2].byte_offset -= 1; }), "node r2: its bytes overlap those of node r0");
    EXPECT_EQ(message([](HandMadeCloud& c) { c.nodes_[2].points += 1; }), "hierarchy: its nodes hold 262145 points, 262144 are stated");
    EXPECT_EQ(message([](HandMadeCloud& c) { c.nodes_[3].points += 1, c.info_.points += 1; }), "node r4: 12289 points expected, 12288 read");
    EXPECT_EQ(message([](HandMadeCloud& c) { c.nodes_[3].bounds.max.x() = 1000; }).substr(0, 14), "node r44: reac");
}

}  // namespace
}  // namespace strata
