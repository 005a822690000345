#include "core/cloud/clip_box.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include "core/math/random.h"

namespace strata {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<uint8_t> left_of(const ClipRegion& region, const std::vector<Vec3i>& points) {
    std::vector<int32_t> x, y, z;
    for (const Vec3i& p : points) x.push_back(p.x()), y.push_back(p.y()), z.push_back(p.z());
    std::vector<uint8_t> left(points.size(), 7);
    region.test(x, y, z, left);
    return left;
}

Box3d box_of(const Vec3d& min, const Vec3d& max) { return {.min = min, .max = max}; }

// A limit typed as a point's own coordinate holds the point, whatever scale and offset its file has, and neither of the
// points one quantum beside it tells it from the other: the limit is the plane, as integers see it.
TEST(ClipBox, APlaneTypedAsACoordinateHoldsItsPoint) {
    Random random(5);
    const struct {
        double scale, offset;
        int digits;
    } files[] = {{0.001, 0.0, 3}, {0.001, 500'000.0, 3}, {0.001, 5'327'925.238, 3}, {0.01, -6'378'137.0, 2}, {0.0001, 5'300'000.5, 4}, {0.00025, 4'500'000.0, 5}};
    for (const auto& [scale, offset, digits] : files)
        for (int i = 0; i < 2000; ++i) {
            const int32_t quanta = int32_t(random.uniform(-2e9, 2e9));
            // What decimal arithmetic says the coordinate is.
            const long double coordinate = static_cast<long double>(std::llround(offset * 1e6) + quanta * std::llround(scale * 1e6)) / 1e6L;
            char text[64];
            std::snprintf(text, sizeof text, "%.*Lf", digits, coordinate);
            const double typed = std::strtod(text, nullptr);
            EXPECT_EQ(first_quantum_from(typed, scale, offset), quanta) << text << " scale " << scale << " offset " << offset;
            EXPECT_EQ(last_quantum_to(typed, scale, offset), quanta) << text << " scale " << scale << " offset " << offset;
        }
}

TEST(ClipBox, LimitsBetweenQuantaHoldNeither) {
    for (const double offset : {0.0, 5'327'925.238}) {
        EXPECT_EQ(first_quantum_from(offset + 0.0013, 0.001, offset), 2);
        EXPECT_EQ(last_quantum_to(offset + 0.0013, 0.001, offset), 1);
        EXPECT_EQ(last_quantum_to(offset - 0.0013, 0.001, offset), -2);
    }
    EXPECT_EQ(first_quantum_from(-kInfinity, 0.001, 5e6), -kInfinity);
    EXPECT_EQ(last_quantum_to(kInfinity, 0.001, 5e6), kInfinity);
}

TEST(ClipBox, FacesBelongToTheBoxOfEitherKind) {
    const Quantization utm = {.scale = Vec3d::Constant(0.001), .offset = {548'000, 5'328'000, 0}};
    const Box3d box = box_of({548'000.001, 5'327'999.999, 0.005}, {548'000.003, 5'328'000.001, 0.005});
    const std::vector<Vec3i> points = {{0, 0, 5}, {1, 0, 5}, {3, 1, 5}, {4, 0, 5}, {2, -1, 5}, {2, -2, 5}, {2, 0, 4}, {2, 0, 6}};
    const std::vector<uint8_t> inside = {0, 1, 1, 0, 1, 0, 0, 0};
    EXPECT_EQ(left_of(ClipRegion({{{box, ClipBox::Action::keep}}}, utm), points), inside);
    std::vector<uint8_t> outside = inside;
    for (uint8_t& value : outside) value ^= 1;
    EXPECT_EQ(left_of(ClipRegion({{{box, ClipBox::Action::remove}}}, utm), points), outside);
}

// Any of the keeping boxes, none of the removing ones; a box where the cloud cannot be keeps nothing.
TEST(ClipBox, BoxesKeepTogetherAndRemoveEach) {
    const Quantization plain = {.scale = Vec3d::Ones(), .offset = Vec3d::Zero()};
    const auto slab = [](double low, double high, ClipBox::Action action) {
        return ClipBox{box_of({low, -kInfinity, -kInfinity}, {high, kInfinity, kInfinity}), action};
    };
    const std::vector<Vec3i> points = {{0, 0, 0}, {1, 9, 9}, {2, 0, 0}, {3, -9, 0}, {4, 0, 0}, {5, 0, 0}};
    const std::vector<ClipBox> boxes = {slab(0, 1, ClipBox::Action::keep), slab(3, 5, ClipBox::Action::keep), slab(4, 4, ClipBox::Action::remove)};
    EXPECT_EQ(left_of(ClipRegion(boxes, plain), points), (std::vector<uint8_t>{1, 1, 0, 1, 0, 1}));
    EXPECT_EQ(left_of(ClipRegion({}, plain), points), std::vector<uint8_t>(6, 1));
    EXPECT_EQ(left_of(ClipRegion({{slab(1e12, 2e12, ClipBox::Action::keep)}}, plain), points), std::vector<uint8_t>(6, 0));
    EXPECT_EQ(left_of(ClipRegion({{slab(1.25, 1.75, ClipBox::Action::keep)}}, plain), points), std::vector<uint8_t>(6, 0));
}

// What coverage promises of a box of points holds for every point of it.
TEST(ClipBox, CoverageAgreesWithThePoints) {
    Random random(11);
    const Quantization plain = {.scale = Vec3d::Constant(0.5), .offset = {10, -20, 30}};
    size_t seen[3] = {0, 0, 0};
    for (int trial = 0; trial < 3000; ++trial) {
        const auto random_box = [&](double most) {
            Box3d box;
            for (int corner = 0; corner < 2; ++corner)
                box.extend(plain.offset + Vec3d(random.uniform(-most, most), random.uniform(-most, most), random.uniform(-most, most)));
            return box;
        };
        std::vector<ClipBox> boxes;
        for (int i = 0; i < 1 + trial % 3; ++i)
            boxes.push_back({random_box(8), random.uniform(0, 1) < 0.6 ? ClipBox::Action::keep : ClipBox::Action::remove});
        const ClipRegion region(boxes, plain);
        const Box3d world = random_box(4);
        std::vector<Vec3i> points;
        for (int x = -9; x <= 9; ++x)
            for (int y = -9; y <= 9; ++y)
                for (int z = -9; z <= 9; ++z)
                    if (world.contains(plain.world_from_quanta({x, y, z}))) points.emplace_back(x, y, z);
        if (points.empty()) continue;
        const std::vector<uint8_t> left = left_of(region, points);
        const bool any = std::count(left.begin(), left.end(), 1) > 0, all = std::count(left.begin(), left.end(), 0) == 0;
        Vec3i low = points.front(), high = low;
        for (const Vec3i& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
        for (const Coverage coverage : {region.coverage(world), region.coverage(low, high)}) {
            ++seen[size_t(coverage)];
            if (coverage == Coverage::none) EXPECT_FALSE(any);
            if (coverage == Coverage::whole) EXPECT_TRUE(all);
        }
        // With a single box the answer by quanta is the tightest there is.
        if (boxes.size() == 1) {
            if (!any) EXPECT_EQ(region.coverage(low, high), Coverage::none);
            if (all) EXPECT_EQ(region.coverage(low, high), Coverage::whole);
        }
    }
    for (const size_t count : seen) EXPECT_GT(count, 100u);
}

}  // namespace
}  // namespace strata
