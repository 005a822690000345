#include "core/cloud/point_spacing.h"

#include <gtest/gtest.h>

#include "core/math/random.h"
#include "tests/support/memory_source.h"

namespace strata {
namespace {

double middle(const std::vector<double>& spacings) { return spacings[spacings.size() / 2]; }

// Of points of chance the distance of the 12th stands for their density; on a grid of side 1, 12 neighbors are within 2.
TEST(PointSpacing, IsThatOfThePoints) {
    std::vector<Vec3i> grid, chance;
    Random random(2);
    for (int x = 0; x < 200; ++x)
        for (int y = 0; y < 200; ++y) {
            grid.push_back(Vec3i(100 * x, 100 * y, 5000));  // 0.1
            chance.push_back(Vec3i(int(random.uniform(0, 20'000)), int(random.uniform(0, 20'000)), 5000));
        }
    for (const std::vector<Vec3i>& points : {grid, chance}) {
        const MemorySource source(points);
        const std::vector<double> spacings = measure_point_spacings(source, source.info().bounds, 2);
        EXPECT_GT(spacings.size(), 3500u);
        EXPECT_TRUE(std::is_sorted(spacings.begin(), spacings.end()));
        EXPECT_NEAR(middle(spacings), 0.1, 0.01);
        EXPECT_EQ(spacings, measure_point_spacings(source, source.info().bounds, 5));
    }
}

// Of more points than are looked at, a share tells as much.
TEST(PointSpacing, OfManyPoints) {
    std::vector<Vec3i> points;
    Random random(7);
    for (int i = 0; i < 4'000'000; ++i) points.push_back(Vec3i(int(random.uniform(0, 200'000)), int(random.uniform(0, 200'000)), 0));
    const MemorySource source(std::move(points));
    EXPECT_NEAR(middle(measure_point_spacings(source, source.info().bounds, 2)), 0.1, 0.01);
}

TEST(PointSpacing, OfFewPoints) {
    const MemorySource two({Vec3i(1, 2, 3), Vec3i(4, 5, 6)});
    EXPECT_TRUE(measure_point_spacings(two, two.info().bounds, 1).empty());
    const MemorySource equal(std::vector<Vec3i>(1000, Vec3i(1, 2, 3)));
    EXPECT_EQ(measure_point_spacings(equal, equal.info().bounds, 1).back(), 0.0);
}

}  // namespace
}  // namespace strata
