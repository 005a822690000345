// Files that lie: each is refused with one line that names file, place and expectation.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "core/error.h"
#include "io/las/las_source.h"
#include "tests/support/las_file.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

using Bytes = std::vector<std::byte>;
using test::LasFile;
using test::poke;

// Three points with color and an extra byte, a WKT record behind the points: a bit of everything.
LasFile small_file() {
    LasFile file{.minor_version = 4, .point_format = 7, .global_encoding = 16};
    file.vlrs = {{"LASF_Spec", 4, test::extra_bytes_entry("height", 4, 8, {0.01})}, {"other", 1, test::bytes_of("anything")}};
    file.evlrs = {{"LASF_Projection", 2112, test::bytes_of("LOCAL_CS[\"here\"]")}};
    for (int i = 0; i < 3; ++i) {
        file.records.push_back(test::las_record(7, {.x = i, .rgb = {1, 2, 3}}));
        test::put<int16_t>(file.records.back(), int16_t(i));
    }
    return file;
}
constexpr size_t kExtraBytesVlr = 375, kPointOffset = 375 + 54 + 192 + 54 + 8, kEvlr = kPointOffset + 3 * 38;

void read_all(Bytes bytes) { test::points_of(LasSource(memory_source("bad.las", std::move(bytes)))); }

TEST(LasMalformed, TheSmallFileItselfIsGood) {
    const LasSource source(memory_source("good.las", small_file().bytes()));
    EXPECT_EQ(source.info().crs, "LOCAL_CS[\"here\"]");
    EXPECT_EQ(test::points_of(source).x, (std::vector<int32_t>{0, 1, 2}));
}

// Whatever is cut off, something of what the header promises is missing.
TEST(LasMalformed, EveryTruncationIsRefused) {
    const Bytes whole = small_file().bytes();
    for (size_t size = 0; size < whole.size(); ++size) {
        try {
            read_all(Bytes(whole.begin(), whole.begin() + std::ptrdiff_t(size)));
            FAIL() << "accepted the first " << size << " of " << whole.size() << " bytes";
        } catch (const Error& error) {
            ASSERT_EQ(error.kind, ErrorKind::malformed) << size << ": " << error.what();
            ASSERT_EQ(std::string(error.what()).rfind("bad.las: ", 0), 0u) << error.what();
            ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        }
    }
}

struct Lie {
    const char* name;
    std::function<void(Bytes&)> tell;
    const char* expected;  // part of the message
    ErrorKind kind = ErrorKind::malformed;
};

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

