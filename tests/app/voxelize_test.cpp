// strata voxelize and what reads its files, by the real program.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::run_strata;

void write_text(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

// A cube of 8 units a side with its corner at (10, 20, 30), quads outward.
std::string cube_obj() {
    std::string text;
    for (int corner = 0; corner < 8; ++corner)
        text += "v " + std::to_string(10 + 8 * (corner & 1)) + " " + std::to_string(20 + 4 * (corner & 2)) + " " + std::to_string(30 + 2 * (corner & 4)) + "\n";
    return text + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
}

json voxelize(std::vector<std::string> words) {
    words.insert(words.begin(), "voxelize");
    words.push_back("--json");
    const ProgramResult result = run_strata(words);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_TRUE(result.err.empty()) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json();
}

json info(const std::string& path) {
    const ProgramResult result = run_strata({"info", "--exact", "--json", path});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json();
}

// Faces of the cube lie on faces of voxels, so that each count is known: of 1/2 unit, a side is 16 voxels.
TEST(Voxelize, KindsOfACube) {
    const TemporaryFolder folder;
    const std::string cube = folder.file("cube.obj");
    write_text(cube, cube_obj());
    const auto count = [&](const char* kind) {
        const std::string path = folder.file(std::string(kind) + ".svo");
        const json report = voxelize({cube, "-o", path, "--voxel-size", "0.5", "--kind", kind});
        const json said = info(path);
        EXPECT_EQ(said["voxels"], report["voxels"]);
        EXPECT_EQ(said["nodes"], report["nodes"]);
        EXPECT_EQ(said["bytes"], report["output_bytes"]);
        EXPECT_EQ(said["kind"], kind);
        EXPECT_EQ(said["bytes"], std::filesystem::file_size(path));
        EXPECT_EQ(said["valid"], true);
        return report["voxels"].get<int>();
    };
    // Both layers at each face: a shell two thick around the 14^3 inside of them, 18^3 in all.
    EXPECT_EQ(count("conservative"), 18 * 18 * 18 - 14 * 14 * 14);
    // One layer a face, in the voxels above it. Those of the three lower faces share edges, of 16 voxels with one corner.
    EXPECT_EQ(count("thin"), 6 * 16 * 16 - (3 * 16 - 1));
    const json shell = info(folder.file("conservative.svo"));
    EXPECT_EQ(shell["bounds"]["min"], json({9.5, 19.5, 29.5}));
    EXPECT_EQ(shell["bounds"]["max"], json({18.5, 28.5, 38.5}));
    EXPECT_EQ(shell["voxel_size"], 0.5);
}

TEST(Voxelize, PointsKeepCountAndColor) {
    const TemporaryFolder folder;
    ASSERT_EQ(run_strata({"sample", folder.file("scan.las"), "--points", "20000", "--quiet"}).exit_code, 0);
    const json report = voxelize({folder.file("scan.las"), "-o", folder.file("scan.svo"), "--voxel-size", "2", "--attributes", "count,color"});
    EXPECT_EQ(report["points_read"], 20000);
    EXPECT_EQ(report["kind"], "points");
    EXPECT_GT(report["voxels"], 100);
    EXPECT_LT(report["voxels"], 20000);
    const json said = info(folder.file("scan.svo"));
    ASSERT_EQ(said["attributes"].size(), 2u);
    EXPECT_EQ(said["attributes"][0]["name"], "color");
    EXPECT_EQ(said["attributes"][1]["name"], "count");
    // The voxels lie where the points do.
    const json points = info(folder.file("scan.las"));
    for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(said["bounds"]["min"][axis], 2 * std::floor(points["bounds"]["min"][axis].get<double>() / 2));
        EXPECT_EQ(said["bounds"]["max"][axis], 2 * std::floor(points["bounds"]["max"][axis].get<double>() / 2) + 2);
    }
    EXPECT_EQ(said["crs"], points["crs"]);
    // And their bytes do not depend on how they were made.
    voxelize({folder.file("scan.las"), "-o", folder.file("again.svo"), "--voxel-size", "2", "--attributes", "count,color", "--threads", "1", "--memory", "64M"});
    EXPECT_EQ(test::file_contents(folder.file("scan.svo")), test::file_contents(folder.file("again.svo")));
}

TEST(Voxelize, WrongWords) {
    const TemporaryFolder folder;
    const std::string cube = folder.file("cube.obj"), out = folder.file("out.svo");
    write_text(cube, cube_obj());
    const auto refused = [&](std::vector<std::string> words, int code, const std::string& message) {
        words.insert(words.begin(), "voxelize");
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, code) << result.err;
        EXPECT_NE(result.err.find(message), std::string::npos) << result.err;
        EXPECT_FALSE(std::filesystem::exists(out));
    };
    refused({cube}, 2, "--output OUT.svo is expected");
    refused({cube, "-o", folder.file("out.xyz")}, 2, "ends in .svo");
    refused({cube, "-o", out, "--resolution", "0"}, 2, "--resolution: expected a whole number from 1");
    refused({cube, "-o", out, "--resolution", "9", "--voxel-size", "1"}, 2, "one of them");
    refused({cube, "-o", out, "--voxel-size", "-1"}, 2, "--voxel-size: expected a positive number");
    refused({cube, "-o", out, "--voxel-size", "1e-9"}, 2, "at most 1048576");
    refused({cube, "-o", out, "--kind", "points"}, 2, "--kind: expected conservative or thin for a mesh");
    refused({cube, "-o", out, "--attributes", "colour"}, 2, "--attributes: expected color");
    refused({folder.file("none.obj"), "-o", out}, 1, "none.obj");
    write_text(folder.file("points.obj"), "v 1 2 3\nv 4 5 6\n");
    refused({folder.file("points.obj"), "-o", out}, 1, "points.obj");
    write_text(out, "mine");
    EXPECT_EQ(run_strata({"voxelize", cube, "-o", out}).exit_code, 1);
    EXPECT_EQ(test::file_contents(out), "mine");
    EXPECT_EQ(run_strata({"voxelize", cube, "-o", out, "--overwrite", "--quiet", "-r", "16"}).exit_code, 0);
    EXPECT_EQ(run_strata({"voxelize", out, "-o", out, "--overwrite"}).exit_code, 1);
}

}  // namespace
}  // namespace strata
