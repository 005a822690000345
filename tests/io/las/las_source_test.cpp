// Every field of every point format, from files put together by hand.
#include "io/las/las_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "core/error.h"
#include "tests/support/las_file.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

using test::LasFile;
using test::LasPoint;
using test::points_of;
using test::values_of;
using Values = std::vector<double>;

std::unique_ptr<LasSource> open(const LasFile& file) { return std::make_unique<LasSource>(memory_source("test.las", file.bytes())); }

// Values of point i, all different from field to field and reaching the ends of each type.
LasPoint sample_point(int format, int i) {
    LasPoint point;
    point.x = i == 0 ? INT32_MIN : i == 1 ? INT32_MAX : 1000 * i;
    point.y = -7 * i;
    point.z = 13 + i;
    point.intensity = uint16_t(65535 - i);
    point.return_number = uint8_t(1 + i % (format < 6 ? 7 : 15));
    point.number_of_returns = format < 6 ? 7 : 15;
    point.flags = uint8_t(format < 6 ? (i & 7) | (i & 3) << 6 : i * 37);
    point.classification = uint8_t(format < 6 ? i % 32 : 255 - i);
    point.scan_angle = int16_t(format < 6 ? i - 90 : i * 300 - 30000);
    point.user_data = uint8_t(i + 1);
    point.point_source_id = uint16_t(4000 + i);
    point.gps_time = 1e8 + i / 3.0;
    point.rgb = {uint16_t(i), uint16_t(65535 - i), uint16_t(300 * i)};
    point.nir = uint16_t(20000 + i);
    return point;
}

class EachPointFormat : public ::testing::TestWithParam<int> {};

TEST_P(EachPointFormat, DecodesEveryFieldAndExtraBytes) {
    const int format = GetParam(), count = 100;
    LasFile file{.minor_version = format < 6 ? 3 : 4, .point_format = format, .scale = {0.001, 0.5, 2.0}, .offset = {1e6, -3.0, 0.25}};
    file.vlrs.push_back({"LASF_Spec", 4, test::extra_bytes_entry("amplitude", 4, 8 | 16, {0.25}, {-1.0})});
    for (int i = 0; i < count; ++i) {
        file.records.push_back(test::las_record(format, sample_point(format, i)));
        test::put<int16_t>(file.records.back(), int16_t(-i));
    }
    const auto source = open(file);
    const CloudInfo& info = source->info();
    EXPECT_EQ(info.format, std::string("las 1.") + (format < 6 ? "3" : "4") + ", point format " + std::to_string(format));
    EXPECT_EQ(info.points, uint64_t(count));
    EXPECT_EQ(info.quantization.scale, Vec3d(0.001, 0.5, 2.0));
    EXPECT_EQ(info.quantization.offset, Vec3d(1e6, -3.0, 0.25));

    const bool gps = format != 0 && format != 2, nir = format == 8 || format == 10;
    const bool rgb = format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10;
    std::vector<std::string> names = {"intensity", "return number", "number of returns", "classification flags", "classification",
                                      format < 6 ? "scan angle rank" : "scan angle", "user data", "point source id"};
    if (gps) names.push_back("gps-time");
    if (rgb) names.push_back("rgb");
    if (nir) names.push_back("nir");
    names.push_back("amplitude");
    std::vector<std::string> found;
    for (const Attribute& attribute : info.attributes) found.push_back(attribute.name);
    ASSERT_EQ(found, names);
    EXPECT_EQ(info.attributes.back().scale, 0.25);
    EXPECT_EQ(info.attributes.back().offset, -1.0);
    EXPECT_EQ(info.attributes.back().description, "of amplitude");

    const PointBatch points = points_of(*source);
    ASSERT_EQ(points.size, size_t(count));
    std::map<std::string, Values> expected;
    for (int i = 0; i < count; ++i) {
        const LasPoint point = sample_point(format, i);
        ASSERT_EQ(points.x[size_t(i)], point.x);
        ASSERT_EQ(points.y[size_t(i)], point.y);
        ASSERT_EQ(points.z[size_t(i)], point.z);
        expected["intensity"].push_back(point.intensity);
        expected["return number"].push_back(point.return_number);
        expected["number of returns"].push_back(point.number_of_returns);
        expected["classification flags"].push_back(point.flags);
        expected["classification"].push_back(point.classification);
        expected[names[5]].push_back(point.scan_angle);
        expected["user data"].push_back(point.user_data);
        expected["point source id"].push_back(point.point_source_id);
        expected["gps-time"].push_back(point.gps_time);
        for (const uint16_t channel : point.rgb) expected["rgb"].push_back(channel);
        expected["nir"].push_back(point.nir);
        expected["amplitude"].push_back(-i);
    }
    for (const std::string& name : names) EXPECT_EQ(values_of(*source, points, name), expected[name]) << name;
}

INSTANTIATE_TEST_SUITE_P(Las, EachPointFormat, ::testing::Range(0, 11));

