// strata convert --in-crs and --out-crs: the real program, its words, and where the points come to lie.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/octree/layered_points.h"
#include "io/crs/reprojected_source.h"
#include "io/format.h"
#include "tests/support/las_file.h"
#include "tests/support/points_of.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::run_strata;

// Place and number of each point, in the order of the numbers.
std::vector<std::pair<double, Vec3d>> places_of(const PointSource& source) {
    const PointBatch points = test::points_of(source);
    const std::vector<double> numbers = test::values_of(source, points, "gps-time");
    std::vector<std::pair<double, Vec3d>> places;
    for (size_t i = 0; i < points.size; ++i)
        places.emplace_back(numbers[i], source.info().quantization.world_from_quanta({points.x[i], points.y[i], points.z[i]}));
    std::sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    return places;
}

class ConvertCrs : public testing::Test {
protected:
    // 10,000 points of a square kilometer around an easting of 700 km, in millimeters of a zone of UTM; their GPS times are numbers from `first`.
    std::string write_scan(const std::string& name, int code, double easting = 700'000.0, int first = 0) const {
        test::LasFile file{.minor_version = 3, .point_format = 3, .scale = {0.001, 0.001, 0.001}, .offset = {easting, 5'330'000.0, 400.0},
                           .min = {easting - 500.0, 5'330'000.0, 400.0}, .max = {easting + 500.0, 5'331'000.0, 430.0}};
        for (int i = 0; i < 10'000; ++i)
            file.records.push_back(test::las_record(3, {.x = i * 7919 % 1'000'003 - 500'000, .y = int32_t(int64_t{i} * 104'729 % 1'000'003), .z = i % 30'011,
                                                        .classification = uint8_t(i % 2), .gps_time = double(first + i)}));
        if (code != 0) {
            std::vector<std::byte> keys;
            for (const int word : {1, 1, 0, 1, 3072, 0, 1, code}) test::put(keys, uint16_t(word));
            file.vlrs = {{"LASF_Projection", 34735, keys}};
        }
        const std::vector<std::byte> bytes = file.bytes();
        std::ofstream(folder_.file(name), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        return folder_.file(name);
    }
    json converted(const std::vector<std::string>& words) const {
        std::vector<std::string> all = {"convert", "--json", "--no-sync"};
        all.insert(all.end(), words.begin(), words.end());
        const ProgramResult result = run_strata(all);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        EXPECT_EQ(result.err, "");
        return json::parse(result.out, nullptr, false);
    }
    static json info_of(const std::string& path) { return json::parse(run_strata({"info", "--json", "--exact", path}).out, nullptr, false); }

    const TemporaryFolder folder_;
    const std::string out_ = folder_.file("out");
};

// What is written is what the library says of each point, to the last digit.
TEST_F(ConvertCrs, EveryPointComesToItsPlace) {
    const std::string scan = write_scan("scan.las", 32632);
    for (const char* const system : {"EPSG:4326", "EPSG:4978", "EPSG:25833+7837"}) {
        const json report = converted({scan, out_, "--out-crs", system, "--overwrite"});
        EXPECT_EQ(report["points_written"], 10'000);
        EXPECT_GT(report["worst_rounding"], 0.0);
        const auto expected = reproject_points(open_points({&scan, 1}), system, scan, 1);
        const std::unique_ptr<LayeredCloud> cloud = open_layered(out_);
        EXPECT_EQ(cloud->info().crs, system);
        const auto wanted = places_of(*expected), found = places_of(LayeredPoints(*cloud));
        ASSERT_EQ(wanted.size(), found.size());
        double worst = 0.0;
        for (size_t i = 0; i < found.size(); ++i) {
            ASSERT_EQ(wanted[i].first, found[i].first);
            worst = std::max(worst, (wanted[i].second - found[i].second).cwiseQuotient(expected->info().quantization.scale).cwiseAbs().maxCoeff());
        }
        EXPECT_LT(worst, 1e-3) << system;  // the same quanta: what differs is the arithmetic of another offset
    }
    const json info = info_of(out_);
    EXPECT_EQ(info["crs_name"], "ETRS89 / UTM zone 33N + DHHN2016 height");
    EXPECT_EQ(info["unit"], "metre");
}

TEST_F(ConvertCrs, DegreesAreInTheirPlace) {
    (void)converted({write_scan("scan.las", 32632), out_, "--out-crs", "EPSG:4326"});
    const json info = info_of(out_);
    EXPECT_EQ(info["crs"], "EPSG:4326");
    EXPECT_EQ(info["unit"], "degree");
    // Munich: 11.7 degrees east and 48.1 north, on heights that stay.
    EXPECT_NEAR(info["bounds"]["min"][0].get<double>(), 11.68, 0.02);
    EXPECT_NEAR(info["bounds"]["min"][1].get<double>(), 48.09, 0.02);
    EXPECT_DOUBLE_EQ(info["bounds"]["min"][2], 400.0);
    EXPECT_EQ(info["scale"], json({1e-8, 1e-8, 0.001}));
}

// Out to degrees or to the center of the earth, into COPC, and back: no coordinate is off by more than one step.
TEST_F(ConvertCrs, ThereAndBackAgain) {
    const std::string scan = write_scan("scan.las", 32632), there = folder_.file("there.copc.laz"), back = folder_.file("back.copc.laz");
    const auto before = places_of(*open_points({&scan, 1}));
    for (const char* const system : {"EPSG:4326", "EPSG:4978"}) {
        (void)converted({scan, there, "--out-crs", system, "--overwrite"});
        const json info = info_of(there);
        EXPECT_EQ(info["crs_id"], system);
        EXPECT_TRUE(info["crs"].get<std::string>().find('[') != std::string::npos) << info["crs"];  // COPC asks for WKT
        (void)converted({there, back, "--out-crs", "EPSG:32632", "--overwrite"});
        const auto after = places_of(*open_points({&back, 1}));
        ASSERT_EQ(after.size(), before.size());
        double worst = 0.0;
        for (size_t i = 0; i < after.size(); ++i) {
            ASSERT_EQ(after[i].first, before[i].first);
            worst = std::max(worst, (after[i].second - before[i].second).cwiseAbs().maxCoeff());
        }
        EXPECT_LT(worst, 0.001 + 1e-6) << system;
    }
}

TEST_F(ConvertCrs, WhatHasNoWktIsLeftOutOfCopcAndSaid) {
    test::LasFile file{.minor_version = 4, .point_format = 6};
    file.records = {test::las_record(6, {})};
    file.vlrs = {{"LASF_Projection", 2112, test::bytes_of("mine")}};
    const std::vector<std::byte> bytes = file.bytes();
    std::ofstream(folder_.file("mine.las"), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    const std::string copc = folder_.file("mine.copc.laz");
    EXPECT_EQ(converted({folder_.file("mine.las"), copc})["notes"],
              json({"the coordinate reference system has no WKT 1, which COPC asks for, and is left out: mine"}));
    EXPECT_TRUE(info_of(copc)["crs"].is_null());
}

// A system of its own without parameters or a name: point format 3 keeps the keys, 6 cannot.
TEST_F(ConvertCrs, KeysThatSayNoSystemAreKeptOrSaidToBeLeftOut) {
    std::vector<std::byte> keys;
    for (const int word : {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32767}) test::put(keys, uint16_t(word));
    for (const int format : {3, 6}) {
        test::LasFile file{.minor_version = uint8_t(format == 3 ? 3 : 4), .point_format = uint8_t(format)};
        file.records = {test::las_record(format, {})};
        file.vlrs = {{"LASF_Projection", 34735, keys}};
        const std::vector<std::byte> bytes = file.bytes();
        const std::string own = folder_.file("own.las"), las = folder_.file("copy.las");
        std::ofstream(own, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        json expected = {"the coordinate reference system that its GeoTIFF keys describe is not translated: no more than its name is known"};
        if (format == 6) expected.push_back("the GeoTIFF keys say no system that has a WKT, which point format 6 asks for, and are left out");
        EXPECT_EQ(converted({own, las, "--overwrite"})["notes"], expected) << format;
        EXPECT_EQ(open_points({&las, 1})->info().crs_records.size(), format == 3 ? 1u : 0u);
    }
}

// Two zones are two systems: said, and brought to one where that is asked for.
TEST_F(ConvertCrs, FilesOfTwoZonesMeet) {
    const std::string a = write_scan("a.las", 32632, 900'000.0), b = write_scan("b.las", 32633, 450'000.0, 10'000);
    const json mixed = converted({a, b, out_});
    ASSERT_EQ(mixed["notes"].size(), 1u) << mixed["notes"];
    EXPECT_EQ(mixed["notes"][0], b + ": its coordinate reference system, EPSG:32633 WGS 84 / UTM zone 33N, differs from that of the files before it, EPSG:32632 WGS 84 / UTM "
                                     "zone 32N, which is kept; convert --out-crs brings all to one");
    const json one = converted({a, b, out_, "--out-crs", "EPSG:32633", "--overwrite"});
    EXPECT_EQ(one["points_written"], 20'000);
    EXPECT_TRUE(one["notes"].empty()) << one["notes"];
    const json info = info_of(out_);
    EXPECT_EQ(info["crs"], "EPSG:32633");
    // 400 km east of the meridian at 9 degrees, where a degree is 74 km, are some 48 km west of that at 15: a kilometer beside the other scan.
    EXPECT_NEAR(info["bounds"]["min"][0].get<double>(), 450'000.0, 3'000.0);
    EXPECT_NEAR(info["bounds"]["max"][0].get<double>(), 452'000.0, 3'000.0);
}

// GeoTIFF keys stay keys, and LAS 1.2 what it is.
TEST_F(ConvertCrs, ItsOwnSystemIsNoChange) {
    const std::string scan = write_scan("scan.las", 32632), plain = folder_.file("plain.las"), same = folder_.file("same.las");
    (void)converted({scan, plain});
    EXPECT_TRUE(converted({scan, same, "--out-crs", "EPSG:32632"})["notes"].empty());
    const auto content = [](const std::string& path) {
        std::ifstream file(path, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(file), {});
    };
    EXPECT_GT(content(plain).size(), 10'000u * 34);
    EXPECT_TRUE(content(plain) == content(same));
}

TEST_F(ConvertCrs, TheCallerMaySayTheSystem) {
    const std::string silent = write_scan("silent.las", 0);
    (void)converted({silent, out_, "--in-crs", "EPSG:25832"});
    EXPECT_EQ(info_of(out_)["crs"], "EPSG:25832");
    const json moved = converted({silent, out_, "--in-crs", "EPSG:25832", "--out-crs", "EPSG:25833", "--overwrite"});
    EXPECT_TRUE(moved["notes"].empty()) << moved["notes"];
    const json overridden = converted({write_scan("wrong.las", 25833), out_, "--in-crs", "EPSG:25832", "--overwrite"});
    ASSERT_EQ(overridden["notes"].size(), 1u);
    EXPECT_EQ(overridden["notes"][0], "its coordinate reference system, EPSG:25833 ETRS89 / UTM zone 33N, is taken for EPSG:25832 ETRS89 / UTM zone 32N");
}

TEST_F(ConvertCrs, BoxesAreInTheCoordinatesOfTheInput) {
    const std::string scan = write_scan("scan.las", 32632);
    const std::vector<std::string> part = {scan, out_, "--bounds", "700000,5330000,,700100,5330500,", "--classes", "1", "--every", "2", "--overwrite"};
    const json plain = converted(part);
    std::vector<std::string> words = part;
    words.insert(words.end(), {"--out-crs", "EPSG:4326"});
    const json moved = converted(words);
    EXPECT_GT(plain["points_written"], 100);
    EXPECT_EQ(moved["points_written"], plain["points_written"]);
    EXPECT_NEAR(info_of(out_)["bounds"]["min"][0].get<double>(), 11.69, 0.01);
}

TEST_F(ConvertCrs, WhatCannotBeIsOneLine) {
    const auto refused = [&](const std::vector<std::string>& words) {
        std::vector<std::string> all = {"convert", write_scan("silent.las", 0), out_};
        all.insert(all.end(), words.begin(), words.end());
        const ProgramResult result = run_strata(all);
        EXPECT_EQ(result.out, "");
        EXPECT_FALSE(std::filesystem::exists(out_));
        return std::pair(result.exit_code, result.err);
    };
    const auto expect = [](const std::pair<int, std::string>& result, int exit_code, const std::string& part) {
        EXPECT_EQ(result.first, exit_code) << result.second;
        EXPECT_NE(result.second.find(part), std::string::npos) << result.second;
    };
    expect(refused({"--out-crs", "EPSG:4326"}), 1, "silent.las: the file does not say its coordinate reference system; say it, as in --in-crs EPSG:25832\n");
    expect(refused({"--out-crs", "EPSG:99999"}), 2, "--out-crs: 'EPSG:99999' is no coordinate reference system that PROJ knows");
    expect(refused({"--in-crs", "Munich"}), 2, "--in-crs: 'Munich' is no coordinate reference system");
    expect(refused({"--in-crs", ""}), 2, "--in-crs: ");
    // 700 km as degrees.
    expect(refused({"--in-crs", "EPSG:4326", "--out-crs", "EPSG:32632"}), 1, "silent.las: point 1, at 699500, 5330000, 400, has no place in WGS 84 / UTM zone 32N");
    const ProgramResult bare = test::run_program({"/usr/bin/env", "PROJ_DATA=/nowhere", STRATA_PROGRAM, "convert", write_scan("scan.las", 32632), out_, "--out-crs", "EPSG:4326"});
    EXPECT_EQ(bare.exit_code, 1) << bare.err;
    EXPECT_EQ(bare.err, "strata: --out-crs: PROJ's database, proj.db, is not found; PROJ_DATA says in which folder it is\n");
}

// A real scan in feet, with a projection in parameters: the stadium of Eugene, Oregon.
TEST_F(ConvertCrs, ARealScan) {
    const char* const data = std::getenv("STRATA_DATA");
    const std::string scan = std::string(data ? data : "") + "/las/autzen_trim.las";
    if (!std::filesystem::exists(scan)) GTEST_SKIP() << "STRATA_DATA has no las/autzen_trim.las";
    const uint64_t points = info_of(scan)["points"];
    EXPECT_EQ(converted({scan, out_, "--out-crs", "EPSG:4326"})["points_written"], points);
    const json degrees = info_of(out_);
    EXPECT_NEAR(degrees["bounds"]["min"][0].get<double>(), -123.07, 0.01);
    EXPECT_NEAR(degrees["bounds"]["min"][1].get<double>(), 44.05, 0.01);
    EXPECT_EQ(converted({scan, out_, "--out-crs", "EPSG:4978", "--overwrite"})["points_written"], points);
    const json earth = info_of(out_);
    const auto center = [&](int axis) { return 0.5 * (earth["bounds"]["min"][size_t(axis)].get<double>() + earth["bounds"]["max"][size_t(axis)].get<double>()); };
    EXPECT_NEAR(Vec3d(center(0), center(1), center(2)).norm(), 6'368'000.0, 5'000.0);  // the radius at 44 degrees
    EXPECT_EQ(earth["crs_name"], "WGS 84");
    EXPECT_EQ(earth["vertical_unit"], "metre");
}

}  // namespace
}  // namespace strata
