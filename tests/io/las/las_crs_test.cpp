#include <gtest/gtest.h>

#include "io/las/las_source.h"
#include "tests/support/las_file.h"

namespace strata {
namespace {

using Bytes = std::vector<std::byte>;
using test::LasFile;

Bytes words(std::initializer_list<int> values) {
    Bytes bytes;
    for (const int value : values) test::put(bytes, uint16_t(value));
    return bytes;
}

std::string crs_of(std::vector<LasFile::Vlr> vlrs, std::vector<LasFile::Vlr> evlrs = {}) {
    LasFile file{.minor_version = 4, .point_format = 6};
    file.vlrs = std::move(vlrs);
    file.evlrs = std::move(evlrs);
    file.records = {test::las_record(6, {})};
    return LasSource(memory_source("crs.las", file.bytes())).info().crs;
}

const LasFile::Vlr kWkt = {"LASF_Projection", 2112, test::bytes_of(std::string("GEOGCS[\"WGS 84\"]\0\0", 18))};
const LasFile::Vlr kProjected = {"LASF_Projection", 34735, words({1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32632})};

TEST(LasCrs, WktEndsAtItsNul) { EXPECT_EQ(crs_of({kWkt}), "GEOGCS[\"WGS 84\"]"); }
TEST(LasCrs, WktMayLieBehindThePoints) { EXPECT_EQ(crs_of({}, {kWkt}), "GEOGCS[\"WGS 84\"]"); }
TEST(LasCrs, WktWinsOverKeys) { EXPECT_EQ(crs_of({kProjected, kWkt}), "GEOGCS[\"WGS 84\"]"); }
TEST(LasCrs, AnEmptyWktDoesNot) { EXPECT_EQ(crs_of({{"LASF_Projection", 2112, {}}, kProjected}), "EPSG:32632"); }
TEST(LasCrs, NothingIsEmpty) { EXPECT_EQ(crs_of({{"other", 2112, test::bytes_of("no")}}), ""); }

TEST(LasCrs, GeographicKey) {
    EXPECT_EQ(crs_of({{"LASF_Projection", 34735, words({1, 1, 0, 1, 2048, 0, 1, 4326})}}), "EPSG:4326");
}

// A user-defined projection over a known datum is not that datum: its name is all that there is.
TEST(LasCrs, CitationOfAUserDefinedSystem) {
    const LasFile::Vlr keys = {"LASF_Projection", 34735, words({1, 1, 0, 3, 1026, 34737, 6, 4, 2048, 0, 1, 4326, 3072, 0, 1, 32767})};
    const LasFile::Vlr text = {"LASF_Projection", 34737, test::bytes_of("abc|mine |x")};
    EXPECT_EQ(crs_of({keys, text}), "mine");
}

TEST(LasCrs, ACitationBeyondItsTextIsNone) {
    const LasFile::Vlr keys = {"LASF_Projection", 34735, words({1, 1, 0, 1, 1026, 34737, 60000, 4})};
    EXPECT_EQ(crs_of({keys, {"LASF_Projection", 34737, test::bytes_of("abc|mine|")}}), "");
}

// A writer can keep what cannot be translated: the records of the keys, as they are.
TEST(LasCrs, TheRecordsOfTheKeysAreKept) {
    const Bytes doubles = test::bytes_of("12345678"), texts = test::bytes_of("mine|");
    const auto records_of = [&](const std::vector<LasFile::Vlr>& vlrs) {
        LasFile file{.point_format = 0};
        file.vlrs = vlrs;
        file.records = {test::las_record(0, {})};
        return LasSource(memory_source("crs.las", file.bytes())).info().crs_records;
    };
    const std::vector<CrsRecord> records = records_of({{"LASF_Projection", 34737, texts}, kWkt, kProjected, {"LASF_Projection", 34736, doubles}});
    const std::vector<CrsRecord> expected = {{34735, kProjected.payload}, {34736, doubles}, {34737, texts}};
    EXPECT_EQ(records, expected);
    EXPECT_TRUE(records_of({kWkt}).empty());
}

}  // namespace
}  // namespace strata
