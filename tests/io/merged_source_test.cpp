#include "io/merged_source.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "io/crs/crs_text.h"
#include "io/las/las_source.h"
#include "tests/support/las_file.h"
#include "tests/support/points_of.h"

namespace strata {
namespace {

using test::LasFile;
using test::las_record;
using test::values_of;
using Values = std::vector<double>;

std::unique_ptr<PointSource> merge(const std::vector<LasFile>& files) {
    std::vector<std::unique_ptr<PointSource>> sources;
    std::vector<std::string> names;
    for (const LasFile& file : files) {
        names.push_back("file" + std::to_string(names.size()));
        sources.push_back(std::make_unique<LasSource>(memory_source(names.back(), file.bytes())));
    }
    return merge_sources(std::move(sources), std::move(names));
}

// 635000.00 and 636000.00 at a centimetre: integers leave as integers, moved by a whole shift, without any rounding.
TEST(MergedSource, EqualScalesShiftByWholeQuanta) {
    LasFile a{.offset = {635000.0, 0.0, 0.0}}, b{.offset = {636000.0, 0.0, 0.0}};
    a.records = {las_record(0, {.x = 5, .y = INT32_MIN, .z = INT32_MAX})};
    b.records = {las_record(0, {.x = -7, .y = INT32_MAX, .z = INT32_MIN})};
    const auto merged = merge({a, b});
    EXPECT_EQ(merged->info().points, 2u);
    EXPECT_EQ(merged->batch_count(), 2u);
    EXPECT_EQ(merged->info().quantization.offset.x(), 635000.0);
    const PointBatch points = test::points_of(*merged);
    EXPECT_EQ(points.x, (std::vector<int32_t>{5, 100'000 - 7}));
    EXPECT_EQ(points.y, (std::vector<int32_t>{INT32_MIN, INT32_MAX}));
    EXPECT_EQ(points.z, (std::vector<int32_t>{INT32_MAX, INT32_MIN}));
    EXPECT_EQ(merged->info().worst_rounding, 0.0);
}

TEST(MergedSource, TheFinestScaleWins) {
    LasFile coarse{.scale = {0.01, 0.01, 0.01}}, fine{.scale = {0.001, 0.002, 0.01}, .offset = {0.0005, 0.0, 0.0}};
    coarse.records = {las_record(0, {.x = 123, .y = 123, .z = 123})};
    fine.records = {las_record(0, {.x = 123, .y = 123, .z = 123})};
    const auto merged = merge({coarse, fine});
    EXPECT_EQ(merged->info().quantization.scale, Vec3d(0.001, 0.002, 0.01));
    const PointBatch points = test::points_of(*merged);
    EXPECT_EQ(points.x[0], 1230);
    EXPECT_EQ(points.y[0], 615);
    EXPECT_EQ(points.z[0], 123);
    // Within half a quantum of 0.1235 m.
    EXPECT_NEAR(points.x[1] * 0.001, 0.1235, 0.0005 + 1e-12);
    EXPECT_NEAR(merged->info().worst_rounding, 0.0005, 1e-12);  // the second file's offset lies half a step off
}

TEST(MergedSource, FilesFarApartMoveTheOffset) {
    LasFile a{.offset = {0.0, 0.0, 0.0}}, b{.offset = {3.0e7, 0.0, 0.0}};
    a.records = {las_record(0, {.x = 1})};
    b.records = {las_record(0, {.x = 2})};
    b.min = b.max = {3.0e7 + 0.02, 0.0, 0.0};
    a.min = a.max = {0.01, 0.0, 0.0};
    const auto merged = merge({a, b});
    const PointBatch points = test::points_of(*merged);
    const Quantization& quantization = merged->info().quantization;
    EXPECT_EQ(quantization.scale.x(), 0.01);
    EXPECT_NEAR(quantization.world_from_quanta({points.x[0], 0, 0}).x(), 0.01, 1e-6);
    EXPECT_NEAR(quantization.world_from_quanta({points.x[1], 0, 0}).x(), 3.0e7 + 0.02, 1e-6);
}

TEST(MergedSource, BeyondAllQuantaTheScaleIsWidenedAndSaid) {
    LasFile a, b{.offset = {1.0e9, 0.0, 0.0}};
    a.records = b.records = {las_record(0, {.x = 1})};
    a.min = a.max = {0.01, 0.0, 0.0};
    b.min = b.max = {1.0e9 + 0.01, 0.0, 0.0};
    const auto merged = merge({a, b});
    EXPECT_EQ(merged->info().quantization.scale.x(), 1.0);
    EXPECT_EQ(merged->info().notes.size(), 1u);
    const PointBatch points = test::points_of(*merged);
    EXPECT_EQ(int64_t(points.x[1]) - points.x[0], 1'000'000'000);
}

TEST(MergedSource, PointsBeyondLyingBoundsAreAnErrorNotAWrap) {
    LasFile a, b{.offset = {3.0e7, 0.0, 0.0}};  // bounds of both: 0 0 0
    a.records = b.records = {las_record(0, {.x = 1})};
    const auto merged = merge({a, b});
    try {
        test::points_of(*merged);
        FAIL() << "wrapped";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::limit);
        EXPECT_EQ(std::string(error.what()).rfind("file1: points lie beyond", 0), 0u) << error.what();
    }
}

TEST(MergedSource, AttributesAreTheUnionInTheUsualOrder) {
    LasFile plain{.point_format = 0}, colored{.point_format = 2};
    plain.vlrs = {{"LASF_Spec", 4, test::extra_bytes_entry("height", 3)}};
    plain.records = {las_record(0, {.intensity = 7})};
    test::put<uint16_t>(plain.records[0], 99);
    colored.records = {las_record(2, {.intensity = 8, .rgb = {1, 2, 3000}})};
    const auto merged = merge({plain, colored});
    const PointBatch points = test::points_of(*merged);
    EXPECT_EQ(merged->info().attributes[8].name, "rgb");
    EXPECT_EQ(merged->info().attributes[9].name, "height");
    EXPECT_EQ(values_of(*merged, points, "intensity"), (Values{7, 8}));
    EXPECT_EQ(values_of(*merged, points, "rgb"), (Values{0, 0, 0, 1, 2, 3000}));
    EXPECT_EQ(values_of(*merged, points, "height"), (Values{99, 0}));
}

TEST(MergedSource, ScanAnglesMeetInTheFinerUnit) {
    LasFile old{.point_format = 0}, extended{.minor_version = 4, .point_format = 6};
    old.records = {las_record(0, {.scan_angle = -90})};
    extended.records = {las_record(6, {.scan_angle = 500})};
    const auto merged = merge({old, extended});
    EXPECT_EQ(find_attribute(merged->info().attributes, attribute_name::kScanAngleRank), -1);
    EXPECT_EQ(values_of(*merged, test::points_of(*merged), "scan angle"), (Values{-15000, 500}));  // -90 / 0.006
}

// Formats 6 to 10 have a flag where class 12 of the older ones says overlap; their own class 12 is what its writer meant by it.
TEST(MergedSource, TheOldClassOfOverlapBecomesAFlagAmongNewPoints) {
    LasFile old{.point_format = 1}, extended{.minor_version = 4, .point_format = 6};
    old.records = {las_record(1, {.flags = 0x45, .classification = 12}), las_record(1, {.flags = 2, .classification = 31})};
    extended.records = {las_record(6, {.flags = 1, .classification = 12})};
    const auto merged = merge({old, extended});
    const PointBatch points = test::points_of(*merged);
    EXPECT_EQ(values_of(*merged, points, "classification"), (Values{1, 31, 12}));
    EXPECT_EQ(values_of(*merged, points, "classification flags"), (Values{0x4D, 2, 1}));
    EXPECT_EQ(merged->info().notes,
              std::vector<std::string>{
                  "file0: scan angles of whole degrees become steps of 0.006, class 12 becomes class 1 with the overlap flag"});
    // The flags alone follow from the class, too.
    const int flags = find_attribute(merged->info().attributes, attribute_name::kClassificationFlags);
    PointBatch batch;
    merged->read_batch(0, {&flags, 1}, batch);
    EXPECT_EQ(batch.columns[size_t(flags)], (std::vector{std::byte(0x4D), std::byte(2)}));
    // Without new points nothing is promoted.
    const auto both_old = merge({old, old});
    EXPECT_EQ(values_of(*both_old, test::points_of(*both_old), "classification"), (Values{12, 31, 12, 31}));
    EXPECT_EQ(both_old->info().notes, std::vector<std::string>{});
}

TEST(MergedSource, AttributesStoredDifferentlyBecomeTrueValues) {
    LasFile a, b;
    a.vlrs = {{"LASF_Spec", 4, test::extra_bytes_entry("h", 3, 1 | 8, {0.5}, {}, 65535)}};
    b.vlrs = {{"LASF_Spec", 4, test::extra_bytes_entry("h", 9)}};
    for (const uint16_t stored : {3, 65535}) {
        a.records.push_back(las_record(0, {}));
        test::put(a.records.back(), stored);
    }
    b.records = {las_record(0, {})};
    test::put(b.records[0], 0.25f);
    const auto merged = merge({a, b});
    const Values values = values_of(*merged, test::points_of(*merged), "h");
    ASSERT_EQ(values.size(), 3u);
    EXPECT_EQ(values[0], 1.5);
    EXPECT_TRUE(std::isnan(values[1]));  // no data
    EXPECT_EQ(values[2], 0.25);
}

TEST(MergedSource, EightBitColorIsWidenedNextToSixteen) {
    LasFile bytes{.point_format = 2}, words{.point_format = 2};
    bytes.records = {las_record(2, {.rgb = {0, 128, 255}})};
    words.records = {las_record(2, {.rgb = {0, 128, 65535}})};
    EXPECT_EQ(values_of(*merge({bytes, words}), test::points_of(*merge({bytes, words})), "rgb"), (Values{0, 128 * 257, 65535, 0, 128, 65535}));
    EXPECT_EQ(values_of(*merge({bytes, bytes}), test::points_of(*merge({bytes, bytes})), "rgb"), (Values{0, 128, 255, 0, 128, 255}));
}

LasFile file_in(const std::string& wkt, int code = 0) {
    LasFile file{};
    file.records = {las_record(0, {})};
    if (!wkt.empty()) file.vlrs.push_back({"LASF_Projection", 2112, test::bytes_of(wkt)});
    if (code == 0) return file;
    std::vector<std::byte> keys;
    for (const int word : {1, 1, 0, 1, 3072, 0, 1, code}) test::put(keys, uint16_t(word));
    file.vlrs.push_back({"LASF_Projection", 34735, keys});
    return file;
}

TEST(MergedSource, OneSystemSaidInTwoWaysIsOne) {
    const auto merged = merge({file_in("", 2056), file_in(wkt1_of_crs("EPSG:2056")), file_in("")});
    EXPECT_EQ(merged->info().crs, "EPSG:2056");
    EXPECT_TRUE(merged->info().notes.empty()) << merged->info().notes[0];
}

TEST(MergedSource, AnotherSystemIsNamed) {
    const auto merged = merge({file_in(""), file_in("", 25832), file_in("", 25833), file_in("mine")});
    EXPECT_EQ(merged->info().crs, "EPSG:25832");
    ASSERT_EQ(merged->info().notes.size(), 2u);
    EXPECT_EQ(merged->info().notes[0],
              "file2: its coordinate reference system, EPSG:25833 ETRS89 / UTM zone 33N, differs from that of the files before it, EPSG:25832 ETRS89 / "
              "UTM zone 32N, which is kept; convert --out-crs brings all to one");
    EXPECT_TRUE(merged->info().notes[1].starts_with("file3: its coordinate reference system, mine, differs")) << merged->info().notes[1];
}

TEST(MergedSource, ANoteOfSeveralFilesIsSaidOnce) {
    const auto merged = merge({file_in("", 25832), file_in("", 25833), file_in("", 25834), file_in("", 25833), file_in("", 25833)});
    ASSERT_EQ(merged->info().notes.size(), 2u);
    EXPECT_TRUE(merged->info().notes[0].starts_with("file1 and 2 more: its coordinate reference system, EPSG:25833 ")) << merged->info().notes[0];
    EXPECT_TRUE(merged->info().notes[1].starts_with("file2: its coordinate reference system, EPSG:25834 ")) << merged->info().notes[1];
}

TEST(MergedSource, RecordsOfKeysAreKeptWhereAllHaveTheSame) {
    EXPECT_EQ(merge({file_in("", 2056), file_in("", 2056)})->info().crs_records.size(), 1u);
    EXPECT_TRUE(merge({file_in("", 2056), file_in(wkt1_of_crs("EPSG:2056"))})->info().crs_records.empty());
    EXPECT_TRUE(merge({file_in(""), file_in("", 2056)})->info().crs_records.empty());
}

}  // namespace
}  // namespace strata
