#include "render/sample_sums.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "render/srgb.h"

namespace strata {
namespace {

// One sample is the middle of the pixel; along either axis so many are evenly apart, each in its own place.
TEST(SampleSums, OffsetsAreEvenlyApart) {
    for (uint32_t samples = 1; samples <= 70; ++samples) {
        EXPECT_EQ(sample_offset_px(0, samples), Vec2f(0, 0));
        std::set<int> x, y;
        for (uint32_t sample = 0; sample < samples; ++sample) {
            const Vec2f offset = sample_offset_px(sample, samples);
            EXPECT_GE(offset.minCoeff(), -0.5f);
            EXPECT_LT(offset.maxCoeff(), 0.5f);
            x.insert(int(std::lround(offset.x() * float(samples))));
            y.insert(int(std::lround(offset.y() * float(samples))));
        }
        EXPECT_EQ(x.size(), samples);
        EXPECT_EQ(y.size(), samples);
    }
}

// In a plane as well: no square of a third of the pixel is without a sample of 32.
TEST(SampleSums, OffsetsLeaveNoHole) {
    for (float x = 0.0f; x < 1.0f; x += 0.05f)
        for (float y = 0.0f; y < 1.0f; y += 0.05f) {
            bool found = false;
            for (uint32_t sample = 0; sample < 32; ++sample) {
                const Vec2f offset = sample_offset_px(sample, 32) - Vec2f(x, y);
                found = found || (offset.x() - std::floor(offset.x()) < 1.0f / 3 && offset.y() - std::floor(offset.y()) < 1.0f / 3);
            }
            EXPECT_TRUE(found) << x << ' ' << y;
        }
}

TEST(SampleSums, APictureAveragedWithItselfIsItself) {
    std::vector<Rgba8> picture;
    for (int i = 0; i < 256; ++i) picture.push_back(make_rgba(uint8_t(i), uint8_t(255 - i), uint8_t(i * 7), i % 3 == 0 ? 255 : uint8_t(1 + i % 254)));
    for (const uint32_t samples : {1u, 2u, 3u, 16u, kMostSamples}) {
        SampleSums sums;
        for (uint32_t sample = 0; sample < samples; ++sample) sums.add(picture, sample == 0, 2);
        std::vector<Rgba8> out(picture.size());
        sums.average(out, 2);
        EXPECT_EQ(out, picture) << samples;
    }
}

// Light is averaged, not its code; what covers nothing has no color and takes only alpha.
TEST(SampleSums, AveragesLight) {
    const Rgba8 white = make_rgba(255, 255, 255), black = make_rgba(0, 0, 0);
    for (uint32_t covered = 0; covered <= 8; ++covered) {
        SampleSums opaque, clear;
        for (uint32_t sample = 0; sample < 8; ++sample) {
            const bool on = sample < covered;
            opaque.add(std::vector{on ? white : black}, sample == 0, 1);
            clear.add(std::vector{on ? make_rgba(10, 200, 90) : Rgba8(0)}, sample == 0, 1);
        }
        std::vector<Rgba8> out(1);
        opaque.average(out, 1);
        const auto code = uint8_t(std::lround(255.0 * srgb_from_linear(covered / 8.0)));
        EXPECT_EQ(out[0], make_rgba(code, code, code));
        clear.average(out, 1);
        EXPECT_EQ(out[0], covered == 0 ? 0 : make_rgba(10, 200, 90, uint8_t(std::lround(255.0 * covered / 8.0))));
    }
}

}  // namespace
}  // namespace strata
