#include "core/cloud/point_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"

namespace strata {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Columns of a few points, stated value by value.
struct Table {
    CloudInfo info;
    PointBatch batch;

    template <typename T>
    void add(Attribute attribute, const std::vector<T>& values) {
        batch.size = values.size() / size_t(attribute.components);
        std::vector<std::byte> bytes(values.size() * sizeof(T));
        std::memcpy(bytes.data(), values.data(), bytes.size());
        batch.columns.push_back(std::move(bytes));
        info.attributes.push_back(std::move(attribute));
    }

    std::vector<uint8_t> passing(std::vector<FilterTerm> terms, uint32_t level = 0) const {
        const PointFilter filter(info, terms);
        std::vector<uint8_t> passes(batch.size, 1);
        filter.test(batch, level, passes);
        return passes;
    }
};

using Bits = std::vector<uint8_t>;

TEST(PointFilter, BothEndsAndEveryValueOfAListPass) {
    Table table;
    table.add<uint8_t>({.name = "classification"}, {1, 2, 3, 4, 5, 6});
    EXPECT_EQ(table.passing({{"class", {{2, 2}, {6, 6}}}}), (Bits{0, 1, 0, 0, 0, 1}));
    EXPECT_EQ(table.passing({{"classification", {{2, 4}}}}), (Bits{0, 1, 1, 1, 0, 0}));
    EXPECT_EQ(table.passing({{"class", {{2.5, 3.5}}}}), (Bits{0, 0, 1, 0, 0, 0}));
    EXPECT_EQ(table.passing({{"class", {{-kInfinity, 2}}}}), (Bits{1, 1, 0, 0, 0, 0}));
    EXPECT_EQ(table.passing({{"class", {{2, 5}}}, {"class", {{4, kInfinity}}}}), (Bits{0, 0, 0, 1, 1, 0}));  // terms: all of them
    EXPECT_TRUE(PointFilter().everything());
}

TEST(PointFilter, NothingWithoutAValuePasses) {
    Table table;
    table.add<double>({.name = "gps-time", .type = ScalarType::float64}, {1.0, std::nan(""), kInfinity, -kInfinity});
    table.add<int16_t>({.name = "height", .type = ScalarType::int16, .scale = 0.01, .no_data = -9999}, {1234, -9999, 1235, 0});
    EXPECT_EQ(table.passing({{"gps-time", {{-kInfinity, kInfinity}}}}), (Bits{1, 0, 1, 1}));
    EXPECT_EQ(table.passing({{"height", {{-kInfinity, kInfinity}}}}), (Bits{1, 0, 1, 1}));
}

// Values are the attribute's own: a stored 1234 of scale 0.01 is 12.34, and the float called 0.1 is 0.1.
TEST(PointFilter, RangesEndAtValuesAsTheyAreTyped) {
    Table table;
    std::vector<int16_t> stored;
    for (int i = -3000; i <= 3000; ++i) stored.push_back(int16_t(i));
    table.add<int16_t>({.name = "height", .type = ScalarType::int16, .scale = 0.01}, stored);
    for (int i = -3000; i <= 3000; i += 7) {
        char text[32];
        std::snprintf(text, sizeof text, "%s%d.%02d", i < 0 ? "-" : "", std::abs(i) / 100, std::abs(i) % 100);
        const double value = std::strtod(text, nullptr);
        const Bits passes = table.passing({{"height", {{value, value}}}});
        EXPECT_EQ(std::count(passes.begin(), passes.end(), 1), 1) << text;
        EXPECT_EQ(passes[size_t(i + 3000)], 1) << text;
    }
    Table floats;
    floats.add<float>({.name = "range", .type = ScalarType::float32}, {0.1f, 0.2f, std::nextafter(0.2f, 1.0f), 0.3f});
    EXPECT_EQ(floats.passing({{"range", {{0.1, 0.2}}}}), (Bits{1, 1, 0, 0}));
}

TEST(PointFilter, ComponentsElevationAndLevelsCanBeAsked) {
    Table table;
    table.add<uint16_t>({.name = "rgb", .type = ScalarType::uint16, .components = 3}, {1, 2, 3, 4, 5, 6});
    table.info.quantization = {.scale = Vec3d::Constant(0.001), .offset = {0, 0, 470}};
    table.batch.z = {563, 564};
    EXPECT_EQ(table.passing({{"rgb[1]", {{5, 5}}}}), (Bits{0, 1}));
    EXPECT_EQ(table.passing({{"elevation", {{470.564, 480}}}}), (Bits{0, 1}));
    EXPECT_EQ(table.passing({{"lod", {{0, 2}}}}, 2), (Bits{1, 1}));
    EXPECT_EQ(table.passing({{"lod", {{0, 2}}}}, 3), (Bits{0, 0}));
}

TEST(PointFilter, UnknownNamesListTheKnown) {
    Table table;
    table.add<uint8_t>({.name = "classification"}, {1});
    table.add<uint16_t>({.name = "rgb", .type = ScalarType::uint16, .components = 3}, {1, 2, 3});
    for (const char* name : {"smell", "rgb", "rgb[3]", "return"}) {
        try {
            table.passing({{name, {{1, 1}}}});
            ADD_FAILURE() << name;
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::usage);
            EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
        }
    }
    try {
        table.passing({{"smell", {{1, 1}}}});
    } catch (const Error& error) {
        EXPECT_NE(std::string(error.what()).find("elevation, lod, classification, rgb"), std::string::npos) << error.what();
    }
}

// What the cloud states of an attribute's values spares reading it, where these leave no doubt.
TEST(PointFilter, StatedRangesProveThatNothingPasses) {
    Table table;
    table.add<uint8_t>({.name = "classification"}, {2});
    table.add<double>({.name = "gps-time", .type = ScalarType::float64}, {1e6});
    const auto nothing = [&](FilterTerm term) { return PointFilter(table.info, std::vector{std::move(term)}).nothing(); };
    EXPECT_FALSE(nothing({"class", {{7, 7}}}));
    table.info.attribute_min = {{2}, {1e6}};
    table.info.attribute_max = {{6}, {2e6}};
    EXPECT_TRUE(nothing({"class", {{7, 7}, {0, 1}}}));
    EXPECT_FALSE(nothing({"class", {{6, 9}}}));
    EXPECT_FALSE(nothing({"class", {{3, 3}}}));
    EXPECT_TRUE(nothing({"gps-time", {{3e6, 4e6}}}));
    EXPECT_FALSE(nothing({"gps-time", {{2'000'001, 4e6}}}));  // such a number may have been rounded
    table.info.attribute_min = {{}, {}};
    EXPECT_FALSE(nothing({"class", {{7, 7}}}));
}

}  // namespace
}  // namespace strata
