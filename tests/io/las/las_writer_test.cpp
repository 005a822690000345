#include "io/las/las_writer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/error.h"
#include "io/las/laz_source.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

class LasWriterTest : public testing::Test {
protected:
    LasWriterTest() : folder_(fs::temp_directory_path() / ("strata_las_writer_" + std::to_string(::getpid()))) {
        fs::create_directories(folder_);
    }
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
    settings.attributes = {named("intensity", ScalarType::uint16),
                           named("return number", ScalarType::uint8),
                           named("number of returns", ScalarType::uint8),
                           named("classification flags", ScalarType::uint8),
                           named("classification", ScalarType::uint8),
                           named("scan angle", ScalarType::int16),
                           named("point source id", ScalarType::uint16),
                           named("gps-time", ScalarType::float64),
                           named("rgb", ScalarType::uint16, 3)};
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
    const double expected[] = {
        0.001,       0.01, 0.1, 1000, 2000, -5, 2'000'000'000 * 0.001 + 1000, -7 * 0.001 + 1000, 50 * 0.01 + 2000, -60 * 0.01 + 2000,
        1 * 0.1 - 5, -5};
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

TEST_F(LasWriterTest, PointFormatsThatAreNotWrittenAreRefused) {
    for (const int format : {-1, 4, 5, 9, 10, 11}) {
        LasWriterSettings settings = two_point_settings();
        settings.point_format = format;
        EXPECT_THROW(LasWriter(path(), settings), Error) << format;
    }
    EXPECT_TRUE(fs::is_empty(folder_));
}

// Point formats 0 to 3 are older than 1.4: their version, header and counts are those of LAS 1.2.
TEST_F(LasWriterTest, OldPointFormatsGoToAnOldVersion) {
    LasWriterSettings settings;
    settings.point_format = 3;
    settings.attributes = {named("return number", ScalarType::uint8), named("scan angle rank", ScalarType::int8),
                           named("gps-time", ScalarType::float64)};
    settings.adjusted_gps_time = false;
    PointBatch batch;
    const int all[] = {0, 1, 2};
    resize_batch(batch, 3, settings.attributes, all);
    batch.x = {1, 2, 3};
    for (size_t i = 0; i < 3; ++i) batch.column<uint8_t>(0)[i] = uint8_t(i == 2 ? 7 : i);  // 0, 1, 7
    batch.column<double>(2)[2] = 1e8;
    LasWriter writer(path(), settings, 3);
    writer.write(batch);
    writer.finish();
    const std::vector<char> file = bytes();
    ASSERT_EQ(file.size(), 227u + 3 * 34);
    EXPECT_EQ(file[25], 2);
    EXPECT_EQ(at<uint16_t>(file, 6), 0);
    EXPECT_EQ(at<uint16_t>(file, 94), 227);
    EXPECT_EQ(at<uint32_t>(file, 96), 227u);
    EXPECT_EQ(file[104], 3);
    EXPECT_EQ(at<uint32_t>(file, 107), 3u);
    const uint32_t by_return[] = {1, 0, 0, 0, 0};  // return 0 is none, and 7 has no room here
    for (size_t i = 0; i < 5; ++i) EXPECT_EQ(at<uint32_t>(file, 111 + 4 * i), by_return[i]) << i;
}

TEST_F(LasWriterTest, WhatOldVersionsDoNotKnowTakesTheNewOne) {
    LasWriterSettings settings;
    settings.point_format = 1;
    settings.crs_wkt = "LOCAL_CS[\"test\"]";
    LasWriter(path(), settings).finish();
    EXPECT_EQ(bytes()[25], 4);
    EXPECT_EQ(at<uint16_t>(bytes(), 6), 17);  // the WKT counts
    settings.crs_wkt.clear();
    settings.overwrite = true;
    settings.compressed = true;  // reserves no room
    LasWriter(path(), settings, uint64_t{1} << 32).finish();
    EXPECT_EQ(bytes()[25], 4);
    LasWriter(path(), settings, (uint64_t{1} << 32) - 1).finish();
    EXPECT_EQ(bytes()[25], 2);
}

// GeoTIFF keys are the way of the old formats, WKT that of the new; some files of old formats have both.
TEST_F(LasWriterTest, GeoTiffKeysStayInOldPointFormats) {
    LasWriterSettings settings;
    settings.crs_records = {{34735, std::vector<std::byte>(16, std::byte(7))}, {34737, std::vector<std::byte>(5, std::byte('x'))}};
    settings.overwrite = true;
    settings.point_format = 2;
    LasWriter(path(), settings).finish();
    ASSERT_EQ(bytes().size(), 227u + 54 + 16 + 54 + 5);
    EXPECT_EQ(bytes()[25], 2);
    EXPECT_EQ(at<uint16_t>(bytes(), 6), 1);  // no WKT
    EXPECT_EQ(at<uint32_t>(bytes(), 100), 2u);
    EXPECT_EQ(at<uint16_t>(bytes(), 227 + 18), 34735);
    EXPECT_EQ(bytes()[227 + 54 + 15], 7);
    EXPECT_EQ(at<uint16_t>(bytes(), 227 + 54 + 16 + 18), 34737);

    settings.crs_wkt = "LOCAL_CS[\"test\"]";
    LasWriter(path(), settings).finish();
    EXPECT_EQ(bytes()[25], 2);
    EXPECT_EQ(at<uint16_t>(bytes(), 6), 1);  // LAS 1.2 has no bit for it
    EXPECT_EQ(at<uint32_t>(bytes(), 100), 3u);
    EXPECT_EQ(at<uint16_t>(bytes(), 227 + 54 + 16 + 54 + 5 + 18), 2112);

    settings.point_format = 6;
    LasWriter(path(), settings).finish();
    EXPECT_EQ(at<uint16_t>(bytes(), 6), 17);
    EXPECT_EQ(at<uint32_t>(bytes(), 100), 1u);
    EXPECT_EQ(at<uint16_t>(bytes(), 375 + 18), 2112);
}

// A VLR holds 65,535 bytes; a longer text goes behind the points.
TEST_F(LasWriterTest, LongTextsGoBehindThePoints) {
    for (const bool compressed : {false, true})
        for (const size_t size : {65534u, 65535u, 100'000u}) {
            LasWriterSettings settings = two_point_settings();
            settings.compressed = compressed;
            settings.overwrite = true;
            settings.crs_wkt = "LOCAL_CS[\"" + std::string(size - 12, 'x') + "\"]";
            LasWriter writer(path(), settings);
            writer.write(two_points(settings));
            writer.finish();
            EXPECT_EQ(at<uint32_t>(bytes(), 243), size > 65534 ? 1u : 0u);
            const auto source = open_las(open_file(path()));
            EXPECT_EQ(source->info().crs, settings.crs_wkt);
            EXPECT_EQ(test::points_of(*source).x, two_points(settings).x);
        }
}

// Unknown times: a week has 604,800 seconds, so whatever lies beyond is no second of the week.
TEST_F(LasWriterTest, WhatKindOfTimeFollowsFromTheTimes) {
    LasWriterSettings settings = two_point_settings();
    settings.adjusted_gps_time.reset();
    settings.overwrite = true;
    for (const auto& [time, adjusted] :
         {std::pair(0.0, false), std::pair(604'800.0, false), std::pair(604'801.0, true), std::pair(-1.0, true), std::pair(4e8, true)}) {
        PointBatch batch = two_points(settings);
        batch.column<double>(7)[1] = time;
        LasWriter writer(path(), settings);
        writer.write(batch);
        writer.finish();
        EXPECT_EQ(at<uint16_t>(bytes(), 6), 16 + adjusted) << time;
    }
}

TEST_F(LasWriterTest, ExtraBytesSayWhatThePointsHold) {
    LasWriterSettings settings;
    settings.point_format = 6;
    settings.attributes = {{.name = "height", .description = "", .type = ScalarType::int16, .scale = 0.5, .no_data = -1.0},
                           named("pair", ScalarType::float32, 2)};
    PointBatch batch;
    const int all[] = {0, 1};
    resize_batch(batch, 3, settings.attributes, all);
    const int16_t heights[] = {7, -1, -20};
    const float pairs[] = {1.0f, NAN, -2.5f, NAN, 0.5f, NAN};
    std::copy_n(heights, 3, batch.column<int16_t>(0).data());
    std::copy_n(pairs, 6, batch.column<float>(1).data());
    LasWriter writer(path(), settings);
    writer.write(batch);
    writer.write(batch);
    writer.finish();
    const std::vector<char> file = bytes();
    const size_t entry = 375 + 54;
    EXPECT_EQ(file[entry + 3], 1 | 2 | 4 | 8);
    EXPECT_EQ(at<int64_t>(file, entry + 64), -20);
    EXPECT_EQ(at<int64_t>(file, entry + 88), 7);
    EXPECT_EQ(file[entry + 192 + 3], 2 | 4);
    EXPECT_EQ(at<double>(file, entry + 192 + 64), -2.5);
    EXPECT_EQ(at<double>(file, entry + 192 + 88), 1.0);
    EXPECT_EQ(file[entry + 2 * 192 + 3], 0);  // no point has a second value
}

// Batches of any size and any threads make the same file, and the file the same points.
TEST_F(LasWriterTest, TheFileDoesNotDependOnBatchesOrThreads) {
    for (const bool compressed : {false, true})
        for (const int format : {3, 8}) {
            LasWriterSettings settings;
            settings.point_format = format;
            settings.compressed = compressed;
            settings.overwrite = true;
            settings.attributes = {named("intensity", ScalarType::uint16), named("gps-time", ScalarType::float64),
                                   named("name", ScalarType::uint32)};
            std::vector<char> first;
            for (const auto& [batch_points, round, threads] :
                 {std::tuple(120'001u, 1u, 1), std::tuple(7001u, 5u, 3), std::tuple(50'000u, 2u, 2), std::tuple(1000u, 1u, 2)}) {
                settings.threads = threads;
                LasWriter writer(path(), settings, 120'001);
                std::vector<PointBatch> batches;
                const int all[] = {0, 1, 2};
                for (uint32_t begin = 0; begin < 120'001; begin += batch_points) {
                    const uint32_t size = std::min(batch_points, 120'001 - begin);
                    PointBatch& batch = batches.emplace_back();
                    resize_batch(batch, size, settings.attributes, all);
                    for (uint32_t i = 0; i < size; ++i) {
                        const uint32_t n = begin + i;
                        batch.x[i] = int32_t(n % 317);
                        batch.y[i] = -int32_t(n / 317);
                        batch.z[i] = int32_t(n * 2654435761u >> 22);
                        batch.column<uint16_t>(0)[i] = uint16_t(n);
                        batch.column<double>(1)[i] = n * 0.25;
                        batch.column<uint32_t>(2)[i] = n;
                    }
                    if (batches.size() < round && begin + size < 120'001) continue;
                    writer.write(batches);
                    batches.clear();
                }
                writer.finish();
                if (first.empty()) first = bytes();
                EXPECT_TRUE(first == bytes()) << "format " << format << ", batches of " << batch_points;
            }
            const auto source = open_las(open_file(path()));
            EXPECT_EQ(source->info().points, 120'001u);
            const PointBatch points = test::points_of(*source);
            const std::vector<double> names = test::values_of(*source, points, "name"),
                                      times = test::values_of(*source, points, "gps-time");
            ASSERT_EQ(names.size(), 120'001u);
            for (size_t i = 0; i < names.size(); ++i)
                ASSERT_TRUE(names[i] == double(i) && times[i] == 0.25 * double(i) && points.x[i] == int32_t(i % 317)) << i;
        }
}

TEST_F(LasWriterTest, NoPointsCompressed) {
    for (const int format : {0, 6}) {
        LasWriterSettings settings;
        settings.point_format = format;
        settings.compressed = true;
        settings.overwrite = true;
        LasWriter(path(), settings).finish();
        EXPECT_EQ(open_las(open_file(path()))->info().points, 0u);
        EXPECT_EQ(test::points_of(*open_las(open_file(path()))).size, 0u);
    }
}

TEST_F(LasWriterTest, WhatDoesNotFitLeavesNothing) {
    {
        LasWriterSettings settings = two_point_settings();
        PointBatch batch = two_points(settings);
        batch.column<uint8_t>(1)[1] = 16;
        LasWriter writer(path(), settings);
        EXPECT_THROW(writer.write(batch), Error);
    }
    EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace strata
