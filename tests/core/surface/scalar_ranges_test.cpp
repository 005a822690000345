#include "core/surface/scalar_ranges.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace strata {
namespace {

class CountedPieces : public SurfaceSink {
public:
    void add(const SurfacePiece& piece) override {
        ++pieces;
        vertices += piece.positions.size();
    }
    size_t pieces = 0, vertices = 0;
};

// Over all pieces, of what is finite alone; pieces go on as they are, those without vertices too.
TEST(ScalarRanges, AreThoseOfAllPieces) {
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
    CountedPieces found;
    ScalarRanges ranges(found, {"height", "unknown"});
    ASSERT_EQ(ranges.ranges().size(), 2u);
    EXPECT_FALSE(ranges.ranges()[0].known());
    const std::vector<Vec3f> positions(3, Vec3f::Zero());
    const std::vector<float> first = {-3.5f, kNan, -7.0f}, second = {kInfinity, -4.0f, -kInfinity}, nothing = {kNan, kNan, kNan};
    for (const std::vector<float>& values : {first, second}) {
        const std::vector<VertexScalars> scalars = {{"height", values}, {"unknown", nothing}};
        ranges.add({.positions = positions, .scalars = scalars});
    }
    ranges.add({});
    EXPECT_EQ(found.pieces, 3u);
    EXPECT_EQ(found.vertices, 6u);
    const ScalarRanges::Range &height = ranges.ranges()[0], &unknown = ranges.ranges()[1];
    EXPECT_EQ(height.name, "height");
    EXPECT_TRUE(height.known());
    EXPECT_EQ(height.least, -7.0f);
    EXPECT_EQ(height.greatest, -3.5f);
    EXPECT_EQ(height.unknown, 3u);
    EXPECT_FALSE(unknown.known());
    EXPECT_EQ(unknown.unknown, 6u);
}

// Seconds of GPS, of which floats tell only every 32nd; heights and classes are told well enough.
TEST(ScalarRanges, WhatFloatsDoNotTellApart) {
    const auto is_coarse = [](std::vector<float> values) {
        ScalarRanges::Range range;
        range.add(values);
        return range.is_coarse();
    };
    EXPECT_TRUE(is_coarse({275'090'611.6f, 275'090'660.9f}));
    EXPECT_TRUE(is_coarse({275'090'611.6f, 275'090'611.7f}));
    EXPECT_FALSE(is_coarse({480.0f, 512.0f}));
    EXPECT_FALSE(is_coarse({2.0f, 2.0f}));
    EXPECT_FALSE(is_coarse({std::numeric_limits<float>::quiet_NaN()}));
    ScalarRanges::Range range;
    range.add(std::vector<float>{275'090'611.6f});
    EXPECT_EQ(range.step(), 32.0f);
}

}  // namespace
}  // namespace strata