const Lie kLies[] = {
    {"signature", [](Bytes& b) { poke<uint8_t>(b, 0, 'M'); }, "'LASF' is expected"},
    {"major_version", [](Bytes& b) { poke<uint8_t>(b, 24, 2); }, "LAS version 2.4, versions 1.0 to 1.4 are known", ErrorKind::unsupported},
    {"minor_version", [](Bytes& b) { poke<uint8_t>(b, 25, 5); }, "LAS version 1.5", ErrorKind::unsupported},
    {"header_size_small", [](Bytes& b) { poke<uint16_t>(b, 94, 374); }, "header size is 374, LAS 1.4 has 375 bytes or more"},
    {"header_size_beyond_file", [](Bytes& b) { poke<uint16_t>(b, 94, 65535); }, "header size is 65535"},
    {"point_offset_in_header", [](Bytes& b) { poke<uint32_t>(b, 96, 374); }, "point data offset is 374, the header ends at 375"},
    {"point_offset_beyond_file", [](Bytes& b) { poke<uint32_t>(b, 96, 0xFFFFFFFF); }, "point data offset is 4294967295"},
    {"point_offset_a_byte_late", [](Bytes& b) { poke<uint32_t>(b, 96, uint32_t(b.size())); }, "the file holds 0"},
    {"vlr_count", [](Bytes& b) { poke<uint32_t>(b, 100, 0xFFFFFFFF); }, "counts 4294967295 variable length records"},
    {"vlr_count_one_too_many", [](Bytes& b) { poke<uint32_t>(b, 100, 3); }, "variable length record 3 of 3: byte 683: 54 bytes needed, 0 left"},
    {"vlr_length", [](Bytes& b) { poke<uint16_t>(b, kExtraBytesVlr + 20, 65535); }, "its length is 65535 bytes, 254 are left before the point data"},
    {"point_format", [](Bytes& b) { poke<uint8_t>(b, 104, 11); }, "point format 11, formats 0 to 10 are known", ErrorKind::unsupported},
    {"record_length_0", [](Bytes& b) { poke<uint16_t>(b, 105, 0); }, "point record length is 0, point format 7 needs 36 or more"},
    {"record_length_small", [](Bytes& b) { poke<uint16_t>(b, 105, 35); }, "point record length is 35"},
    {"record_length_large", [](Bytes& b) { poke<uint16_t>(b, 105, 65535); }, "counts 3 points of 65535 bytes, the file holds 0"},
    {"point_count", [](Bytes& b) { poke<uint64_t>(b, 247, 6); }, "point data: byte 683: the header counts 6 points of 38 bytes, the file holds 5"},
    {"point_count_wraps", [](Bytes& b) { poke<uint64_t>(b, 247, UINT64_MAX / 38 + 2); }, "the file holds 5"},
    {"scale_0", [](Bytes& b) { poke(b, 131, 0.0); }, "byte 131: x scale is 0.000000, a positive number is expected"},
    {"scale_negative", [](Bytes& b) { poke(b, 139, -0.01); }, "y scale is -0.010000"},
    {"scale_nan", [](Bytes& b) { poke(b, 147, kNaN); }, "z scale is nan"},
    {"scale_infinite", [](Bytes& b) { poke(b, 131, kInfinity); }, "x scale is inf"},
    {"offset_too_large", [](Bytes& b) { poke(b, 155, 1e300); }, "byte 155: x offset 1e+300 leaves no room for steps of 0.01"},
    {"scale_too_large", [](Bytes& b) { poke(b, 131, 1e300); }, "x scale and offset reach beyond all numbers"},
    {"offset_nan", [](Bytes& b) { poke(b, 155, kNaN); }, "x offset is nan, a number is expected"},
    {"offset_infinite", [](Bytes& b) { poke(b, 171, -kInfinity); }, "z offset is -inf"},
    {"evlr_offset_in_points", [](Bytes& b) { poke<uint64_t>(b, 235, kEvlr - 1); }, "they must lie between the end of the point data at 797"},
    {"evlr_offset_beyond_file", [](Bytes& b) { poke<uint64_t>(b, 235, UINT64_MAX); }, "extended variable length records at byte 18446744073709551615"},
    {"evlr_count", [](Bytes& b) { poke<uint32_t>(b, 243, 0xFFFFFFFF); }, "4294967295 extended variable length records"},
    {"evlr_length", [](Bytes& b) { poke<uint64_t>(b, kEvlr + 20, UINT64_MAX); }, "its length is 18446744073709551615 bytes, 16 are left"},
    {"extra_bytes_length", [](Bytes& b) { poke<uint16_t>(b, kExtraBytesVlr + 20, 191); }, "variable length record"},
    {"extra_bytes_type", [](Bytes& b) { poke<uint8_t>(b, kExtraBytesVlr + 54 + 2, 31); }, "extra bytes of type 31, types 0 to 30 are known"},
    {"extra_bytes_too_wide", [](Bytes& b) { poke<uint8_t>(b, kExtraBytesVlr + 54 + 2, 10); }, "'height' ends at byte 44 of a point, a point has 38"},
    {"extra_bytes_scale", [](Bytes& b) { poke(b, kExtraBytesVlr + 54 + 112, kNaN); }, "'height': scale nan"},
};

class LasLie : public ::testing::TestWithParam<Lie> {};

TEST_P(LasLie, IsRefusedWithOneClearLine) {
    Bytes bytes = small_file().bytes();
    GetParam().tell(bytes);
    try {
        read_all(std::move(bytes));
        FAIL() << "accepted";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, GetParam().kind);
        EXPECT_NE(std::string(error.what()).find(GetParam().expected), std::string::npos) << error.what();
        EXPECT_EQ(std::string(error.what()).rfind("bad.las: ", 0), 0u) << error.what();
    }
}

INSTANTIATE_TEST_SUITE_P(Las, LasLie, ::testing::ValuesIn(kLies), [](const auto& lie) { return std::string(lie.param.name); });

// What does not concern the points does not stop them.
TEST(LasMalformed, DamagedGeoTiffKeysCostOnlyTheReferenceSystem) {
    LasFile file{.point_format = 0};
    Bytes keys;
    for (const uint16_t word : {1, 1, 0, 1000, 3072, 0, 1, 2994}) test::put(keys, uint16_t(word));
    file.vlrs = {{"LASF_Projection", 34735, keys}};
    file.records = {test::las_record(0, {})};
    const LasSource source(memory_source("keys.las", file.bytes()));
    EXPECT_EQ(source.info().crs, "");
    ASSERT_EQ(source.info().notes.size(), 1u);
    EXPECT_NE(source.info().notes[0].find("1000 GeoTIFF keys, there is room for 1"), std::string::npos) << source.info().notes[0];
}

TEST(LasMalformed, BoundsMayLieOrBeNoNumbers) {
    Bytes bytes = small_file().bytes();
    poke(bytes, 179, kNaN);
    EXPECT_NO_THROW(read_all(std::move(bytes)));
}

}  // namespace
}  // namespace strata