// Scalars and the deprecated arrays: type t holds the bytes 1, 2, 3, ... of its size.
TEST(LasExtraBytes, EveryType) {
    const std::array<size_t, 10> sizes = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    LasFile file{.minor_version = 4, .point_format = 6};
    test::LasFile::Vlr vlr{"LASF_Spec", 4, {}};
    std::vector<std::byte> record = test::las_record(6, {});
    for (int type = 1; type <= 30; ++type) {
        const auto entry = test::extra_bytes_entry("t" + std::to_string(type), type);
        vlr.payload.insert(vlr.payload.end(), entry.begin(), entry.end());
        for (size_t b = 0; b < sizes[size_t(type - 1) % 10] * size_t(1 + (type - 1) / 10); ++b) test::put<uint8_t>(record, uint8_t(type + 1));
    }
    file.vlrs = {vlr};
    file.records = {record};
    const auto source = open(file);
    const PointBatch points = points_of(*source);
    const size_t first = size_t(find_attribute(source->info().attributes, "t1"));
    for (int type = 1; type <= 30; ++type) {
        const size_t at = first + size_t(type - 1);
        const Attribute& attribute = source->info().attributes[at];
        EXPECT_EQ(attribute.name, "t" + std::to_string(type));
        EXPECT_EQ(attribute.components, 1 + (type - 1) / 10);
        EXPECT_EQ(scalar_size(attribute.type), sizes[size_t(type - 1) % 10]);
        EXPECT_EQ(points.columns[at], std::vector<std::byte>(attribute.size_bytes(), std::byte(type + 1)));
    }
    using enum ScalarType;
    const std::array types = {uint8, int8, uint16, int16, uint32, int32, uint64, int64, float32, float64};
    for (size_t i = 0; i < 30; ++i) EXPECT_EQ(source->info().attributes[first + i].type, types[i % 10]) << i + 1;
    EXPECT_TRUE(source->info().notes.empty());
}

TEST(LasExtraBytes, OptionsDecideWhatScaleOffsetAndNoDataMean) {
    LasFile file{.point_format = 0};
    std::vector<std::byte> payload;
    for (const auto& entry : {test::extra_bytes_entry("plain", 2, 0, {9.0}, {9.0}, 9), test::extra_bytes_entry("full", 2, 1 | 8 | 16, {0.5}, {-4.0}, uint64_t(-1)),
                              test::extra_bytes_entry("pair", 13, 8, {0.5, 0.25}), test::extra_bytes_entry("raw", 0, 3)})
        payload.insert(payload.end(), entry.begin(), entry.end());
    file.vlrs = {{"LASF_Spec", 4, payload}};
    std::vector<std::byte> record = test::las_record(0, {});
    for (uint8_t b = 1; b <= 2 + 4 + 3 + 5; ++b) test::put(record, b);  // five more than described
    file.records = {record};
    const auto source = open(file);
    const auto find = [&](const char* name) { return source->info().attributes.at(size_t(find_attribute(source->info().attributes, name))); };
    EXPECT_EQ(find("plain").scale, 1.0);
    EXPECT_EQ(find("plain").offset, 0.0);
    EXPECT_TRUE(std::isnan(find("plain").no_data));
    EXPECT_EQ(find("full").scale, 0.5);
    EXPECT_EQ(find("full").offset, -4.0);
    EXPECT_EQ(find("full").no_data, -1.0);
    // One attribute has one scale: an array with two becomes two attributes.
    EXPECT_EQ(find("pair[0]").scale, 0.5);
    EXPECT_EQ(find("pair[1]").scale, 0.25);
    EXPECT_EQ(find("raw").components, 3);
    const PointBatch points = points_of(*source);
    EXPECT_EQ(values_of(*source, points, "plain"), Values{1});
    EXPECT_EQ(values_of(*source, points, "full"), Values{2});
    EXPECT_EQ(values_of(*source, points, "pair[1]"), Values{0x0605});
    EXPECT_EQ(values_of(*source, points, "raw"), (Values{7, 8, 9}));
    ASSERT_EQ(source->info().notes.size(), 1u);
    EXPECT_EQ(source->info().notes[0], "5 bytes at the end of each point have no description and are left out");
}

TEST(LasExtraBytes, NamesThatAreTakenAreChanged) {
    LasFile file{.point_format = 0};
    std::vector<std::byte> payload;
    for (const char* const name : {"intensity", "a", "a", "", "position"}) {
        const auto entry = test::extra_bytes_entry(name, 1);
        payload.insert(payload.end(), entry.begin(), entry.end());
    }
    file.vlrs = {{"LASF_Spec", 4, payload}};
    file.records = {std::vector<std::byte>(25)};
    std::vector<std::string> names;
    const auto source = open(file);
    for (const Attribute& attribute : source->info().attributes) names.push_back(attribute.name);
    names.erase(names.begin(), names.begin() + 8);
    EXPECT_EQ(names, (std::vector<std::string>{"intensity 2", "a", "a 2", "extra bytes", "position 2"}));
}

