// strata convert to plain LAS and LAZ, by the real program.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/las_file.h"
#include "tests/support/lively_points.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::file_contents;
using test::LasFile;
using test::ProgramResult;
using test::run_strata;

template <typename T>
T at(const std::string& bytes, size_t position) {
    T value{};
    std::memcpy(&value, bytes.data() + position, sizeof value);
    return value;
}

// Of an uncompressed file, taken out by the specification's offsets.
struct Records {
    explicit Records(const std::string& path) {
        const std::string file = file_contents(path);
        minor_version = file[25];
        format = file[104];
        size = at<uint16_t>(file, 105);
        count = minor_version < 4 ? at<uint32_t>(file, 107) : at<uint64_t>(file, 247);
        if (count == 0) count = at<uint32_t>(file, 107);
        bytes = file.substr(at<uint32_t>(file, 96), count * size);
        scale_and_offset = file.substr(131, 48);
        bounds = file.substr(179, 48);
        adjusted_time = file[6] & 1;
    }
    int minor_version, format;
    size_t size;
    uint64_t count;
    std::string bytes, scale_and_offset, bounds;
    int adjusted_time;
};

class ConvertPlain : public testing::Test {
protected:
    std::string file(const std::string& name) const { return folder_.file(name); }

    /// The notes of the report.
    json convert(std::vector<std::string> words) const {
        words.insert(words.begin(), "convert");
        words.insert(words.end(), {"--json", "--no-sync"});
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        EXPECT_EQ(result.err, "");
        return result.exit_code == 0 ? json::parse(result.out) : json();
    }
    std::string refusal(std::vector<std::string> words) const {
        words.insert(words.begin(), "convert");
        const ProgramResult result = run_strata(words);
        EXPECT_NE(result.exit_code, 0);
        return result.err;
    }
    void write(const std::string& path, const LasFile& las) const {
        const std::vector<std::byte> bytes = las.bytes();
        std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    }
    /// A made-up scan with extra bytes and more than one chunk.
    LasFile lively(int format, int points) const {
        LasFile las{.minor_version = format < 6 ? 2 : 4,
                    .point_format = format,
                    .global_encoding = uint16_t(format < 6 ? 0 : 17),
                    .scale = {0.001, 0.25, 0.5},
                    .offset = {1e5, 0.0, -7.0}};
        las.vlrs = {{"LASF_Spec", 4, test::extra_bytes_entry("a", 1)}};
        const auto more = test::extra_bytes_entry("pair", 11);
        las.vlrs[0].payload.insert(las.vlrs[0].payload.end(), more.begin(), more.end());
        for (int i = 0; i < points; ++i) las.records.push_back(test::lively_record(format, i, 3));
        return las;
    }

    const TemporaryFolder folder_;
};

class EachFormat : public ConvertPlain, public testing::WithParamInterface<int> {};

TEST_P(EachFormat, RecordsComeBackByteForByte) {
    const int format = GetParam(), points = 60'000;
    write(file("in.las"), lively(format, points));
    const json packed = convert({file("in.las"), file("a.laz")}), plain = convert({file("a.laz"), file("b.las")});
    convert({file("b.las"), file("c"), "--format", "laz"});
    EXPECT_EQ(packed["points_read"], points);
    EXPECT_EQ(packed["points_written"], points);
    EXPECT_EQ(packed["points_dropped"], 0);
    EXPECT_EQ(packed["point_format"], format);
    EXPECT_EQ(packed["temporary_bytes"], 0);
    EXPECT_EQ(packed["worst_rounding"], 0.0);
    EXPECT_EQ(packed["output_bytes"], fs::file_size(file("a.laz")));
    EXPECT_EQ(packed["notes"], json::array());
    EXPECT_EQ(plain["notes"], json::array());
    EXPECT_LT(fs::file_size(file("a.laz")), fs::file_size(file("in.las")) * 9 / 10);
    const Records before(file("in.las")), after(file("b.las"));
    EXPECT_EQ(after.format, format);
    EXPECT_EQ(after.minor_version, format < 6 ? 2 : 4);
    EXPECT_EQ(after.size, before.size);
    EXPECT_EQ(after.count, before.count);
    EXPECT_TRUE(after.bytes == before.bytes);
    EXPECT_TRUE(after.scale_and_offset == before.scale_and_offset);
    EXPECT_EQ(after.adjusted_time, format < 6 ? 0 : 1);
    EXPECT_TRUE(file_contents(file("a.laz")) == file_contents(file("c")));
    EXPECT_EQ(json::parse(run_strata({"info", "--json", file("c")}).out)["format"], "laz");
}

INSTANTIATE_TEST_SUITE_P(Las, EachFormat, testing::Values(0, 1, 2, 3, 6, 7, 8));

