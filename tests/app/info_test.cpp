// The real program: what it prints and how it ends.
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "io/vdb/vdb_writer.h"
#include "tests/support/las_file.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::run_strata;

class InfoCommand : public ::testing::Test {
protected:
    std::string write(const std::string& name, const test::LasFile& file) {
        const std::vector<std::byte> bytes = file.bytes();
        const std::string path = folder_.file(name);
        std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        return path;
    }
    // Three points whose header lies: its box is a unit cube, it counts no returns.
    static test::LasFile scan() {
        test::LasFile file{.minor_version = 4, .point_format = 7, .scale = {0.01, 0.01, 0.01}, .offset = {100.0, 200.0, 0.0}, .max = {1.0, 1.0, 1.0}};
        file.vlrs = {{"LASF_Projection", 2112, test::bytes_of("LOCAL_CS[\"here\"]")}};
        for (int i = 0; i < 3; ++i)
            file.records.push_back(test::las_record(7, {.x = i, .y = -i, .z = 10 * i, .intensity = uint16_t(100 + i), .classification = 2, .rgb = {1, 2, 255}}));
        return file;
    }
    const TemporaryFolder folder_;
};

TEST_F(InfoCommand, JsonSaysWhatTheHeaderSays) {
    const ProgramResult result = run_strata({"info", "--json", write("scan.las", scan())});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    const json report = json::parse(result.out);
    EXPECT_EQ(report["format"], "las");
    EXPECT_EQ(report["detail"], "las 1.4, point format 7");
    EXPECT_EQ(report["points"], 3);
    EXPECT_EQ(report["bounds"], json::parse(R"({"min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 1.0]})"));
    EXPECT_EQ(report["scale"], json({0.01, 0.01, 0.01}));
    EXPECT_EQ(report["offset"], json({100.0, 200.0, 0.0}));
    EXPECT_EQ(report["crs"], "LOCAL_CS[\"here\"]");
    EXPECT_EQ(report["attributes"][0]["name"], "intensity");
    EXPECT_EQ(report["attributes"][0]["type"], "uint16");
    EXPECT_TRUE(report["attributes"][0]["min"].is_null());  // LAS headers do not say
    EXPECT_FALSE(report.contains("warnings"));
}

TEST_F(InfoCommand, QualityIsOfSetsOnly) {
    const ProgramResult result = run_strata({"info", "--quality", write("scan.las", scan())});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_TRUE(result.err.starts_with("strata: --quality: a level-of-detail data set is expected")) << result.err;
}

TEST_F(InfoCommand, NoPointsHaveNoBounds) {
    test::LasFile file = scan();
    file.records.clear();
    file.record_size = 36;
    const std::string path = write("empty.las", file), folder = folder_.file("empty");
    const ProgramResult converted = run_strata({"convert", path, folder, "--quiet"});
    ASSERT_EQ(converted.exit_code, 0) << converted.err;
    for (const std::string& name : {path, folder}) EXPECT_TRUE(json::parse(run_strata({"info", "--json", name}).out)["bounds"]["min"].is_null()) << name;
}

TEST_F(InfoCommand, ExactReadsEveryPointAndNamesTheLies) {
    const ProgramResult result = run_strata({"info", "--json", "--exact", write("scan.las", scan())});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json report = json::parse(result.out);
    EXPECT_EQ(report["bounds"]["min"], json({100.0, 199.98, 0.0}));
    EXPECT_EQ(report["bounds"]["max"], json({100.02, 200.0, 0.2}));
    EXPECT_EQ(report["header_bounds"]["max"], json({1.0, 1.0, 1.0}));
    EXPECT_EQ(report["attributes"][0]["min"], 100.0);
    EXPECT_EQ(report["attributes"][0]["max"], 102.0);
    EXPECT_EQ(report["rgb_bits"], 8);
    EXPECT_EQ(report["points_by_return"], json::parse(R"({"1": 3})"));
    EXPECT_EQ(report["points_by_class"], json::parse(R"({"2": 3})"));
    // Two ends of x and of y and the far end of z lie; so does the count of first returns.
    ASSERT_EQ(report["warnings"].size(), 6u) << report["warnings"];
    EXPECT_EQ(report["warnings"][5], "the header counts 0 points of return 1, there are 3");
}

TEST_F(InfoCommand, AnHonestHeaderHasNoWarnings) {
    test::LasFile file = scan();
    file.min = {100.0, 199.98, 0.0};
    file.max = {100.02, 200.0, 0.2};
    file.points_by_return = {3};
    const ProgramResult result = run_strata({"info", "--json", "--exact", write("scan.las", file)});
    EXPECT_FALSE(json::parse(result.out).contains("warnings")) << result.out;
}