TEST(LasSource, BatchesCoverAllPointsAndOnlyWantedColumnsAreFilled) {
    LasFile file{.point_format = 2};
    const size_t count = size_t(LasSource::kBatchPoints) + 1;
    for (size_t i = 0; i < count; ++i) file.records.push_back(test::las_record(2, {.x = int32_t(i), .intensity = uint16_t(i)}));
    const auto source = open(file);
    ASSERT_EQ(source->batch_count(), 2u);
    PointBatch batch;
    const int wanted[] = {0};
    source->read_batch(0, wanted, batch);
    EXPECT_EQ(batch.size, LasSource::kBatchPoints);
    EXPECT_EQ(batch.column<uint16_t>(0)[65535], 65535);
    for (size_t a = 1; a < batch.columns.size(); ++a) EXPECT_TRUE(batch.columns[a].empty());
    source->read_batch(1, wanted, batch);
    ASSERT_EQ(batch.size, 1u);
    EXPECT_EQ(batch.x[0], 65536);
}

TEST(LasSource, TheLargestRecordIsRead) {
    LasFile file{.point_format = 0};
    for (int i = 0; i < 20; ++i) {
        file.records.push_back(test::las_record(0, {.x = i, .z = -i}));
        file.records.back().resize(65535);
    }
    const PointBatch points = points_of(*open(file));
    for (int i = 0; i < 20; ++i) EXPECT_EQ(points.z[size_t(i)], -i);
}

TEST(LasSource, NoPointsIsACloudWithoutPoints) {
    const auto source = open({.point_format = 1, .record_size = 28});
    EXPECT_EQ(source->info().points, 0u);
    EXPECT_EQ(source->batch_count(), 0u);
}

// LAS 1.4: the 64-bit count counts; the old one must agree or be 0, and where it does not the user is told.
TEST(LasSource, WhichCountCounts) {
    const auto count_and_notes = [](uint32_t legacy, uint64_t count) {
        LasFile file{.minor_version = 4, .point_format = 1};
        for (int i = 0; i < 9; ++i) file.records.push_back(test::las_record(1, {}));
        std::vector<std::byte> bytes = file.bytes();
        test::poke<uint32_t>(bytes, 107, legacy);
        test::poke<uint64_t>(bytes, 247, count);
        const LasSource source(memory_source("test.las", std::move(bytes)));
        return std::pair(source.info().points, source.info().notes.size());
    };
    EXPECT_EQ(count_and_notes(9, 9), std::pair(uint64_t{9}, size_t{0}));
    EXPECT_EQ(count_and_notes(0, 9), std::pair(uint64_t{9}, size_t{0}));
    EXPECT_EQ(count_and_notes(9, 0), std::pair(uint64_t{9}, size_t{1}));
    EXPECT_EQ(count_and_notes(4, 9), std::pair(uint64_t{9}, size_t{1}));
    EXPECT_EQ(count_and_notes(0, 0), std::pair(uint64_t{0}, size_t{0}));
}

TEST(LasSource, ExtraBytesMayBeDescribedByARecordEach) {
    LasFile file{.point_format = 0};
    file.vlrs = {{"LASF_Spec", 4, test::extra_bytes_entry("height", 3)}, {"LASF_Spec", 4, test::extra_bytes_entry("width", 1)},
                 {"LASF_Spec", 4, test::extra_bytes_entry("stale", 10)}};
    file.records = {test::las_record(0, {})};
    test::put<uint16_t>(file.records[0], 700);
    test::put<uint8_t>(file.records[0], 9);
    const auto source = open(file);
    EXPECT_EQ(values_of(*source, points_of(*source), "height"), Values{700});
    EXPECT_EQ(values_of(*source, points_of(*source), "width"), Values{9});
    EXPECT_LT(find_attribute(source->info().attributes, "stale"), 0);
    EXPECT_TRUE(source->info().notes.empty());
}

TEST(LasSource, WavePacketsAreNamedAsLeftOut) {
    LasFile file{.minor_version = 3, .point_format = 4};
    file.records = {test::las_record(4, {})};
    ASSERT_EQ(open(file)->info().notes.size(), 1u);
    EXPECT_EQ(open(file)->info().notes[0], "wave packets are left out");
}

TEST(LasSource, CompressedIsToldApart) {
    LasFile by_bit{.point_format = 3};
    by_bit.records = {test::las_record(3, {})};
    std::vector<std::byte> bytes = by_bit.bytes();
    bytes[104] |= std::byte{0x80};
    LasFile by_record = by_bit;
    by_record.vlrs = {{"laszip encoded", 22204, std::vector<std::byte>(34)}};
    for (const std::vector<std::byte>& file : {bytes, by_record.bytes()}) try {
            LasSource source(memory_source("test.laz", file));
            FAIL() << "took LAZ for LAS";
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::unsupported);
        }
}

}  // namespace
}  // namespace strata
