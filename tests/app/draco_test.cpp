// The commands on Draco files, by the real program.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/io/draco/draco_cloud.h"
#include "tests/support/las_file.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::DracoCloud;
using test::ProgramResult;
using test::run_strata;

void write(const std::string& path, const std::vector<std::byte>& bytes) {
    std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
}

// A lattice of red points in whole metres, as another program writes it.
std::vector<std::byte> red_lattice() {
    DracoCloud cloud(1000);
    std::vector<int32_t> places;
    std::vector<uint8_t> colors;
    for (int i = 0; i < 1000; ++i) {
        places.insert(places.end(), {i % 10, i / 10 % 10, i / 100});
        colors.insert(colors.end(), {255, 0, uint8_t(i % 2)});
    }
    cloud.add(draco::GeometryAttribute::POSITION, draco::DT_INT32, 3, places);
    cloud.add(draco::GeometryAttribute::COLOR, draco::DT_UINT8, 3, colors);
    return cloud.encode();
}

TEST(DracoCommands, InfoReadsEveryPoint) {
    const TemporaryFolder folder;
    const std::string path = folder.file("lattice.drc");
    write(path, red_lattice());
    const ProgramResult result = run_strata({"info", "--exact", "--json", path});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json report = json::parse(result.out);
    EXPECT_EQ(report["format"], "drc");
    EXPECT_EQ(report["points"], 1000);
    EXPECT_EQ(report["bounds"]["max"], json({9.0, 9.0, 9.0}));
    EXPECT_EQ(report["rgb_bits"], 8);
    EXPECT_EQ(report["attributes"][0]["max"], json({255, 0, 1}));
    EXPECT_FALSE(report.contains("warnings"));
}

TEST(DracoCommands, ConvertAndRenderTakeThem) {
    const TemporaryFolder folder;
    const std::string path = folder.file("lattice.drc");
    write(path, red_lattice());
    const ProgramResult converted = run_strata({"convert", path, folder.file("set"), "--json"});
    ASSERT_EQ(converted.exit_code, 0) << converted.err;
    EXPECT_EQ(json::parse(converted.out)["points_written"], 1000);
    // What is drawn is what is drawn of the same points from levels of detail, all of which this small view takes.
    for (const std::string& input : {path, folder.file("set")}) {
        const ProgramResult rendered = run_strata({"render", input, "-o", input + ".png", "--size", "64x64", "--edl", "0", "--quiet"});
        ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
    }
    EXPECT_EQ(test::file_contents(path + ".png"), test::file_contents(folder.file("set.png")));
}