// The header's box is one unit wide: of degrees, of feet, of what the system says.
TEST_F(InfoCommand, TheSystemHasItsNameAndItsUnits) {
    const auto with_keys = [](std::vector<int> words) {
        test::LasFile file = scan();
        std::vector<std::byte> keys;
        for (const int word : words) test::put(keys, uint16_t(word));
        file.vlrs = {{"LASF_Projection", 34735, keys}};
        return file;
    };
    const std::string feet = write("feet.las", with_keys({1, 1, 0, 3, 3072, 0, 1, 2225, 4096, 0, 1, 5703, 4099, 0, 1, 9001}));
    const json report = json::parse(run_strata({"info", "--json", feet}).out);
    EXPECT_EQ(report["crs"], "EPSG:2225+5703");
    EXPECT_EQ(report["crs_id"], "EPSG:2225+5703");
    EXPECT_EQ(report["crs_name"], "NAD83 / California zone 1 (ftUS) + NAVD88 height");
    EXPECT_EQ(report["unit"], "US survey foot");
    EXPECT_EQ(report["vertical_unit"], "metre");
    const std::string text = run_strata({"info", feet}).out;
    for (const char* const part : {"  crs           EPSG:2225+5703 NAD83 / California zone 1 (ftUS) + NAVD88 height, unit US survey foot, of heights metre\n",
                                   " 1.00 US survey foot long\n", " 1.00 m long\n"})
        EXPECT_NE(text.find(part), std::string::npos) << part << text;

    const json degrees = json::parse(run_strata({"info", "--json", write("degrees.las", with_keys({1, 1, 0, 1, 2048, 0, 1, 4326}))}).out);
    EXPECT_EQ(degrees["unit"], "degree");
    EXPECT_TRUE(degrees["vertical_unit"].is_null());
    EXPECT_FALSE(json::parse(run_strata({"info", "--json", write("none.las", with_keys({1, 1, 0, 0}))}).out).contains("unit"));
}

// PROJ's database may be missing: points can be read without it, and one line says so.
TEST_F(InfoCommand, WithoutProjsDatabaseACodeIsTakenUnseen) {
    test::LasFile file = scan();
    std::vector<std::byte> keys;
    for (const int word : {1, 1, 0, 1, 3072, 0, 1, 25832}) test::put(keys, uint16_t(word));
    file.vlrs = {{"LASF_Projection", 34735, keys}};
    const std::string path = write("scan.las", file);
    const ProgramResult result = test::run_program({"/usr/bin/env", "PROJ_DATA=/nowhere", STRATA_PROGRAM, "info", "--json", path});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    const json report = json::parse(result.out);
    EXPECT_EQ(report["crs"], "EPSG:25832");
    EXPECT_EQ(report["notes"], json({"EPSG:25832 of its GeoTIFF keys is taken unseen: PROJ's database, proj.db, is not found"}));
}

TEST_F(InfoCommand, TextNamesEveryPart) {
    const ProgramResult result = run_strata({"info", "--exact", write("scan.las", scan())});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    for (const char* const part : {"las 1.4, point format 7", "points        3\n", "crs           here\n", "8 of 16 bits", "intensity", "ground", "warnings"})
        EXPECT_NE(result.out.find(part), std::string::npos) << part << "\n" << result.out;
}

// Counts, bounds, and what vertices have, of each format; the triangle has a corner that is nowhere.
TEST_F(InfoCommand, MeshesHaveVerticesAndTriangles) {
    const std::pair<const char*, std::string> files[] = {
        {"obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 2 0 0 0 1\nv 5 5 nan\nvn 0 0 1\nf 1//1 2//1 3//1\nf 2 3 4\n"},
        {"stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 2 0\nendloop\nendfacet\nendsolid a\n"},
        {"ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 2 0\n3 0 1 2\n"}};
    for (const auto& [name, text] : files) {
        const std::string path = folder_.file(std::string("mesh.") + name);
        std::ofstream(path) << text;
        const ProgramResult result = run_strata({"info", "--json", path});
        ASSERT_EQ(result.exit_code, 0) << result.err;
        const json report = json::parse(result.out);
        EXPECT_EQ(report["format"], name);
        EXPECT_EQ(report["vertices"], 3);
        EXPECT_EQ(report["triangles"], 1);
        EXPECT_EQ(report["bounds"], json::parse(R"({"min": [0.0, 0.0, 0.0], "max": [1.0, 2.0, 0.0]})"));
        const std::string lines = run_strata({"info", path}).out;
        for (const char* const part : {"  vertices      3\n", "  triangles     1\n", "  bounds        x               0 ..               1              1 long\n"})
            EXPECT_NE(lines.find(part), std::string::npos) << part << lines;
        EXPECT_EQ(run_strata({"info", "--quality", path}).exit_code, 2);
        const ProgramResult capped = run_strata({"info", "--memory", "50", path});
        EXPECT_EQ(capped.exit_code, 1);
        EXPECT_NE(capped.err.find(": the mesh needs "), std::string::npos) << capped.err;
        const ProgramResult converted = run_strata({"convert", path, folder_.file("out.las")});
        EXPECT_EQ(converted.exit_code, 1);
        EXPECT_NE(converted.err.find("a file of points is expected here"), std::string::npos) << converted.err;
    }
    const json obj = json::parse(run_strata({"info", "--json", folder_.file("mesh.obj")}).out);
    ASSERT_EQ(obj["attributes"].size(), 2u);
    EXPECT_EQ(obj["attributes"][0]["name"], "normal");
    EXPECT_EQ(obj["attributes"][1]["name"], "color");
    EXPECT_EQ(obj["notes"], json({"1 vertices without a finite position are left out, and 1 triangles that use them"}));
    EXPECT_EQ(obj["faces"], 2);
}

