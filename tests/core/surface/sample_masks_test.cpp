#include "core/surface/sample_masks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/math/random.h"

namespace strata {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity(), kMost = std::numeric_limits<float>::max();

// Samples of all sizes, among them the levels themselves and their neighbors.
std::vector<float> samples_around(double isovalue, size_t n, uint64_t seed) {
    Random random(seed);
    std::vector<float> samples(n);
    for (float& v : samples) {
        const float near = float(isovalue);
        switch (random.bits() % 8) {
            case 0: v = near; break;
            case 1: v = std::nextafter(near, kInfinity); break;
            case 2: v = std::nextafter(near, -kInfinity); break;
            case 3: v = std::nanf(""); break;
            case 4: v = random.bits() % 2 == 0 ? kInfinity : -kInfinity; break;
            case 5: v = random.bits() % 2 == 0 ? 0.0f : -0.0f; break;
            case 6: v = float(random.uniform(-1e30, 1e30)); break;
            default: v = float(random.uniform(-1.0, 1.0));
        }
    }
    return samples;
}

TEST(SampleMasks, LevelsCompareAsIsovaluesDo) {
    const double isovalues[] = {0.0,   -0.0,   0.1,           -0.1,   1.0,     1.0 / 3.0, 1e-50,  -1e-50,
                                1e-40, 3.4e38, double(kMost), 3.5e38, -3.5e38, 1e300,     -1e300, 16777217.0};
    for (const double isovalue : isovalues)
        for (const bool below : {false, true}) {
            const float level = level_of(isovalue, below);
            std::vector<float> samples = {0.0f,   -0.0f,   kInfinity, -kInfinity, kMost,       -kMost,
                                          1e-45f, -1e-45f, 0.1f,      -0.1f,      16777216.0f, 16777218.0f};
            for (const float v : {level, std::nextafter(level, kInfinity), std::nextafter(level, -kInfinity)}) samples.push_back(v);
            for (const float v : samples)
                EXPECT_EQ(below ? v <= level : v >= level, below ? double(v) <= isovalue : double(v) >= isovalue) << isovalue << ", " << v;
        }
}

TEST(SampleMasks, BitsAndStatisticsOfEveryInstructionSet) {
    for (const size_t n : {1, 2, 15, 16, 17, 63, 64, 65, 127, 128, 200, 512, 1000})
        for (const bool below : {false, true}) {
            const std::vector<double> isovalues = {0.1, -0.4, 0.0};
            const std::vector<float> samples = samples_around(isovalues[n % 3], n, n);
            std::vector<float> levels;
            for (const double isovalue : isovalues) levels.push_back(level_of(isovalue, below));
            const size_t words = (n + 63) / 64;
            for (const SimdLevel simd : simd_levels()) {
                std::vector<std::vector<uint64_t>> masks(3, std::vector<uint64_t>(words + 1, 0x5a5a5a5a5a5a5a5a));
                std::vector<uint64_t*> rows;
                for (auto& mask : masks) rows.push_back(mask.data());
                SampleStatistics statistics;
                find_inside(samples, levels, below, rows.data(), statistics, simd);
                uint64_t nan = 0;
                float least = kInfinity, greatest = -kInfinity;
                for (const float v : samples) {
                    nan += std::isnan(v);
                    if (v < least) least = v;
                    if (v > greatest) greatest = v;
                }
                EXPECT_EQ(statistics.nan, nan);
                EXPECT_EQ(statistics.least, least);
                EXPECT_EQ(statistics.greatest, greatest);
                for (size_t s = 0; s < 3; ++s) {
                    for (size_t i = 0; i < words * 64; ++i) {
                        const bool inside = i < n && (below ? double(samples[i]) <= isovalues[s] : double(samples[i]) >= isovalues[s]);
                        ASSERT_EQ(masks[s][i / 64] >> i % 64 & 1, uint64_t(inside)) << name_of(simd) << ", " << n << ", " << i;
                    }
                    EXPECT_EQ(masks[s][words], 0x5a5a5a5a5a5a5a5au) << "written beyond the end";
                }
            }
        }
}

}  // namespace
}  // namespace strata