TEST(DracoCommands, AFolderOfFilesIsOneCloud) {
    const TemporaryFolder folder;
    std::filesystem::create_directory(folder.file("tiles"));
    write(folder.file("tiles/a.drc"), red_lattice());
    write(folder.file("tiles/b.drc"), red_lattice());
    const ProgramResult result = run_strata({"convert", folder.file("tiles"), folder.file("set"), "--json"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(json::parse(result.out)["points_written"], 2000);
}

TEST(DracoCommands, ABadFileIsOneLine) {
    const TemporaryFolder folder;
    const std::string path = folder.file("cut.drc");
    std::vector<std::byte> bytes = red_lattice();
    bytes.resize(bytes.size() / 2);
    write(path, bytes);
    EXPECT_EQ(test::refusal_verdict(run_strata({"info", path})), "");
}

// A scan goes to Draco and comes back as the very same points: what is built of it has the bytes of what is built of the scan.
TEST(DracoCommands, AScanComesBackFromAFileAndFromAFolder) {
    const TemporaryFolder folder;
    const std::string scan = folder.file("scan.las");
    const ProgramResult made = run_strata({"sample", scan, "--points", "300000", "--quiet"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    const ProgramResult file = run_strata({"convert", scan, folder.file("scan.drc"), "--json", "--memory", "2G"});
    ASSERT_EQ(file.exit_code, 0) << file.err;
    const json report = json::parse(file.out);
    EXPECT_EQ(report["points_read"], 300000);
    EXPECT_EQ(report["points_written"], 300000);
    EXPECT_EQ(report["points_dropped"], 0);
    EXPECT_EQ(report["blocks"], 1);
    EXPECT_EQ(report["exact"], true);
    EXPECT_EQ(report["output_bytes"], std::filesystem::file_size(folder.file("scan.drc")));
    EXPECT_GT(report["worst_rounding"], 0.0);  // what others see: steps of a power of two below those of the scan
    EXPECT_LE(report["worst_rounding"], 0.0005);
    const ProgramResult blocks = run_strata({"convert", scan, folder.file("blocks"), "--format", "drc", "--json", "--memory", "2G"});
    ASSERT_EQ(blocks.exit_code, 0) << blocks.err;
    EXPECT_EQ(json::parse(blocks.out)["blocks"], 2);
    EXPECT_EQ(test::entries(folder.file("blocks")), 2u);

    for (const std::string& input : {scan, folder.file("scan.drc"), folder.file("blocks")}) {
        const ProgramResult built = run_strata({"convert", input, input + ".set", "--quiet"});
        ASSERT_EQ(built.exit_code, 0) << built.err;
    }
    for (const char* name : {"/octree.bin", "/hierarchy.bin"}) {
        const std::string expected = test::file_contents(scan + ".set" + name);
        EXPECT_FALSE(expected.empty());
        EXPECT_TRUE(test::file_contents(folder.file("scan.drc.set") + name) == expected) << name;
        EXPECT_TRUE(test::file_contents(folder.file("blocks.set") + name) == expected) << name;
    }
}

// By way of Draco a LAS file becomes what it becomes directly: the same header, system and records.
TEST(DracoCommands, LasComesBackAsItWas) {
    const TemporaryFolder folder;
    const std::string scan = folder.file("scan.las");
    ASSERT_EQ(run_strata({"sample", scan, "--points", "50000", "--quiet"}).exit_code, 0);
    ASSERT_EQ(run_strata({"convert", scan, folder.file("scan.drc"), "--quiet"}).exit_code, 0);
    for (const std::string& input : {scan, folder.file("scan.drc")}) {
        const ProgramResult result = run_strata({"convert", input, input + ".out.las", "--quiet"});
        ASSERT_EQ(result.exit_code, 0) << result.err;
    }
    const std::string expected = test::file_contents(scan + ".out.las");
    EXPECT_GT(expected.size(), 50000u * 30);
    EXPECT_TRUE(test::file_contents(folder.file("scan.drc.out.las")) == expected);
}

TEST(DracoCommands, MaxErrorIsHeldAndReported) {
    const TemporaryFolder folder;
    const std::string scan = folder.file("scan.las");
    ASSERT_EQ(run_strata({"sample", scan, "--points", "20000", "--quiet"}).exit_code, 0);
    double bytes = 1e9;
    for (const char* error : {"0.005", "0.05", "0.5"}) {
        const std::string out = folder.file(std::string(error) + ".drc");
        const ProgramResult result = run_strata({"convert", scan, out, "--max-error", error, "--json"});
        ASSERT_EQ(result.exit_code, 0) << result.err;
        const json report = json::parse(result.out);
        EXPECT_LE(report["worst_rounding"], std::stod(error));
        EXPECT_GT(report["worst_rounding"], 0.4 * std::stod(error));
        EXPECT_EQ(report["exact"], false);
        EXPECT_LT(double(report["output_bytes"]), bytes);
        bytes = report["output_bytes"];
    }
    const ProgramResult told = run_strata({"convert", scan, folder.file("told.drc"), "--max-error", "0.05"});
    EXPECT_NE(told.err.find("in 1 block, coordinates within 0.03"), std::string::npos) << told.err;  // half of 2^-4
}

// A point so far away that Draco has no steps for the quanta between: what the default promises is not held, which is said.
TEST(DracoCommands, ADefaultThatCannotBeHeldIsSaid) {
    const TemporaryFolder folder;
    const auto write_stray = [&](const std::string& name, int32_t away) {
        test::LasFile las{.scale = {0.001, 0.001, 0.001}, .max = {0.001 * away, 0.001 * away, 0.001 * away}};
        for (int i = 0; i < 1000; ++i) las.records.push_back(test::las_record(0, {.x = i % 10, .y = i / 10 % 10, .z = i / 100}));
        las.records.push_back(test::las_record(0, {.x = away, .y = away, .z = away}));
        write(folder.file(name), las.bytes());
        return folder.file(name);
    };
    // 20 km are too far for float32 and not for integers.
    const ProgramResult near = run_strata({"convert", write_stray("near.las", 20'000'000), folder.file("near.drc"), "--json"});
    ASSERT_EQ(near.exit_code, 0) << near.err;
    EXPECT_EQ(json::parse(near.out)["exact"], true);
    EXPECT_EQ(json::parse(near.out)["notes"], json::array());

    // 10^9 quanta over 2^25 are 29.8: every 59th is there, and 10^9 is 27 from the next of them.
    const std::string scan = write_stray("stray.las", 1'000'000'000);
    const ProgramResult silent = run_strata({"convert", scan, folder.file("stray.drc"), "--json"});
    ASSERT_EQ(silent.exit_code, 0) << silent.err;
    const json report = json::parse(silent.out);
    EXPECT_EQ(report["exact"], false);
    EXPECT_NEAR(report["worst_rounding"], 0.027, 1e-9);
    ASSERT_EQ(report["notes"].size(), 1u);
    const std::string note = report["notes"][0];
    EXPECT_TRUE(note.starts_with("coordinates move by up to 0.027: ")) << note;
    EXPECT_NE(note.find("--max-error 0.0005 refuses"), std::string::npos) << note;
    const ProgramResult told = run_strata({"convert", scan, folder.file("told.drc")});
    EXPECT_NE(told.err.find("note: " + note), std::string::npos) << told.err;

    const ProgramResult refused = run_strata({"convert", scan, folder.file("half.drc"), "--max-error", "0.0005"});
    EXPECT_EQ(test::refusal_verdict(refused), "");
    const ProgramResult asked = run_strata({"convert", scan, folder.file("asked.drc"), "--max-error", "0.05", "--json"});
    ASSERT_EQ(asked.exit_code, 0) << asked.err;
    EXPECT_EQ(json::parse(asked.out)["notes"], json::array());
}

TEST(DracoCommands, WhatIsAskedWronglyIsSaid) {
    const TemporaryFolder folder;
    const std::string scan = folder.file("scan.las");
    ASSERT_EQ(run_strata({"sample", scan, "--points", "2000", "--quiet"}).exit_code, 0);
    const auto expect_refused = [&](std::vector<std::string> words, int exit_code, const std::string& part) {
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, exit_code) << result.err;
        EXPECT_NE(result.err.find(part), std::string::npos) << result.err;
    };
    expect_refused({"convert", scan, folder.file("a.drc"), "--max-error", "0"}, 2, "--max-error: a positive number");
    expect_refused({"convert", scan, folder.file("a.drc"), "--normals"}, 2, "--normals is for levels of detail, the output is drc");
    expect_refused({"convert", scan, folder.file("set"), "--max-error", "0.1"}, 2, "--max-error is for drc, the output is potree");
    expect_refused({"convert", scan, folder.file("a.drc"), "--bounds", "0,0,0,1,1,1"}, 1, "no points to write");
    EXPECT_FALSE(std::filesystem::exists(folder.file("a.drc")));
    expect_refused({"convert", scan, folder.file("a.drc"), "--memory", "64M"}, 1, "a folder of blocks");
}

}  // namespace
}  // namespace strata
