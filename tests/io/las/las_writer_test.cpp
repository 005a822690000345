#include "io/las/las_writer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/error.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

class LasWriterTest : public testing::Test {
protected:
    LasWriterTest() : folder_(fs::temp_directory_path() / ("strata_las_writer_" + std::to_string(::getpid()))) { fs::create_directories(folder_); }
    ~LasWriterTest() override { fs::remove_all(folder_); }

    std::string path() const { return (folder_ / "out.las").string(); }
    std::vector<char> bytes() const {
        std::ifstream in(path(), std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    template <typename T>
    static T at(const std::vector<char>& bytes, size_t position) {
        T value;
        std::memcpy(&value, bytes.data() + position, sizeof value);
        return value;
    }

    fs::path folder_;
};

Attribute named(std::string_view name, ScalarType type, int components = 1) {
    Attribute attribute;
    attribute.name = name;
    attribute.type = type;
    attribute.components = components;
    return attribute;
}

LasWriterSettings two_point_settings() {
    LasWriterSettings settings;
    settings.quantization = {.scale = Vec3d(0.001, 0.01, 0.1), .offset = Vec3d(1000, 2000, -5)};
    settings.crs_wkt = "LOCAL_CS[\"test\"]";
    settings.attributes = {named("intensity", ScalarType::uint16), named("return number", ScalarType::uint8), named("number of returns", ScalarType::uint8),
                           named("classification flags", ScalarType::uint8), named("classification", ScalarType::uint8), named("scan angle", ScalarType::int16),
                           named("point source id", ScalarType::uint16), named("gps-time", ScalarType::float64), named("rgb", ScalarType::uint16, 3)};
    settings.creation_day = 32;
    settings.creation_year = 2026;
    return settings;
}

PointBatch two_points(const LasWriterSettings& settings) {
    PointBatch batch;
    const int all[] = {0, 1, 2, 3, 4, 5, 6, 7, 8};
    resize_batch(batch, 2, settings.attributes, all);
    batch.x = {-7, 2'000'000'000};
    batch.y = {50, -60};
    batch.z = {0, 1};
    batch.column<uint16_t>(0)[1] = 0xabcd;
    batch.column<uint8_t>(1)[0] = 1, batch.column<uint8_t>(1)[1] = 3;
    batch.column<uint8_t>(2)[0] = 1, batch.column<uint8_t>(2)[1] = 5;
    batch.column<uint8_t>(3)[1] = 0xc1;
    batch.column<uint8_t>(4)[1] = 14;
    batch.column<int16_t>(5)[1] = -4000;
    batch.column<uint16_t>(6)[1] = 77;
    batch.column<double>(7)[1] = 4e8 + 0.125;
    for (size_t i = 0; i < 3; ++i) batch.column<uint16_t>(8)[3 + i] = uint16_t(1000 * (i + 1));
    return batch;
}

// Every byte offset below is that of the specification's tables for the header, the VLR and point format 7.
TEST_F(LasWriterTest, HeaderAndRecordsAreWhereTheSpecificationHasThem) {
    const LasWriterSettings settings = two_point_settings();
    LasWriter writer(path(), settings, 2);
    writer.write(two_points(settings));
    EXPECT_FALSE(fs::exists(path()));  // not before it is whole
    writer.finish();

    const std::vector<char> file = bytes();
    const size_t points = 375 + 54 + settings.crs_wkt.size() + 1;
    ASSERT_EQ(file.size(), points + 2 * 36);
    EXPECT_EQ(std::string(file.data(), 4), "LASF");
    EXPECT_EQ(at<uint16_t>(file, 6), 17);  // WKT and adjusted time
    EXPECT_EQ(file[24], 1);
    EXPECT_EQ(file[25], 4);
    EXPECT_EQ(at<uint16_t>(file, 90), 32);
    EXPECT_EQ(at<uint16_t>(file, 92), 2026);
    EXPECT_EQ(at<uint16_t>(file, 94), 375);
    EXPECT_EQ(at<uint32_t>(file, 96), points);
    EXPECT_EQ(at<uint32_t>(file, 100), 1u);
    EXPECT_EQ(file[104], 7);
    EXPECT_EQ(at<uint16_t>(file, 105), 36);
    for (size_t i = 107; i < 131; ++i) EXPECT_EQ(file[i], 0);  // counts of older versions
    const double expected[] = {0.001, 0.01, 0.1, 1000, 2000, -5, 2'000'000'000 * 0.001 + 1000, -7 * 0.001 + 1000, 50 * 0.01 + 2000, -60 * 0.01 + 2000, 1 * 0.1 - 5, -5};
    for (size_t i = 0; i < std::size(expected); ++i) EXPECT_EQ(at<double>(file, 131 + 8 * i), expected[i]) << i;
    for (size_t i = 227; i < 247; ++i) EXPECT_EQ(file[i], 0);  // no waveforms, no extended VLRs
    EXPECT_EQ(at<uint64_t>(file, 247), 2u);
    for (size_t i = 0; i < 15; ++i) EXPECT_EQ(at<uint64_t>(file, 255 + 8 * i), i == 0 || i == 2 ? 1u : 0u) << i;

    EXPECT_STREQ(file.data() + 377, "LASF_Projection");
    EXPECT_EQ(at<uint16_t>(file, 393), 2112);
    EXPECT_EQ(at<uint16_t>(file, 395), settings.crs_wkt.size() + 1);
    EXPECT_STREQ(file.data() + 429, settings.crs_wkt.c_str());

    const size_t second = points + 36;
    EXPECT_EQ(at<int32_t>(file, points), -7);
    EXPECT_EQ(at<int32_t>(file, second), 2'000'000'000);
    EXPECT_EQ(at<int32_t>(file, second + 4), -60);
    EXPECT_EQ(at<int32_t>(file, second + 8), 1);
    EXPECT_EQ(at<uint16_t>(file, second + 12), 0xabcd);
    EXPECT_EQ(at<uint8_t>(file, second + 14), 0x53);  // return 3 of 5
    EXPECT_EQ(at<uint8_t>(file, second + 15), 0xc1);
    EXPECT_EQ(at<uint8_t>(file, second + 16), 14);
    EXPECT_EQ(at<uint8_t>(file, second + 17), 0);
    EXPECT_EQ(at<int16_t>(file, second + 18), -4000);
    EXPECT_EQ(at<uint16_t>(file, second + 20), 77);
    EXPECT_EQ(at<double>(file, second + 22), 4e8 + 0.125);
    EXPECT_EQ(at<uint16_t>(file, second + 30), 1000);
    EXPECT_EQ(at<uint16_t>(file, second + 34), 3000);
}

TEST_F(LasWriterTest, NoPointsIsAFileToo) {
    LasWriter(path(), two_point_settings()).finish();
    const std::vector<char> file = bytes();
    ASSERT_GE(file.size(), 375u);
    EXPECT_EQ(at<uint64_t>(file, 247), 0u);
    EXPECT_EQ(at<double>(file, 179), 0.0);
}

TEST_F(LasWriterTest, UnfinishedLeavesNothing) {
    {
        const LasWriterSettings settings = two_point_settings();
        LasWriter writer(path(), settings);
        writer.write(two_points(settings));
    }
    EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(LasWriterTest, AnExistingFileIsKeptUnlessAskedOtherwise) {
    LasWriterSettings settings = two_point_settings();
    LasWriter(path(), settings).finish();
    const std::vector<char> before = bytes();
    EXPECT_THROW(LasWriter(path(), settings), Error);
    EXPECT_EQ(bytes(), before);
    settings.overwrite = true;
    LasWriter writer(path(), settings);
    writer.write(two_points(settings));
    writer.finish();
    EXPECT_EQ(bytes().size(), before.size() + 72);
}

TEST_F(LasWriterTest, WhatHasNoFieldIsRefused) {
    LasWriterSettings settings = two_point_settings();
    settings.point_format = 6;  // no color
    EXPECT_THROW(LasWriter(path(), settings), Error);
    settings.point_format = 3;
    EXPECT_THROW(LasWriter(path(), settings), Error);
    settings.point_format = 7;
    settings.attributes[0].type = ScalarType::float32;
    EXPECT_THROW(LasWriter(path(), settings), Error);
    EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace strata
