// strata convert as users run it: the real program, its report, and what it wrote against what it read.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "core/octree/layered_points.h"
#include "io/format.h"
#include "tests/support/las_file.h"
#include "tests/support/points_of.h"
#include "tests/support/scan_files.h"

namespace strata {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::ProgramResult;
using test::run_strata;

/// A point as numbers: the quanta of its place in `quantization`, then its attributes by the order of their names.
using Row = std::vector<double>;

std::vector<Row> sorted_rows(const PointSource& source, const Quantization& quantization) {
    const PointBatch points = test::points_of(source);
    std::vector<Row> rows(points.size);
    for (size_t i = 0; i < points.size; ++i) {
        const Vec3d world = source.info().quantization.world_from_quanta({points.x[i], points.y[i], points.z[i]});
        for (int axis = 0; axis < 3; ++axis) rows[i].push_back(std::round((world[axis] - quantization.offset[axis]) / quantization.scale[axis]));
    }
    std::vector<std::string> names;
    for (const Attribute& attribute : source.info().attributes) names.push_back(attribute.name);
    std::sort(names.begin(), names.end());
    for (const std::string& name : names) {
        const std::vector<double> values = test::values_of(source, points, name);
        const size_t components = points.size > 0 ? values.size() / points.size : 0;
        for (size_t i = 0; i < values.size(); ++i) rows[i / components].push_back(values[i]);
    }
    std::sort(rows.begin(), rows.end());
    return rows;
}

std::map<std::string, std::string> attribute_types(const CloudInfo& info) {
    std::map<std::string, std::string> types;
    for (const Attribute& attribute : info.attributes)
        types[attribute.name] = std::string(scalar_name(attribute.type)) + " x " + std::to_string(attribute.components);
    return types;
}

/// The set holds every point of the scans, with the same integers and all attributes.
void expect_same_points(const std::vector<std::string>& scans, const std::string& set) {
    const std::unique_ptr<PointSource> source = open_points(scans);
    const std::unique_ptr<LayeredCloud> cloud = open_layered(set);
    const LayeredPoints points(*cloud);
    EXPECT_EQ(attribute_types(source->info()), attribute_types(cloud->info()));
    const Quantization quantization = source->info().quantization;
    EXPECT_TRUE(sorted_rows(*source, quantization) == sorted_rows(points, quantization));
    const ProgramResult info = run_strata({"info", "--exact", "--json", set});
    EXPECT_EQ(info.exit_code, 0) << info.err;
}

void write_bytes(const std::string& path, const std::vector<std::byte>& bytes) {
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
}

// A point whose every field tells its index, spread over some levels.
test::LasPoint scan_point(int i) {
    return {.x = int32_t(int64_t{i} * 7919 % 40'009), .y = int32_t(int64_t{i} * 104'729 % 30'011), .z = i % 1009, .intensity = uint16_t(i), .return_number = uint8_t(1 + i % 2),
            .number_of_returns = 2, .flags = uint8_t(i % 4), .classification = uint8_t(i % 19), .scan_angle = int16_t(i % 90 - 45),
            .user_data = uint8_t(i / 7), .point_source_id = uint16_t(i / 3), .gps_time = 1e5 + i * 0.001,
            .rgb = {uint16_t(i * 3), uint16_t(i * 5), uint16_t(i * 11)}, .nir = uint16_t(i * 13)};
}

class Convert : public testing::Test {
protected:
    /// `points` points from number `first` on.
    std::string write_scan(const std::string& name, int format, int first, int points, test::LasFile file = {}) const {
        file.minor_version = format >= 6 ? 4 : 3;
        file.point_format = format;
        for (int i = first; i < first + points; ++i) file.records.push_back(test::las_record(format, scan_point(i)));
        write_bytes(folder_.file(name), file.bytes());
        return folder_.file(name);
    }
    /// Converts into "out" and returns the report.
    json converted(const std::vector<std::string>& words) const {
        std::vector<std::string> all = {"convert", "--json", "--no-sync"};
        all.insert(all.end(), words.begin(), words.end());
        const ProgramResult result = run_strata(all);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        EXPECT_EQ(result.err, "");
        return json::parse(result.out, nullptr, false);
    }
    static void expect_refused(const ProgramResult& result, int exit_code, const std::string& reason) {
        EXPECT_EQ(result.exit_code, exit_code);
        EXPECT_TRUE(result.err.starts_with("strata: ")) << result.err;
        EXPECT_NE(result.err.find(reason), std::string::npos) << result.err;
        EXPECT_EQ(result.out, "");
    }

    const TemporaryFolder folder_;
    const std::string out_ = folder_.file("out");
};

TEST_F(Convert, BothEncodingsHoldEveryPointOfEveryFormat) {
    for (int format = 0; format <= 10; ++format)
        for (const char* encoding : {"default", "brotli"}) {
            SCOPED_TRACE("format " + std::to_string(format) + ", " + encoding);
            const std::string scan = write_scan("scan.las", format, 0, 30'000);  // more than a leaf holds
            (void)converted({scan, out_, "--encoding", encoding, "--overwrite"});
            expect_same_points({scan}, out_);
        }
}

// As a hierarchy and as the plain LAZ file that it is, too.
TEST_F(Convert, CopcHoldsEveryPointOfTheNewerFormats) {
    const std::string set = folder_.file("set.copc.laz");
    for (const int format : {6, 7, 8, 9, 10}) {  // the last two without their waveforms
        SCOPED_TRACE("format " + std::to_string(format));
        const std::string scan = write_scan("scan.las", format, 0, 30'000);
        (void)converted({scan, set, "--overwrite"});
        expect_same_points({scan}, set);
        const std::unique_ptr<PointSource> source = open_points({&scan, 1}), plain = open_points({&set, 1});
        EXPECT_TRUE(sorted_rows(*source, source->info().quantization) == sorted_rows(*plain, source->info().quantization));
    }
}

// Older records gain wider fields. Of scan_point's classes 12 is the one that the newer formats say by a flag.
TEST_F(Convert, CopcPromotesTheOlderFormats) {
    const std::string set = folder_.file("set.copc.laz");
    for (int format = 0; format <= 5; ++format) {
        SCOPED_TRACE("format " + std::to_string(format));
        const std::string scan = write_scan("scan.las", format, 0, 30'000);
        const json report = converted({scan, set, "--overwrite"});
        EXPECT_NE(report["notes"].dump().find("overlap"), std::string::npos) << report["notes"];
        EXPECT_EQ(report["notes"].dump().find("GPS time") != std::string::npos, format % 2 == 0 && format != 4) << report["notes"];
        const std::unique_ptr<PointSource> source = open_points({&scan, 1}), plain = open_points({&set, 1});
        const PointBatch before = test::points_of(*source), after = test::points_of(*plain);
        ASSERT_EQ(after.size, before.size);
        const auto sorted = [](const PointSource& cloud, const PointBatch& points, std::string_view name, double scale) {
            std::vector<double> values = test::values_of(cloud, points, name);
            for (double& value : values) value = std::round(value * scale);
            std::sort(values.begin(), values.end());
            return values;
        };
        for (const auto& [name, promoted, scale] : {std::tuple("intensity", "intensity", 1.0), {"return number", "return number", 1.0},
                                                    {"user data", "user data", 1.0}, {"gps-time", "gps-time", 1e6}, {"rgb", "rgb", 1.0}}) {
            if (find_attribute(source->info().attributes, name) < 0) continue;
            EXPECT_TRUE(sorted(*source, before, name, scale) == sorted(*plain, after, promoted, scale)) << name;
        }
        EXPECT_TRUE(sorted(*source, before, "scan angle rank", 1.0) == sorted(*plain, after, "scan angle", 0.006));
        const std::vector<double> old_classes = test::values_of(*source, before, "classification"), classes = test::values_of(*plain, after, "classification"),
                                  flags = test::values_of(*plain, after, "classification flags");
        const auto overlaps = std::count(old_classes.begin(), old_classes.end(), 12.0);
        EXPECT_GT(overlaps, 1000);
        EXPECT_EQ(std::count(classes.begin(), classes.end(), 12.0), 0);
        EXPECT_EQ(std::count(classes.begin(), classes.end(), 1.0), std::count(old_classes.begin(), old_classes.end(), 1.0) + overlaps);
        EXPECT_EQ(std::count_if(flags.begin(), flags.end(), [](double f) { return (int(f) & 8) != 0; }), overlaps);
    }
}

// The bytes that strict readers look at, at the places that LAS 1.4 and COPC 1.0 give.
TEST_F(Convert, CopcHasTheHeaderThatReadersLookFor) {
    test::LasFile file{.scale = {0.01, 0.02, 0.001}, .offset = {5e5, 5e6, -3.0}};
    file.vlrs.push_back({"LASF_Projection", 2112, test::bytes_of("LOCAL_CS[\"here\"]")});
    file.global_encoding = 16;
    const std::string scan = write_scan("scan.las", 7, 0, 30'000, file), set = folder_.file("set.copc.laz");
    (void)converted({scan, set});
    const std::string bytes = test::file_contents(set);
    const auto at = [&]<typename T>(size_t place, T) {
        T value;
        std::memcpy(&value, bytes.data() + place, sizeof value);
        return value;
    };
    EXPECT_EQ(bytes.substr(377, 5), std::string("copc\0", 5));
    EXPECT_EQ(bytes.substr(393, 2), std::string("\1\0", 2));
    EXPECT_EQ(at(94, uint16_t()), 375);
    EXPECT_EQ(at(104, uint8_t()), 7 | 0x80);
    EXPECT_EQ(at(6, uint16_t()), 16);  // WKT; times of the week, as the input says
    for (size_t i = 107; i < 131; ++i) EXPECT_EQ(bytes[i], 0) << i;  // counts of older versions
    EXPECT_EQ(at(131, double()), 0.01);
    EXPECT_EQ(at(139, double()), 0.02);
    EXPECT_EQ(at(155, double()), 5e5);
    EXPECT_EQ(at(247, uint64_t()), 30'000u);
    EXPECT_EQ(at(255, uint64_t()) + at(263, uint64_t()), 30'000u);  // first and second returns
    EXPECT_EQ(at(429 + 56, double()), 1e5);                          // GPS time, least and most
    EXPECT_EQ(at(429 + 64, double()), 1e5 + 29.999);
    for (size_t i = 429 + 72; i < 429 + 160; ++i) EXPECT_EQ(bytes[i], 0) << i;  // reserved
    const uint64_t first_extended = at(235, uint64_t());
    EXPECT_EQ(at(243, uint32_t()), 1u);
    EXPECT_EQ(bytes.substr(first_extended + 2, 5), std::string("copc\0", 5));
    EXPECT_EQ(at(first_extended + 18, uint16_t()), 1000);
    EXPECT_EQ(first_extended + 60 + at(first_extended + 20, uint64_t()), bytes.size());
    EXPECT_EQ(at(429 + 40, uint64_t()), first_extended + 60);  // the root's page
    EXPECT_EQ(open_layered(set)->info().crs, "LOCAL_CS[\"here\"]");
}

// Only a name, which no one can look up: the keys are handed on.
TEST_F(Convert, CopcKeepsKeysThatHaveNoWkt) {
    std::vector<std::byte> keys;
    for (const uint16_t number : {1, 1, 0, 2, 3072, 0, 1, 32767, 3073, 34737, 8, 0}) test::put(keys, number);
    test::LasFile file;
    file.vlrs.push_back({"LASF_Projection", 34735, keys});
    file.vlrs.push_back({"LASF_Projection", 34737, test::bytes_of("my grid|")});
    const std::string scan = write_scan("scan.las", 1, 0, 10, file), set = folder_.file("set.copc.laz");
    const json report = converted({scan, set});
    EXPECT_NE(report["notes"].dump().find("; its GeoTIFF keys are kept: my grid"), std::string::npos) << report["notes"];
    const std::unique_ptr<PointSource> before = open_points({&scan, 1}), after = open_points({&set, 1});
    EXPECT_EQ(before->info().crs_records.size(), 2u);
    EXPECT_EQ(after->info().crs_records, before->info().crs_records);
    EXPECT_EQ(after->info().crs, "my grid");
}

// Neither threads nor memory show in the file.
TEST_F(Convert, CopcIsTheSameBytesHoweverItIsMade) {
    const std::string scan = write_scan("scan.las", 8, 0, 200'000);
    (void)converted({scan, folder_.file("a.copc.laz"), "--threads", "1"});
    (void)converted({scan, folder_.file("b.copc.laz"), "--threads", "5"});
    EXPECT_TRUE(test::file_contents(folder_.file("a.copc.laz")) == test::file_contents(folder_.file("b.copc.laz")));
}

TEST_F(Convert, CopcOfNoPoints) {
    const std::string set = folder_.file("set.copc.laz");
    EXPECT_EQ(converted({write_scan("scan.las", 6, 0, 0, {.record_size = 30}), set})["points_written"], 0);
    EXPECT_EQ(open_layered(set)->info().points, 0u);
    EXPECT_EQ(run_strata({"info", "--exact", set}).exit_code, 0);
}

TEST_F(Convert, ReportsWhatItDid) {
    const std::string scan = write_scan("scan.las", 3, 0, 30'000);
    const json report = converted({scan, out_});
    for (const char* key : {"points_read", "points_written", "points_dropped", "seconds", "peak_memory_bytes", "temporary_bytes", "output_bytes", "worst_rounding"})
        EXPECT_TRUE(report.contains(key) && report[key].is_number()) << key;
    EXPECT_EQ(report["points_read"], 30'000);
    EXPECT_EQ(report["points_written"], 30'000);
    EXPECT_EQ(report["points_dropped"], 0);
    EXPECT_EQ(report["worst_rounding"], 0.0);
    uint64_t bytes = 0;
    for (const auto& entry : fs::directory_iterator(out_)) bytes += entry.file_size();
    EXPECT_EQ(report["output_bytes"], bytes);
}

TEST_F(Convert, ExtraBytesAndTheCoordinateSystemArrive) {
    test::LasFile file{.global_encoding = 16};
    file.vlrs.push_back({"LASF_Spec", 4, test::extra_bytes_entry("height above ground", 6, 8 | 16, {0.01}, {-5.0})});
    file.vlrs.push_back({"LASF_Projection", 2112, test::bytes_of("LOCAL_CS[\"here\"]")});
    file.minor_version = 4;
    file.point_format = 7;
    for (int i = 0; i < 100; ++i) {
        file.records.push_back(test::las_record(7, scan_point(i)));
        test::put(file.records.back(), int32_t(i * 1000 - 50'000));
    }
    const std::string scan = folder_.file("scan.las");
    write_bytes(scan, file.bytes());
    (void)converted({scan, out_});
    expect_same_points({scan}, out_);
    const std::unique_ptr<LayeredCloud> cloud = open_layered(out_);
    EXPECT_EQ(cloud->info().crs, "LOCAL_CS[\"here\"]");
    const int index = find_attribute(cloud->info().attributes, "height above ground");
    ASSERT_GE(index, 0);
    EXPECT_EQ(cloud->info().attributes[size_t(index)].scale, 0.01);
    EXPECT_EQ(cloud->info().attributes[size_t(index)].offset, -5.0);
}

// What stands for no value is no least one; a column without values has neither a least nor a most.
TEST_F(Convert, RangesOfExtraBytesPassOverNoData) {
    test::LasFile file{.minor_version = 4, .point_format = 6};
    file.vlrs.push_back({"LASF_Spec", 4, test::extra_bytes_entry("height", 4, 1, {}, {}, uint64_t(int64_t(-9999)))});
    const std::vector<std::byte> nothing = test::extra_bytes_entry("nothing", 9);
    file.vlrs[0].payload.insert(file.vlrs[0].payload.end(), nothing.begin(), nothing.end());
    for (int i = 0; i < 30; ++i) {
        file.records.push_back(test::las_record(6, scan_point(i)));
        test::put(file.records.back(), int16_t(i < 10 ? -9999 : i));
        test::put(file.records.back(), std::numeric_limits<float>::quiet_NaN());
    }
    const std::string scan = folder_.file("scan.las"), plain = folder_.file("plain.las"), set = folder_.file("set.copc.laz");
    write_bytes(scan, file.bytes());
    (void)converted({scan, out_});
    (void)converted({scan, plain});
    (void)converted({scan, set});
    for (const std::string& path : {plain, set}) {
        SCOPED_TRACE(path);
        const std::string bytes = test::file_contents(path);
        const auto at = [&](size_t place) {
            int64_t value;
            std::memcpy(&value, bytes.data() + place, sizeof value);
            return value;
        };
        const size_t entry = bytes.find("height") - 4;  // of 192 bytes, the name is the fifth
        ASSERT_LT(entry, bytes.size());
        EXPECT_EQ(bytes[entry + 3], 1 | 2 | 4);
        EXPECT_EQ(at(entry + 40), -9999);
        EXPECT_EQ(at(entry + 64), 10);
        EXPECT_EQ(at(entry + 88), 29);
        EXPECT_EQ(bytes.substr(entry + 192 + 4, 7), "nothing");
        EXPECT_EQ(bytes[entry + 192 + 3], 0);
    }
    const std::unique_ptr<LayeredCloud> cloud = open_layered(out_);
    const CloudInfo& info = cloud->info();
    const size_t height = size_t(find_attribute(info.attributes, "height"));
    EXPECT_EQ(info.attribute_min.at(height), std::vector<double>{10});
    EXPECT_EQ(info.attribute_max.at(height), std::vector<double>{29});
    EXPECT_EQ(info.attributes[height].no_data, -9999.0);
    EXPECT_TRUE(std::isnan(info.attributes[size_t(find_attribute(info.attributes, "nothing"))].no_data));
    // And back again, by way of the folder.
    const std::string back = folder_.file("back.las");
    (void)converted({out_, back});
    const std::vector<Attribute> attributes = open_points({&back, 1})->info().attributes;
    EXPECT_EQ(attributes[size_t(find_attribute(attributes, "height"))].no_data, -9999.0);
}

// Times that are no numbers say nothing of the others.
TEST_F(Convert, CopcSaysTheRangeOfFiniteTimes) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    test::LasFile file{.minor_version = 4, .point_format = 6};
    for (const double time : {kInfinity, 1e8 + 1.0, -kInfinity, 1e8, std::numeric_limits<double>::quiet_NaN(), 1e8 + 0.5})
        file.records.push_back(test::las_record(6, {.x = int32_t(file.records.size()), .gps_time = time}));
    const std::string scan = folder_.file("scan.las"), set = folder_.file("set.copc.laz");
    write_bytes(scan, file.bytes());
    (void)converted({scan, set});
    const std::string bytes = test::file_contents(set);
    std::array<double, 2> range{};
    std::memcpy(range.data(), bytes.data() + 429 + 56, sizeof range);
    EXPECT_EQ(range, (std::array{1e8, 1e8 + 1.0}));
}

TEST_F(Convert, SeveralFilesAndAFolderOfThemAreOneCloud) {
    const std::string whole = write_scan("whole.las", 3, 0, 20'000);
    fs::create_directory(folder_.file("parts"));
    const std::string a = write_scan("parts/a.las", 3, 0, 12'000), b = write_scan("parts/b.LAS", 3, 12'000, 8'000);
    std::ofstream(folder_.file("parts/readme.txt")) << "not a scan";
    EXPECT_EQ(converted({a, b, out_})["points_written"], 20'000);
    expect_same_points({whole}, out_);
    EXPECT_EQ(converted({folder_.file("parts"), folder_.file("of_folder")})["points_written"], 20'000);
    expect_same_points({whole}, folder_.file("of_folder"));
    fs::create_directory(folder_.file("empty"));
    expect_refused(run_strata({"convert", folder_.file("empty"), folder_.file("none")}), 1, "no files of points (.las, .laz, .drc)");
}

TEST_F(Convert, FilesOfSeveralScalesAndOffsetsKeepTheirPlaces) {
    const std::string coarse = write_scan("coarse.las", 1, 0, 500, {.scale = {0.01, 0.01, 0.01}, .offset = {100.0, 0.0, 0.0}});
    const std::string fine = write_scan("fine.las", 1, 500, 500, {.scale = {0.001, 0.001, 0.001}, .offset = {0.0, -50.0, 0.0}});
    EXPECT_EQ(converted({coarse, fine, out_})["points_written"], 1000);
    // Each part's own points, by its own numbers: in millimetres, which hold both.
    const Quantization millimetres{Vec3d::Constant(0.001), Vec3d::Zero()};
    std::vector<Row> rows;
    for (const std::string& scan : {coarse, fine}) {
        const std::vector<Row> part = sorted_rows(*open_points({&scan, 1}), millimetres);
        rows.insert(rows.end(), part.begin(), part.end());
    }
    std::sort(rows.begin(), rows.end());
    const std::unique_ptr<LayeredCloud> cloud = open_layered(out_);
    EXPECT_TRUE(rows == sorted_rows(LayeredPoints(*cloud), millimetres));
}

TEST_F(Convert, WrongWordsAreUsageErrors) {
    const std::string scan = write_scan("scan.las", 0, 0, 10);
    expect_refused(run_strata({"convert", scan, out_, "--encoding", "zip"}), 2, "--encoding: expected default or brotli, got 'zip'");
    expect_refused(run_strata({"convert", scan, out_, "--format", "xyz"}), 2, "--format: expected potree, copc, drc, las, laz, got 'xyz'");
    expect_refused(run_strata({"convert", scan, out_, "--encoding", "brotli", "--quality", "12"}), 2, "--quality: expected a whole number from 0 to 11");
    expect_refused(run_strata({"convert", scan, folder_.file("set.copc.laz"), "--encoding", "brotli"}), 2, "--encoding is for potree, the output is copc");
    expect_refused(run_strata({"convert", scan, out_, "--threads", "0"}), 2, "--threads");
    expect_refused(run_strata({"convert", scan, out_, "--memory", "much"}), 2, "--memory: expected a size");
    expect_refused(run_strata({"convert", scan}), 2, "expected IN... OUT");
    EXPECT_FALSE(fs::exists(out_));
}

TEST_F(Convert, InputsThatAreNoScansAreToldApart) {
    const std::string scan = write_scan("scan.las", 0, 0, 10);
    std::string bytes = test::file_contents(scan);
    bytes[104] |= char(0x80);  // what LASzip does to the point format
    std::ofstream(folder_.file("scan.laz"), std::ios::binary) << bytes;
    expect_refused(run_strata({"convert", folder_.file("scan.laz"), out_}), 1, "record 'laszip encoded' is missing");
    std::ofstream(folder_.file("notes.txt")) << "some words";
    expect_refused(run_strata({"convert", folder_.file("notes.txt"), out_}), 1, "not a format that strata knows; this version reads las, laz, ");
    expect_refused(run_strata({"convert", folder_.file("missing.las"), out_}), 1, "missing.las: No such file");
    std::ofstream(folder_.file("empty.las"));
    expect_refused(run_strata({"convert", folder_.file("empty.las"), out_}), 1, "an empty file");
    expect_refused(run_strata({"convert", scan, folder_.file("missing.las"), out_}), 1, "missing.las: No such file");
    EXPECT_FALSE(fs::exists(out_));
}

TEST_F(Convert, ARealScan) {
    const char* const data = std::getenv("STRATA_DATA");
    const std::string scan = std::string(data ? data : "") + "/las/1.2-with-color.las", clipped = std::string(data ? data : "") + "/las/1.2-with-color-clipped.las";
    if (!data || !fs::exists(scan)) GTEST_SKIP() << "STRATA_DATA names no folder with real scans";
    for (const char* encoding : {"default", "brotli"}) {
        (void)converted({scan, out_, "--encoding", encoding, "--overwrite"});
        expect_same_points({scan}, out_);
    }
    if (fs::exists(clipped)) expect_refused(run_strata({"convert", clipped, folder_.file("none")}), 1, "the header counts 1065 points of 34 bytes, the file holds 1064");
}

}  // namespace
}  // namespace strata
