// strata voxelize and what reads its files, by the real program.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "io/format.h"
#include "io/svo/svo_file.h"
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

const std::string kUnused = "v 1e30 0 0\n";  // a vertex that no face uses may lie anywhere

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
    write_text(cube, cube_obj() + kUnused);
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
    EXPECT_EQ(count("solid"), 16 * 16 * 16);
    // Both layers at each face: a shell two thick around the 14^3 inside of them, 18^3 in all.
    EXPECT_EQ(count("conservative"), 18 * 18 * 18 - 14 * 14 * 14);
    // One layer a face, in the voxels above it. Those of the three lower faces share edges, of 16 voxels with one corner.
    EXPECT_EQ(count("thin"), 6 * 16 * 16 - (3 * 16 - 1));
    const json shell = info(folder.file("conservative.svo"));
    EXPECT_EQ(shell["bounds"]["min"], json({9.5, 19.5, 29.5}));
    EXPECT_EQ(shell["bounds"]["max"], json({18.5, 28.5, 38.5}));
    EXPECT_EQ(shell["voxel_size"], 0.5);
}

// The same voxels, whichever file keeps them: as a tree, as a DAG, and back from a grid of OpenVDB.
TEST(Voxelize, EveryOutputHoldsTheSameVoxels) {
    const TemporaryFolder folder;
    const std::string cube = folder.file("cube.obj");
    write_text(cube, cube_obj());
    const auto make = [&](const std::string& input, const std::string& name, std::vector<std::string> more) {
        more.insert(more.begin(), {input, "-o", folder.file(name)});
        return voxelize(more);
    };
    const json tree = make(cube, "tree.svo", {"--voxel-size", "0.125"});
    const json dag = make(cube, "dag.svo", {"--voxel-size", "0.125", "--dag"});
    EXPECT_EQ(dag["voxels"], tree["voxels"]);
    EXPECT_EQ(dag["nodes"], tree["nodes"]);
    EXPECT_LT(dag["dag_nodes"], tree["nodes"].get<int>() / 10);  // faces of a cube are much the same
    EXPECT_LT(dag["output_bytes"], tree["output_bytes"].get<int>() / 2);
    const json said = info(folder.file("dag.svo")), of_tree = info(folder.file("tree.svo"));
    for (const char* const key : {"voxels", "nodes", "bounds", "level_table", "voxel_size", "origin"}) EXPECT_EQ(said[key], of_tree[key]) << key;

    const ProgramResult grid = run_strata({"voxelize", cube, "-o", folder.file("grid.vdb"), "--voxel-size", "0.125"});
    if (grid.exit_code == 1 && grid.err.find("OpenVDB") != std::string::npos) GTEST_SKIP() << grid.err;
    ASSERT_EQ(grid.exit_code, 0) << grid.err;
    const json back = make(folder.file("grid.vdb"), "back.svo", {});
    EXPECT_EQ(back["voxels"], tree["voxels"]);
    const VoxelTree a = open_svo(folder.file("tree.svo")).load(kMostVoxelLevels, true, 1), b = open_svo(folder.file("back.svo")).load(kMostVoxelLevels, true, 1);
    const VoxelTree c = open_svo(folder.file("dag.svo")).load(kMostVoxelLevels, true, 1);
    ASSERT_EQ(a.levels.size(), b.levels.size());
    ASSERT_EQ(a.levels.size(), c.levels.size());
    for (size_t level = 0; level < a.levels.size(); ++level) {
        EXPECT_EQ(a.levels[level].masks, b.levels[level].masks);
        EXPECT_EQ(a.levels[level].masks, c.levels[level].masks);
    }
}

// Of a level set, what is inside: centers of voxels at most 0 from the surface.
TEST(Voxelize, LevelSetsOfMeshes) {
    const TemporaryFolder folder;
    const std::string cube = folder.file("cube.obj");
    write_text(cube, cube_obj() + kUnused);
    const ProgramResult made = run_strata({"voxelize", cube, "-o", folder.file("set.vdb"), "--voxel-size", "0.25", "--kind", "level-set", "--json"});
    if (made.exit_code == 1 && made.err.find("OpenVDB") != std::string::npos) GTEST_SKIP() << made.err;
    ASSERT_EQ(made.exit_code, 0) << made.err;
    // OpenVDB's lattice has points on the faces of the cube, whose distance is 0 up to rounding: 31^3 points lie deeper.
    const json of_set = voxelize({folder.file("set.vdb"), "-o", folder.file("set.svo"), "--isovalue", "-0.01"});
    EXPECT_EQ(of_set["voxels"], 31 * 31 * 31);
    EXPECT_EQ(of_set["kind"], "level-set");
    EXPECT_EQ(info(folder.file("set.svo"))["bounds"]["min"], json({10.125, 20.125, 30.125}));
}

TEST(Voxelize, PointsKeepCountAndColor) {
    const TemporaryFolder folder;
    ASSERT_EQ(run_strata({"sample", folder.file("scan.las"), "--points", "20000", "--quiet"}).exit_code, 0);
    const json report = voxelize({folder.file("scan.las"), "-o", folder.file("scan.svo"), "--voxel-size", "2", "--attributes", "count,color"});
    EXPECT_EQ(report["points_read"], 20000);
    EXPECT_EQ(report["kind"], "points");
    // As many as there are different places.
    std::set<std::array<int64_t, 3>> places;
    const std::unique_ptr<PointSource> scan = open_points(std::vector<std::string>{folder.file("scan.las")});
    PointBatch batch;
    for (uint64_t i = 0; i < scan->batch_count(); ++i) {
        scan->read_batch(i, {}, batch);
        for (size_t p = 0; p < batch.size; ++p) {
            const Vec3d world = scan->info().quantization.world_from_quanta({batch.x[p], batch.y[p], batch.z[p]});
            places.insert({int64_t(std::floor(world.x() / 2)), int64_t(std::floor(world.y() / 2)), int64_t(std::floor(world.z() / 2))});
        }
    }
    EXPECT_EQ(report["voxels"], places.size());
    const VoxelTree tree = open_svo(folder.file("scan.svo")).load(kMostVoxelLevels, true, 1);
    uint64_t sum = 0;
    for (const uint32_t count : tree.attributes.back().counts) sum += count;
    EXPECT_EQ(sum, 20000u);
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
    refused({cube}, 2, "--output OUT is expected");
    refused({cube, "-o", folder.file("out.xyz")}, 2, "ends in .svo or .vdb");
    refused({cube, "-o", out, "--resolution", "0"}, 2, "--resolution: expected a whole number from 1");
    refused({cube, "-o", out, "--resolution", "9", "--voxel-size", "1"}, 2, "one of them");
    refused({cube, "-o", out, "--voxel-size", "-1"}, 2, "--voxel-size: expected a positive number");
    refused({cube, "-o", out, "--voxel-size", "1e-9"}, 2, "at most 1048576");
    refused({cube, "-o", out, "--kind", "points"}, 2, "--kind: expected conservative, thin, solid or level-set for a mesh");
    refused({cube, "-o", out, "--dag", "--attributes", "opacity"}, 2, "--dag: a DAG");
    refused({cube, "-o", folder.file("out.vdb"), "--dag"}, 2, "--dag is for .svo");
    refused({cube, "-o", out, "--isovalue", "1"}, 2, "--isovalue: ");
    refused({cube, "-o", out, "--dag", "-r", "4096", "--memory", "1M"}, 1, "--dag needs the whole tree in half of --memory: the tree takes more than the 524288 bytes");
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