// A tetrahedron with edges of 1, 2 and 3 along the axes, then without one of its faces.
TEST_F(InfoCommand, ExactMeasuresSurfacesOfMeshes) {
    const std::string path = folder_.file("mesh.obj"), text = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\n";
    std::ofstream(path) << text << "f 2 3 4\n";
    const json closed = json::parse(run_strata({"info", "--exact", "--json", path}).out);
    EXPECT_EQ(closed["components"], 1);
    EXPECT_EQ(closed["boundary_edges"], 0);
    EXPECT_EQ(closed["euler_characteristic"], 2);
    EXPECT_DOUBLE_EQ(closed["volume"], 1.0);
    EXPECT_DOUBLE_EQ(closed["area"], 0.5 * (2 + 3 + 6 + 7));  // the last is |(-1, 2, 0) x (-1, 0, 3)| = |(6, 3, 2)|
    EXPECT_NE(run_strata({"info", "--exact", path}).out.find("1 component, Euler characteristic 2\n                closed\n"), std::string::npos);
    std::ofstream(path) << text;
    const json open = json::parse(run_strata({"info", "--exact", "--json", path}).out);
    EXPECT_EQ(open["boundary_edges"], 3);
    EXPECT_TRUE(open["volume"].is_null());
    // 40 x 40 vertices and 3118 triangles: 76 kB to be read, as the header counts both, and 40 bytes a vertex beside that to be measured.
    std::ofstream grid(path);
    grid << "ply\nformat ascii 1.0\nelement vertex 1600\nproperty float x\nproperty float y\nproperty float z\nelement face 3118\nproperty list uchar int vertex_indices\nend_header\n";
    for (int i = 0; i < 1600; ++i) grid << i % 40 << ' ' << i / 40 << " 0\n";
    for (int i = 0; i < 1559; ++i) grid << "3 " << i << ' ' << i + 1 << ' ' << i + 41 << "\n3 " << i << ' ' << i + 41 << ' ' << i + 40 << '\n';
    grid.close();
    EXPECT_EQ(run_strata({"info", "--memory", "120000", path}).exit_code, 0);
    const ProgramResult capped = run_strata({"info", "--exact", "--memory", "120000", path});
    EXPECT_EQ(capped.exit_code, 1);
    EXPECT_NE(capped.err.find("to be measured"), std::string::npos) << capped.err;
}

// An L of 5 and a pentagon with a notch that leaves 3.8, from corners that see less than all of them.
TEST_F(InfoCommand, ConcaveFacesHaveTheirArea) {
    const std::string obj = folder_.file("concave.obj"), ply = folder_.file("concave.ply");
    const std::array<const char*, 11> vertices = {"3 0 0", "3 1 0", "1 1 0", "1 3 0", "0 3 0", "0 0 0", "10 0 0", "12 0 0", "12 3 0", "11 0.8 0", "10 3 0"};
    std::ofstream as_obj(obj), as_ply(ply);
    as_ply << "ply\nformat ascii 1.0\nelement vertex 11\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n";
    for (const char* const vertex : vertices) {
        as_obj << "v " << vertex << '\n';
        as_ply << vertex << '\n';
    }
    as_obj << "f 1 2 3 4 5 6\nf 7 8 9 10 11\n";
    as_ply << "6 0 1 2 3 4 5\n5 6 7 8 9 10\n";
    as_obj.close(), as_ply.close();
    for (const std::string& path : {obj, ply}) {
        const json said = json::parse(run_strata({"info", "--exact", "--json", path}).out);
        EXPECT_NEAR(said["area"].get<double>(), 5.0 + 6.0 - 2.2, 1e-6);  // the notch is 2 wide and 2.2 deep
        EXPECT_EQ(said["triangles"], 7);
        EXPECT_EQ(said["faces"], 2);
    }
}

