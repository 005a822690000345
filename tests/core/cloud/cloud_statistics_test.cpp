#include "core/cloud/cloud_statistics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/cloud/rgb_depth.h"

namespace strata {
namespace {

// Points made up by a function of their index, in batches of seven.
class MadeUpSource : public PointSource {
public:
    explicit MadeUpSource(uint64_t points, uint16_t brightest) : brightest_(brightest) {
        info_.points = points;
        info_.quantization = {.scale = Vec3d(0.5, 1.0, 2.0), .offset = Vec3d(100.0, 0.0, -1.0)};
        info_.attributes = {{.name = "return number", .description = {}}, {.name = "classification", .description = {}},
                            {.name = "rgb", .description = {}, .type = ScalarType::uint16, .components = 3},
                            {.name = "height", .description = {}, .type = ScalarType::float32, .scale = -2.0, .offset = 1.0, .no_data = -9999.0}};
    }
    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return (info_.points + 6) / 7; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        const size_t size = size_t(std::min<uint64_t>(7, info_.points - index * 7));
        resize_batch(out, size, info_.attributes, wanted);
        for (size_t i = 0; i < size; ++i) {
            const uint64_t n = index * 7 + i;
            out.x[i] = int32_t(n), out.y[i] = -int32_t(n), out.z[i] = int32_t(n % 5);
            for (const int a : wanted) switch (a) {
                    case 0: out.columns[0][i] = std::byte(1 + n % 2); break;
                    case 1: out.columns[1][i] = std::byte(n % 3 == 0 ? 2 : 255); break;
                    case 2:
                        for (size_t c = 0; c < 3; ++c) out.column<uint16_t>(2)[3 * i + c] = n + 1 == info_.points ? brightest_ : 0;
                        break;
                    case 3: out.column<float>(3)[i] = n == 0 ? NAN : n == 1 ? -9999.0f : float(n); break;
                }
        }
    }

private:
    CloudInfo info_;
    uint16_t brightest_;
};

TEST(CloudStatistics, AreThoseOfEveryPoint) {
    for (const int threads : {1, 2, 7}) {
        const CloudStatistics found = measure_cloud(MadeUpSource(1000, 255), threads);
        EXPECT_EQ(found.points, 1000u);
        EXPECT_EQ(found.bounds.min, Vec3d(100.0, -999.0, -1.0));
        EXPECT_EQ(found.bounds.max, Vec3d(100.0 + 499.5, 0.0, 7.0));
        EXPECT_EQ(found.points_by_return[1], 500u);
        EXPECT_EQ(found.points_by_return[2], 500u);
        EXPECT_EQ(found.points_by_class[2], 334u);
        EXPECT_EQ(found.points_by_class[255], 666u);
        EXPECT_EQ(found.rgb_bits, 8);
        // NaN and "no data" are no values; a negative scale turns the range round.
        EXPECT_EQ(found.ranges[3][0].min, 999.0 * -2.0 + 1.0);
        EXPECT_EQ(found.ranges[3][0].max, 2.0 * -2.0 + 1.0);
    }
}

TEST(CloudStatistics, OfNoPointsAreEmpty) {
    const CloudStatistics found = measure_cloud(MadeUpSource(0, 0), 2);
    EXPECT_EQ(found.points, 0u);
    EXPECT_TRUE(found.bounds.empty());
    EXPECT_TRUE(found.ranges[3][0].empty());
}

// One channel of the last point decides.
TEST(RgbDepth, IsThatOfTheBrightestPoint) {
    const std::pair<uint16_t, int> cases[] = {{0, 0}, {1, 8}, {255, 8}, {256, 16}, {65535, 16}};
    for (const auto& [brightest, bits] : cases)
        for (const int threads : {1, 3}) {
            EXPECT_EQ(rgb_depth(MadeUpSource(100, brightest), threads), bits) << brightest;
            EXPECT_EQ(measure_cloud(MadeUpSource(100, brightest), threads).rgb_bits, bits) << brightest;
        }
    EXPECT_EQ(rgb_depth(MadeUpSource(0, 0), 1), 0);
}

}  // namespace
}  // namespace strata
