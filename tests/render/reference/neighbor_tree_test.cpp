#include "render/reference/neighbor_tree.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/math/random.h"

namespace strata {
namespace {

// Points of very different density, in a plane, in a line and on top of each other.
std::vector<Vec3d> uneven_points() {
    Random random(3);
    std::vector<Vec3d> points;
    for (int i = 0; i < 700; ++i) points.emplace_back(random.uniform(), random.uniform(), random.uniform());
    for (int i = 0; i < 700; ++i) points.emplace_back(0.5 + 1e-3 * random.uniform(), 0.5 + 1e-3 * random.uniform(), 0.5);
    for (int i = 0; i < 200; ++i) points.emplace_back(0.1 * (i % 20), 2.0, 2.0);
    for (int i = 0; i < 100; ++i) points.emplace_back(3.0, 3.0, 3.0);
    return points;
}

TEST(NeighborTree, FindsWhatBruteForceFinds) {
    const std::vector<Vec3d> points = uneven_points();
    const NeighborTree tree(points, 3);
    std::vector<NeighborTree::Neighbor> found, all(points.size());
    Random random(5);
    for (size_t query = 0; query < 300; ++query) {
        const Vec3d p = query % 2 == 0 ? points[query * 5] : Vec3d(random.uniform(-1, 4), random.uniform(-1, 4), random.uniform(-1, 4));
        for (size_t i = 0; i < points.size(); ++i) all[i] = {(points[i] - p).squaredNorm(), uint32_t(i)};
        std::sort(all.begin(), all.end());
        for (const size_t count : {size_t{1}, size_t{9}, size_t{150}}) {
            tree.nearest(p, count, found);
            ASSERT_EQ(found.size(), count);
            for (size_t i = 0; i < count; ++i) {
                ASSERT_EQ(found[i].point, all[i].point) << "query " << query << ", neighbor " << i;
                ASSERT_EQ(found[i].square, all[i].square);
            }
        }
    }
}

TEST(NeighborTree, GivesWhatThereIs) {
    std::vector<NeighborTree::Neighbor> found;
    NeighborTree({}, 1).nearest(Vec3d::Zero(), 4, found);
    EXPECT_TRUE(found.empty());
    const std::vector<Vec3d> two = {Vec3d::Zero(), Vec3d::Ones()};
    NeighborTree(two, 1).nearest(Vec3d(1, 1, 0), 4, found);
    ASSERT_EQ(found.size(), 2u);
    EXPECT_EQ(found[0].point, 1u);
}

}  // namespace
}  // namespace strata
