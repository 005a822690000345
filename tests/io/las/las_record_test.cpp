#include "io/las/las_record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "core/error.h"
#include "io/byte_source.h"
#include "io/las/las_columns.h"
#include "io/las/las_extra_bytes.h"
#include "io/las/las_layout.h"
#include "tests/support/las_file.h"

namespace strata::las {
namespace {

using test::LasPoint;

std::vector<ExtraAttribute> parse_extra_bytes(int point_format, size_t record_size, std::vector<std::byte> payload) {
    Header header;
    header.point_format = point_format;
    header.record_size = uint16_t(record_size);
    header.records = {{.user_id = "LASF_Spec", .record_id = 4, .offset = 0, .size = payload.size()}};
    std::vector<std::string> notes;
    std::vector<ExtraAttribute> extra = read_extra_bytes(*memory_source("test.las", std::move(payload)), header, notes);
    EXPECT_TRUE(notes.empty());
    return extra;
}

PointBatch decode(const Columns& columns, std::span<const std::byte> records, size_t record_size) {
    std::vector<int> all(columns.attributes().size());
    for (size_t i = 0; i < all.size(); ++i) all[i] = int(i);
    PointBatch batch;
    resize_batch(batch, records.size() / record_size, columns.attributes(), all);
    columns.decode(records, all, 0, batch);
    return batch;
}

std::vector<std::byte> encode(const RecordFields& fields, const PointBatch& batch) {
    std::vector<std::byte> records(batch.size * fields.record_size(), std::byte(0xEE));
    fields.encode(batch, 0, records);
    return records;
}

// What the octree builder makes of a batch.
std::vector<std::byte> pack(const PointBatch& batch, const std::vector<Attribute>& attributes, const Vec3i& origin) {
    std::vector<std::byte> packed;
    for (size_t i = 0; i < batch.size; ++i) {
        test::put(packed, uint32_t(batch.x[i]) - uint32_t(origin.x()));
        test::put(packed, uint32_t(batch.y[i]) - uint32_t(origin.y()));
        test::put(packed, uint32_t(batch.z[i]) - uint32_t(origin.z()));
        for (size_t a = 0; a < attributes.size(); ++a) {
            const size_t size = attributes[a].size_bytes();
            packed.insert(packed.end(), batch.columns[a].begin() + ptrdiff_t(i * size),
                          batch.columns[a].begin() + ptrdiff_t((i + 1) * size));
        }
    }
    return packed;
}

std::vector<std::byte> every_extra_type() {
    std::vector<std::byte> payload;
    const auto add = [&](const std::vector<std::byte>& entry) { payload.insert(payload.end(), entry.begin(), entry.end()); };
    for (int type = 1; type <= 30; ++type) add(test::extra_bytes_entry("t" + std::to_string(type), type));
    add(test::extra_bytes_entry("scaled", 14, 1 | 8 | 16, {0.25, 0.25}, {-3.0, -3.0}, uint64_t(-32768)));
    add(test::extra_bytes_entry("apart", 23, 8 | 16, {0.5, 0.5, 0.25}, {1.0, 1.0, 1.0}));
    add(test::extra_bytes_entry("raw", 0, 7));
    return payload;
}

class EachWrittenFormat : public testing::TestWithParam<int> {};

// Random bytes are all valid records of a format: every value of every field, in every combination, comes back.
TEST_P(EachWrittenFormat, AnyRecordComesBackByteForByte) {
    const int format = GetParam();
    constexpr size_t kCount = 3000;
    const size_t extra_size = 3 * (1 + 1 + 2 + 2 + 4 + 4 + 8 + 8 + 4 + 8) * 2 + 2 * 2 + 3 * 2 + 7;
    const size_t record_size = point_layout(format).size + extra_size;
    std::mt19937 random(uint32_t(format) + 1);
    std::vector<std::byte> records(kCount * record_size);
    for (std::byte& byte : records) byte = std::byte(random());

    const Columns columns(format, record_size, parse_extra_bytes(format, record_size, every_extra_type()));
    const PointBatch batch = decode(columns, records, record_size);
    EXPECT_EQ(point_format_for(columns.attributes(), false), format);
    const RecordFields fields(format, columns.attributes());
    ASSERT_EQ(fields.record_size(), record_size);
    EXPECT_TRUE(fields.notes().empty()) << fields.notes()[0];
    EXPECT_EQ(encode(fields, batch), records);

    std::vector<std::byte> from_packed(records.size(), std::byte(0xEE));
    const Vec3i origin(-2'000'000'000, 17, 2'000'000'000);  // the differences wrap around, and back
    fields.encode(pack(batch, columns.attributes(), origin), origin, from_packed);
    EXPECT_EQ(from_packed, records);

    // The description comes back, too, but for arrays that are not scaled alike: these are an attribute a component already.
    const std::vector<ExtraAttribute> again = parse_extra_bytes(format, record_size, fields.extra_bytes_record());
    ASSERT_EQ(again.size(), fields.extra_attributes().size());
    for (size_t i = 0; i < again.size(); ++i) {
        const size_t index = fields.extra_attributes()[i];
        const Attribute &found = again[i].attribute, &expected = columns.attributes()[index];
        EXPECT_EQ(again[i].record_offset, columns.record_offset(index)) << expected.name;
        EXPECT_EQ(found.name, expected.name);
        EXPECT_EQ(found.description, expected.description) << expected.name;
        EXPECT_EQ(found.type, expected.type) << expected.name;
        EXPECT_EQ(found.components, expected.components) << expected.name;
        EXPECT_EQ(found.scale, expected.scale) << expected.name;
        EXPECT_EQ(found.offset, expected.offset) << expected.name;
        EXPECT_TRUE(found.no_data == expected.no_data || (std::isnan(found.no_data) && std::isnan(expected.no_data))) << expected.name;
    }
}

INSTANTIATE_TEST_SUITE_P(Las, EachWrittenFormat, testing::Values(0, 1, 2, 3, 6, 7, 8));

// A point of formats 0 to 5 and what it is in 6 to 8, both by hand.
std::vector<std::byte> promoted(int from, const LasPoint& point, int to, std::vector<std::string>* notes = nullptr) {
    const std::vector<std::byte> record = test::las_record(from, point);
    const Columns columns(from, record.size(), {});
    const RecordFields fields(to, columns.attributes());
    if (notes) *notes = fields.notes();
    return encode(fields, decode(columns, record, record.size()));
}

TEST(LasRecord, OldPointsArePromoted) {
    LasPoint point{.x = -5,
                   .y = 6,
                   .z = 7,
                   .intensity = 40000,
                   .return_number = 7,
                   .number_of_returns = 5,
                   .flags = 0xC5,
                   .classification = 31,
                   .scan_angle = -90,
                   .user_data = 9,
                   .point_source_id = 65535,
                   .gps_time = -0.25,
                   .rgb = {1, 2, 65535}};
    LasPoint expected = point;
    expected.scan_angle = -15000;
    std::vector<std::string> notes;
    EXPECT_EQ(promoted(3, point, 7, &notes), test::las_record(7, expected));
    EXPECT_EQ(notes, std::vector<std::string>{
                         "scan angles of whole degrees become steps of 0.006, class 12 becomes class 1 with the overlap flag"});

    // 1 / 0.006 = 166.67, 127 / 0.006 = 21166.67, -128 / 0.006 = -21333.33
    for (const auto& [rank, angle] :
         {std::pair(1, 167), std::pair(-1, -167), std::pair(2, 333), std::pair(127, 21167), std::pair(-128, -21333), std::pair(0, 0)}) {
        point.scan_angle = int16_t(rank);
        expected.scan_angle = int16_t(angle);
        EXPECT_EQ(promoted(3, point, 7), test::las_record(7, expected)) << rank;
    }
}

TEST(LasRecord, TheOldClassOfOverlapBecomesAFlag) {
    for (int c = 0; c < 32; ++c)
        for (const uint8_t flags : {0, 2, 0x47}) {
            const LasPoint point{.flags = flags, .classification = uint8_t(c), .gps_time = 1.0};
            LasPoint expected = point;
            if (c == 12) {
                expected.classification = 1;
                expected.flags = flags | 8;
            }
            EXPECT_EQ(promoted(1, point, 6), test::las_record(6, expected)) << c;
        }
    // Where the cloud comes from formats 6 to 10, class 12 is what its writer meant by it.
    const std::vector<std::byte> record = test::las_record(6, {.classification = 12});
    const Columns columns(6, record.size(), {});
    EXPECT_EQ(encode(RecordFields(7, columns.attributes()), decode(columns, record, record.size())),
              test::las_record(7, {.classification = 12}));
}

TEST(LasRecord, WhatIsMissingIsSaid) {
    std::vector<std::string> notes;
    EXPECT_EQ(promoted(2, {.x = 1, .rgb = {4, 5, 6}}, 8, &notes), test::las_record(8, {.x = 1, .rgb = {4, 5, 6}}));
    EXPECT_EQ(notes.at(0), "there is no GPS time: it becomes 0");
    promoted(0, {}, 7, &notes);
    EXPECT_EQ(notes.at(1), "there is no color: it becomes 0");
    // Points that know nothing but where they are: the first and only return of their pulse.
    PointBatch batch;
    resize_batch(batch, 2, {}, {});
    batch.x = {1, 2};
    for (const int format : {0, 6}) {
        const std::vector<std::byte> one = test::las_record(format, {.x = 1}), two = test::las_record(format, {.x = 2});
        std::vector<std::byte> both = one;
        both.insert(both.end(), two.begin(), two.end());
        EXPECT_EQ(encode(RecordFields(format, {}), batch), both);
    }
}

Attribute named(std::string_view name, ScalarType type, int components = 1) {
    return {.name = std::string(name), .description = {}, .type = type, .components = components};
}

TEST(LasRecord, ThePointFormatFollowsFromTheAttributes) {
    using enum ScalarType;
    using namespace attribute_name;
    const Attribute rank = named(kScanAngleRank, int8), angle = named(kScanAngle, int16), gps = named(kGpsTime, float64),
                    rgb = named(kRgb, uint16, 3), nir = named(kNearInfrared, uint16);
    EXPECT_EQ(point_format_for({rank}, false), 0);
    EXPECT_EQ(point_format_for({gps, rank}, false), 1);
    EXPECT_EQ(point_format_for({rank, rgb}, false), 2);
    EXPECT_EQ(point_format_for({rank, gps, rgb}, false), 3);
    EXPECT_EQ(point_format_for({rank, gps, rgb}, true), 7);
    EXPECT_EQ(point_format_for({rank, gps}, true), 6);
    EXPECT_EQ(point_format_for({rank, nir}, false), 8);
    EXPECT_EQ(point_format_for({angle, rgb}, false), 7);
    EXPECT_EQ(point_format_for({angle, rank}, false), 6);
    EXPECT_EQ(point_format_for({}, false), 6);  // classes and returns of any kind may come from elsewhere
    EXPECT_EQ(point_format_for({named(kRgb, uint8, 3)}, false), 7);
    EXPECT_EQ(point_format_for({named(kRgb, float32, 3)}, false), 6);  // no field: extra bytes
    EXPECT_THROW(RecordFields(4, {}), Error);
    EXPECT_THROW(RecordFields(9, {}), Error);
    EXPECT_THROW(RecordFields(-1, {}), Error);
}

// One point with one attribute, in format 7.
std::vector<std::byte> one_value(const Attribute& attribute, std::vector<std::byte> value, std::vector<std::string>* notes = nullptr) {
    const RecordFields fields(7, {attribute});
    if (notes) *notes = fields.notes();
    PointBatch batch;
    const int wanted[] = {0};
    resize_batch(batch, 1, {attribute}, wanted);
    batch.columns[0] = std::move(value);
    return encode(fields, batch);
}

template <typename... T>
std::vector<std::byte> bytes_of_values(T... values) {
    std::vector<std::byte> bytes;
    (test::put(bytes, values), ...);
    return bytes;
}

TEST(LasRecord, OtherTypesAreConvertedWhereNothingIsLost) {
    using enum ScalarType;
    using namespace attribute_name;
    std::vector<std::string> notes;
    EXPECT_EQ(one_value(named(kRgb, uint8, 3), bytes_of_values(uint8_t(0), uint8_t(128), uint8_t(255)), &notes),
              test::las_record(7, {.rgb = {0, 128 * 257, 65535}}));
    EXPECT_NE(std::find(notes.begin(), notes.end(), "color of 8 bits is widened to 16"), notes.end());
    EXPECT_EQ(one_value(named(kIntensity, uint8), bytes_of_values(uint8_t(200))), test::las_record(7, {.intensity = 200}));
    EXPECT_EQ(one_value(named(kIntensity, uint32), bytes_of_values(65535u)), test::las_record(7, {.intensity = 65535}));
    EXPECT_EQ(one_value(named(kClassification, int32), bytes_of_values(255)), test::las_record(7, {.classification = 255}));
    EXPECT_EQ(one_value(named(kReturnNumber, uint16), bytes_of_values(uint16_t(15))), test::las_record(7, {.return_number = 15}));
    EXPECT_EQ(one_value(named(kGpsTime, float32), bytes_of_values(0.1f)), test::las_record(7, {.gps_time = double(0.1f)}));
    // Some Potree folders name the rank unsigned and mean the same bits.
    EXPECT_EQ(one_value(named(kScanAngleRank, uint8), bytes_of_values(int8_t(-3))), test::las_record(7, {.scan_angle = -500}));
    // A fraction has no place in a whole number: kept beside.
    const std::vector<std::byte> kept = one_value(named(kIntensity, float32), bytes_of_values(0.75f), &notes);
    std::vector<std::byte> expected = test::las_record(7, {});
    test::put(expected, 0.75f);
    EXPECT_EQ(kept, expected);
    EXPECT_EQ(notes.at(0), "point format 7 has no field for 'intensity' (float x 1): it becomes extra bytes");
}

std::string complaint_about(const Attribute& attribute, std::vector<std::byte> value) {
    try {
        one_value(attribute, std::move(value));
    } catch (const Error& error) {
        return error.what();
    }
    return {};
}

TEST(LasRecord, ValuesThatTheirFieldCannotHoldAreRefused) {
    using enum ScalarType;
    using namespace attribute_name;
    EXPECT_EQ(complaint_about(named(kReturnNumber, uint8), bytes_of_values(uint8_t(16))),
              "attribute 'return number': 16, and point format 7 holds 0 to 15");
    EXPECT_EQ(complaint_about(named(kIntensity, int32), bytes_of_values(-1)),
              "attribute 'intensity': -1, and point format 7 holds 0 to 65535");
    EXPECT_EQ(complaint_about(named(kIntensity, uint32), bytes_of_values(65536u)),
              "attribute 'intensity': 65536, and point format 7 holds 0 to 65535");
    const std::vector<Attribute> old = {named(kScanAngleRank, int8), named(kClassification, uint8), named(kClassificationFlags, uint8),
                                        named(kNumberOfReturns, uint8)};
    PointBatch batch;
    const int all[] = {0, 1, 2, 3};
    const RecordFields fields(0, old);
    for (const auto& [column, most, misfit] :
         {std::tuple(size_t(1), 31, 32), std::tuple(size_t(2), 7, 8), std::tuple(size_t(2), 0xC7, 0x20), std::tuple(size_t(3), 7, 8)}) {
        resize_batch(batch, 1, old, all);
        for (size_t i = 0; i < 4; ++i) batch.columns[i] = {std::byte(0)};
        batch.columns[column] = {std::byte(most)};
        EXPECT_NO_THROW(encode(fields, batch)) << column;
        batch.columns[column] = {std::byte(misfit)};
        EXPECT_THROW(encode(fields, batch), Error) << column;
    }
}

// Table 24, byte by byte.
TEST(LasRecord, ExtraBytesAreDescribed) {
    using enum ScalarType;
    Attribute height{.name = "height", .description = "above ground", .type = int32, .scale = 0.001, .offset = -2.0, .no_data = -9999.0};
    const Attribute normal = named("a normal that has a rather long name", float32, 3);
    const RecordFields fields(6, {height, normal});
    EXPECT_EQ(fields.record_size(), 30u + 4 + 12);
    const std::vector<std::vector<double>> least = {{-5}, {-1, -0.5, 0}}, most = {{7}, {1, 0.5, 0.25}};
    const std::vector<std::byte> payload = fields.extra_bytes_record(least, most);
    ASSERT_EQ(payload.size(), 4 * 192u);
    const auto number = [&]<typename T>(size_t at, T) {
        T value;
        std::memcpy(&value, payload.data() + at, sizeof value);
        return value;
    };
    const auto text = [&](size_t at) { return std::string(reinterpret_cast<const char*>(payload.data()) + at, 32); };
    EXPECT_EQ(payload[2], std::byte(6));
    EXPECT_EQ(payload[3], std::byte(1 | 2 | 4 | 8 | 16));
    EXPECT_STREQ(text(4).c_str(), "height");
    EXPECT_EQ(number(40, int64_t()), -9999);
    EXPECT_EQ(number(64, int64_t()), -5);
    EXPECT_EQ(number(88, int64_t()), 7);
    EXPECT_EQ(number(112, double()), 0.001);
    EXPECT_EQ(number(136, double()), -2.0);
    EXPECT_STREQ(text(160).c_str(), "above ground");
    for (int c = 0; c < 3; ++c) {
        const size_t at = 192 * (1 + size_t(c));
        EXPECT_EQ(payload[at + 2], std::byte(9));
        EXPECT_EQ(payload[at + 3], std::byte(2 | 4));
        EXPECT_EQ(text(at + 4), "a normal that has a rather lo[" + std::to_string(c) + "]");
        EXPECT_EQ(number(at + 64, double()), least[1][size_t(c)]);
        EXPECT_EQ(number(at + 88, double()), most[1][size_t(c)]);
    }
    EXPECT_EQ(fields.notes().front(),
              "'a normal that has a rather long name' becomes 'a normal that has a rather lo[2]': names of extra bytes are at most 32 "
              "bytes long");
    EXPECT_EQ(fields.extra_bytes_record()[3], std::byte(1 | 8 | 16));  // no min and max where none are said
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const std::vector<std::vector<double>> from = {{kInfinity}, {kInfinity, -1, kInfinity}}, to = {{-kInfinity}, {-kInfinity, 1, -kInfinity}};
    const std::vector<std::byte> without = fields.extra_bytes_record(from, to);  // of columns without a value
    EXPECT_EQ(without[3], std::byte(1 | 8 | 16));
    EXPECT_EQ(without[192 + 3], std::byte(0));
    EXPECT_EQ(without[2 * 192 + 3], std::byte(2 | 4));
}

TEST(LasRecord, AsManyExtraBytesAsARecordHolds) {
    EXPECT_EQ(RecordFields(6, std::vector<Attribute>(341, named("a", ScalarType::float64))).record_size(), 30u + 341 * 8);
    EXPECT_THROW(RecordFields(6, std::vector<Attribute>(342, named("a", ScalarType::uint8))), Error);
    EXPECT_EQ(RecordFields(6, std::vector<Attribute>(257, named("a", ScalarType::uint8, 254))).record_size(), 30u + 257 * 254);
    EXPECT_THROW(RecordFields(6, std::vector<Attribute>(258, named("a", ScalarType::uint8, 254))), Error);
}

}  // namespace
}  // namespace strata::las