// The same, of scans of many makers. Their wave packets and undescribed bytes are left out, with a note.
TEST_F(ConvertPlain, RealScansComeBackByteForByte) {
    const char* const data = std::getenv("STRATA_DATA");
    if (!data) GTEST_SKIP() << "STRATA_DATA is not set: it names the folder of real scans";
    int same = 0;
    for (const auto& entry : fs::directory_iterator(fs::path(data) / "las")) {
        SCOPED_TRACE(entry.path().filename());
        if (entry.path().filename() == "1.2-with-color-clipped.las") continue;  // its last point is cut off
        const json report = convert({entry.path(), file("a.laz"), "--overwrite"});
        convert({file("a.laz"), file("b.las"), "--overwrite"});
        const Records before(entry.path()), after(file("b.las"));
        EXPECT_EQ(after.count, before.count);
        EXPECT_TRUE(after.scale_and_offset == before.scale_and_offset);
        const auto crs_of = [](const std::string& path) { return json::parse(run_strata({"info", "--json", path}).out)["crs"]; };
        EXPECT_EQ(crs_of(file("b.las")), crs_of(entry.path()));
        const std::string notes = report["notes"].dump();
        if (notes.find("wave packets") != std::string::npos || notes.find("no description") != std::string::npos) continue;
        EXPECT_EQ(after.format, before.format);
        EXPECT_EQ(after.adjusted_time, before.format == 0 || before.format == 2 ? 0 : before.adjusted_time);
        EXPECT_TRUE(after.bytes == before.bytes);
        ++same;
    }
    EXPECT_GE(same, 25);
}