TEST_F(InfoCommand, GridsOfVdbFilesAreListed) {
    if (!has_openvdb()) GTEST_SKIP() << "this build has no OpenVDB to write a file with";
    const std::string path = folder_.file("a.vdb");
    VdbWriter writer(path, false, {.origin = {10, 20, 30}, .voxel_size = 0.5, .levels = 2}, {.half = true});
    VoxelBatch batch;
    batch.blocks = {{0, 1, 0}, {3, 1, 0}};  // voxels (0, 0, 0) and (0, 4, 4)
    writer.add(batch);
    writer.commit();
    const json report = json::parse(run_strata({"info", "--json", path}).out);
    EXPECT_EQ(report["format"], "vdb");
    EXPECT_EQ(report["bounds"], json::parse(R"({"min": [10.25, 20.25, 30.25], "max": [10.25, 22.25, 32.25]})"));
    ASSERT_EQ(report["grids"].size(), 1u);
    const json& grid = report["grids"][0];
    EXPECT_EQ(grid["name"], "occupancy");
    EXPECT_EQ(grid["type"], "float");
    EXPECT_EQ(grid["half"], true);
    EXPECT_EQ(grid["class"], "fog volume");
    EXPECT_EQ(grid["background"], 0.0);
    EXPECT_EQ(grid["active_voxels"], 2);
    EXPECT_EQ(grid["voxel_size"], json({0.5, 0.5, 0.5}));
    EXPECT_EQ(grid["index_max"], json({0, 4, 4}));
    const std::string text = run_strata({"info", path}).out;
    for (const char* const part : {"  format        OpenVDB 10.0, file version 224\n", "  grids         occupancy: float (16 bits), fog volume, 2 active voxels, background 0\n",
                                   "    voxels of 0.5 0.5 0.5, UniformScaleTranslateMap\n"})
        EXPECT_NE(text.find(part), std::string::npos) << part << text;
}

// Names are data: they can neither break the JSON nor steer a terminal.
TEST_F(InfoCommand, HostileNamesAreEscaped) {
    test::LasFile file = scan();
    file.vlrs = {{"LASF_Projection", 2112, test::bytes_of("a\"b\x1b[2J\xff\nc")}, {"LASF_Spec", 4, test::extra_bytes_entry("\x1b]0;x\x07\"\xc3", 1)}};
    for (std::vector<std::byte>& record : file.records) record.push_back(std::byte{1});
    const std::string path = write("scan.las", file);
    const ProgramResult as_json = run_strata({"info", "--json", path});
    ASSERT_EQ(as_json.exit_code, 0) << as_json.err;
    EXPECT_TRUE(json::accept(as_json.out)) << as_json.out;
    const ProgramResult as_text = run_strata({"info", path});
    ASSERT_EQ(as_text.exit_code, 0) << as_text.err;
    EXPECT_EQ(as_text.out.find('\x1b'), std::string::npos);
}

TEST_F(InfoCommand, WhatCannotBeReadIsOneLineAndExitCode1) {
    test::LasFile compressed = scan();
    compressed.point_format |= 0x80;  // the mark of LASzip
    std::ofstream(folder_.file("text.xyz")) << "1 2 3\n";
    const std::pair<std::string, const char*> cases[] = {{write("scan.laz", compressed), "record 'laszip encoded' is missing"},
                                                         {folder_.file("text.xyz"), "not a format that strata knows"},
                                                         {folder_.file("none"), "No such file"},
                                                         {folder_.path(), "a folder without data"}};
    for (const auto& [path, part] : cases) {
        const ProgramResult result = run_strata({"info", path});
        EXPECT_EQ(result.exit_code, 1) << path;
        EXPECT_EQ(result.out, "");
        EXPECT_EQ(result.err.rfind("strata: " + path + ": ", 0), 0u) << result.err;
        EXPECT_NE(result.err.find(part), std::string::npos) << result.err;
        EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    }
}

TEST_F(InfoCommand, AWrongCommandLineIsExitCode2) {
    EXPECT_EQ(run_strata({"info"}).exit_code, 2);
    EXPECT_EQ(run_strata({"info", "a", "b"}).exit_code, 2);
    EXPECT_EQ(run_strata({"info", "--no-such-flag", "a"}).exit_code, 2);
}

}  // namespace
}  // namespace strata
