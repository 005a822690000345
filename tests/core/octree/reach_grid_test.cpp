#include "core/octree/reach_grid.h"

#include <gtest/gtest.h>

#include "core/math/random.h"

namespace strata {
namespace {

// Never misses a point within reach; and leaves out most of what is far, or it would be of no use.
TEST(ReachGrid, HoldsWhatIsWithinReach) {
    Random random(1);
    for (int round = 0; round < 30; ++round) {
        const double side = std::pow(10.0, random.uniform(0.5, 9.3));
        const auto point = [&] { return Vec3i(int(random.uniform(0, side)), int(random.uniform(0, side)), int(random.uniform(0, side))); };
        std::vector<ReachGrid::Place> places;
        for (int i = 0; i < 20; ++i) {
            places.push_back({point(), Vec3d(0.05, 0.03, 0.01) * side * random.uniform()});
            if (i % 4 == 0) places.back().center.x() -= int(side / 2);  // outside
        }
        const Vec3i min = Vec3i::Constant(int(side / 4)), max = Vec3i::Constant(int(side));
        const ReachGrid grid(places, min, max);
        int held = 0, reached = 0, inside = 0;
        for (int i = 0; i < 3000; ++i) {
            const Vec3i p = point();
            if ((p.array() < min.array()).any()) continue;
            ++inside;
            bool within = false;
            for (const auto& [center, reach] : places)
                within |= ((p.cast<double>() - center.cast<double>()).array().abs() <= reach.array()).all();
            if (within) EXPECT_TRUE(grid.contains(p));
            held += grid.contains(p);
            reached += within;
        }
        if (side > 1000.0) EXPECT_LT(held - reached, inside / 10);
    }
}

TEST(ReachGrid, InfiniteReachAndNoPlaces) {
    const Vec3i min(0, 0, 0), max(INT32_MAX, INT32_MAX, INT32_MAX);
    const ReachGrid all({{Vec3i(5, 5, 5), Vec3d::Constant(std::numeric_limits<double>::infinity())}}, min, max);
    EXPECT_TRUE(all.contains(min));
    EXPECT_TRUE(all.contains(max));
    EXPECT_FALSE(ReachGrid({}, min, max).contains(min));
    EXPECT_FALSE(ReachGrid({{Vec3i(-9, 0, 0), Vec3d::Constant(8)}}, min, max).contains(min));
}

}  // namespace
}  // namespace strata