TEST_F(ConvertPlain, TheOutputDoesNotDependOnThreadsOrMemory) {
    write(file("in.las"), lively(7, 180'000));
    for (const std::string ending : {".las", ".laz"}) {
        convert({file("in.las"), file("one" + ending), "--threads", "1"});
        convert({file("in.las"), file("four" + ending), "--threads", "4", "--memory", "64M"});
        EXPECT_TRUE(file_contents(file("one" + ending)) == file_contents(file("four" + ending)));
    }
}

TEST_F(ConvertPlain, ManyFilesBecomeOne) {
    write(file("a.las"), lively(7, 70'000));
    LasFile second = lively(7, 100);
    second.offset[0] += 2.0;                                                                  // 2000 steps of 0.001
    for (std::vector<std::byte>& record : second.records) test::poke<int32_t>(record, 0, 5);  // room for them
    write(file("b.las"), second);
    EXPECT_EQ(convert({file("a.las"), file("b.las"), file("both.laz")})["points_written"], 70'100);
    convert({file("both.laz"), file("both.las")});
    const Records a(file("a.las")), b(file("b.las")), both(file("both.las"));
    ASSERT_EQ(both.count, 70'100u);
    EXPECT_TRUE(both.scale_and_offset == a.scale_and_offset);
    EXPECT_TRUE(both.bytes.substr(0, a.bytes.size()) == a.bytes);
    for (size_t i = 0; i < b.count; ++i) {
        const std::string found = both.bytes.substr(a.bytes.size() + i * a.size, a.size), expected = b.bytes.substr(i * b.size, b.size);
        ASSERT_EQ(at<int32_t>(found, 0), at<int32_t>(expected, 0) + 2000) << i;
        ASSERT_TRUE(found.substr(4) == expected.substr(4)) << i;
    }
}

// Old and new point formats together take a new one, and what that means is said.
TEST_F(ConvertPlain, OldPointsAmongNewOnesArePromoted) {
    LasFile old{.point_format = 1}, young{.minor_version = 4, .point_format = 7, .global_encoding = 17};
    old.records = {
        test::las_record(1, {.x = 1, .return_number = 2, .number_of_returns = 3, .classification = 5, .scan_angle = -30, .gps_time = 9.0}),
        test::las_record(1, {.x = 3, .flags = 1, .classification = 12})};
    young.records = {test::las_record(7, {.x = 2,
                                          .return_number = 9,
                                          .number_of_returns = 12,
                                          .flags = 8,
                                          .classification = 200,
                                          .scan_angle = 77,
                                          .rgb = {1000, 2000, 3000}})};
    write(file("old.las"), old);
    write(file("young.las"), young);
    const json report = convert({file("old.las"), file("young.las"), file("out.las")});
    EXPECT_EQ(report["point_format"], 7);
    EXPECT_NE(report["notes"].dump().find("young.las: GPS times are standard time"), std::string::npos);
    EXPECT_NE(report["notes"].dump().find("old.las: scan angles of whole degrees become"), std::string::npos);
    LasFile expected = young;
    expected.records = {
        test::las_record(7,
                         {.x = 1, .return_number = 2, .number_of_returns = 3, .classification = 5, .scan_angle = -5000, .gps_time = 9.0}),
        test::las_record(7, {.x = 3, .flags = 9, .classification = 1}),
        young.records[0]};
    write(file("expected.las"), expected);
    EXPECT_TRUE(Records(file("out.las")).bytes == Records(file("expected.las")).bytes);
    EXPECT_EQ(Records(file("out.las")).adjusted_time, 0);  // as the first file has it
}

TEST_F(ConvertPlain, APartKeepsItsOrder) {
    const LasFile las = lively(6, 5000);
    write(file("in.las"), las);
    EXPECT_EQ(convert({file("in.las"), file("part.las"), "--every", "7"})["points_written"], 715);
    const Records whole(file("in.las")), part(file("part.las"));
    ASSERT_EQ(part.count, 715u);
    double most = -INFINITY;
    for (size_t i = 0; i < part.count; ++i) {
        ASSERT_TRUE(part.bytes.substr(i * part.size, part.size) == whole.bytes.substr(7 * i * part.size, part.size)) << i;
        most = std::max(most, at<int32_t>(part.bytes, i * part.size) * 0.001 + 1e5);
    }
    EXPECT_EQ(at<double>(part.bounds, 0), most);  // of the points written
    size_t ground = 0;
    for (size_t i = 0; i < whole.count; ++i) ground += whole.bytes[i * whole.size + 16] == 2;
    ASSERT_GT(ground, 0u);
    EXPECT_EQ(convert({file("in.las"), file("ground.laz"), "--classes", "2"})["points_written"], ground);
}

// A level-of-detail data set holds the points of the scan in another order.
TEST_F(ConvertPlain, ADataSetGivesItsPointsBack) {
    ASSERT_EQ(run_strata({"sample", file("scan.las"), "--points", "30000", "--quiet"}).exit_code, 0);
    convert({file("scan.las"), file("set")});
    const json report = convert({file("set"), file("back.las")});
    EXPECT_EQ(report["points_written"], 30'000);
    EXPECT_EQ(report["point_format"], 7);
    json before = json::parse(run_strata({"info", "--exact", "--json", file("scan.las")}).out);
    json after = json::parse(run_strata({"info", "--exact", "--json", file("back.las")}).out);
    for (const char* key : {"points", "scale", "attributes", "points_by_return", "points_by_class", "crs"})
        EXPECT_EQ(before[key], after[key]) << key;
    EXPECT_EQ(Records(file("back.las")).adjusted_time, 1);  // follows from the times
    for (const char* end : {"min", "max"})
        for (size_t axis = 0; axis < 3; ++axis)
            EXPECT_NEAR(before["bounds"][end][axis].get<double>(), after["bounds"][end][axis].get<double>(), 1e-6);
}

TEST_F(ConvertPlain, WhatCannotBeIsRefused) {
    write(file("in.las"), lively(6, 10));
    write(file("there.laz"), lively(6, 10));
    const std::string before = file_contents(file("there.laz"));
    EXPECT_NE(refusal({file("in.las"), file("there.laz")}).find("--overwrite"), std::string::npos);
    EXPECT_EQ(file_contents(file("there.laz")), before);
    EXPECT_NE(refusal({file("in.las"), file("in.las"), "--overwrite"}).find("is an input"), std::string::npos);
    for (const char* const flag : {"--normals", "--density"})
        EXPECT_NE(refusal({file("in.las"), file("out.las"), flag}).find(flag), std::string::npos);
    EXPECT_NE(refusal({file("in.las"), file("out.laz"), "--encoding", "brotli"}).find("--encoding"), std::string::npos);
    EXPECT_FALSE(fs::exists(file("out.las")) || fs::exists(file("out.laz")));
    convert({file("in.las"), file("there.laz"), "--overwrite"});
    EXPECT_NE(file_contents(file("there.laz")), before);
}

TEST_F(ConvertPlain, AnEndBeforeTheEndLeavesNothing) {
    ASSERT_EQ(run_strata({"sample", file("scan.las"), "--points", "1000000", "--quiet"}).exit_code, 0);
    for (const std::string ending : {".las", ".laz"}) {
        const double seconds = run_strata({"convert", file("scan.las"), file("whole" + ending), "--quiet", "--no-sync"}).seconds;
        const std::string whole = file_contents(file("whole" + ending));
        fs::remove(file("whole" + ending));
        int ended = 0;
        for (const double part : {0.2, 0.5, 0.8}) {
            const std::string out = file("out" + ending);
            const ProgramResult result =
                run_strata({"convert", file("scan.las"), out, "--quiet", "--no-sync"}, {.signal = SIGTERM, .signal_after = part * seconds});
            // It may have got its name just before the end: then it is whole.
            if (fs::exists(out)) EXPECT_TRUE(file_contents(out) == whole);
            fs::remove(out);
            EXPECT_EQ(test::entries(folder_.path()), 1u) << ending;
            ended += result.exit_code != 0;
        }
        EXPECT_GT(ended, 0) << "every signal came too late: nothing was tested";
    }
}

}  // namespace
}  // namespace strata
