// strata surface, by the real program.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "core/math/random.h"
#include "io/mesh/mesh_reader.h"
#include "io/vdb/vdb_writer.h"
#include "tests/support/las_file.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

using nlohmann::json;
using std::numbers::pi;
using test::ProgramResult;
using test::run_strata;

void write_bytes(const std::string& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

std::string as_bytes(const std::vector<float>& values) {
    std::string bytes(values.size() * sizeof(float), '\0');
    std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
}

constexpr int kSide = 40;

/// A NRRD file of kSide^3 floats, half a unit apart from (-10, -10, -10) on.
std::string volume_of(const std::function<double(const Vec3d&)>& value) {
    std::vector<float> values;
    for (int k = 0; k < kSide; ++k)
        for (int j = 0; j < kSide; ++j)
            for (int i = 0; i < kSide; ++i) values.push_back(float(value(Vec3d(i, j, k) * 0.5 - Vec3d::Constant(10.0))));
    return "NRRD0004\ntype: float\ndimension: 3\nsizes: 40 40 40\nspacings: 0.5 0.5 0.5\naxis mins: -10 -10 -10\ncenterings: node node node\nencoding: raw\nendian: little\n\n" + as_bytes(values);
}
double to_sphere(const Vec3d& p) { return 7.25 - p.norm(); }  // above 0 inside

class Surface : public testing::Test {
protected:
    json surface(std::vector<std::string> words) {
        words.insert(words.begin(), "surface");
        words.push_back("--json");
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(result.exit_code, 0) << result.err;
        EXPECT_TRUE(result.err.empty()) << result.err;
        return result.exit_code == 0 ? json::parse(result.out) : json();
    }
    static json info(const std::string& path) {
        const ProgramResult result = run_strata({"info", "--exact", "--json", path});
        EXPECT_EQ(result.exit_code, 0) << result.err;
        return result.exit_code == 0 ? json::parse(result.out) : json();
    }
    std::string file(const std::string& name) const { return folder_.file(name); }
    std::string sphere() const {
        write_bytes(file("sphere.nrrd"), volume_of(to_sphere));
        return file("sphere.nrrd");
    }
    const TemporaryFolder folder_;
};

// Noise, whose mesh is more than ten times as large as its samples: what is made of it does not depend on the memory, which it keeps to.
TEST_F(Surface, KeepsToItsMemory) {
    Random random(3);
    std::vector<float> values(size_t{120} * 120 * 60);
    for (float& value : values) value = float(random.uniform(-1.0, 1.0));
    write_bytes(file("noise.raw"), as_bytes(values));
    const std::vector<std::string> words = {file("noise.raw"), "--dimensions", "120x120x60", "--type", "float", "--iso", "0", "--overwrite", "-o", file("out.ply")};
    const auto with_memory = [&](const std::string& memory) {
        std::vector<std::string> all = words;
        all.insert(all.end(), {"--memory", memory});
        return all;
    };
    json whole = surface(with_memory("1G"));
    const std::string mesh = test::file_contents(file("out.ply"));
    EXPECT_GT(whole["vertices"].get<uint64_t>(), 1'000'000u);
    json report = surface(with_memory("8M"));
    const double peak = report["peak_memory_bytes"];
    EXPECT_TRUE(test::file_contents(file("out.ply")) == mesh);
    for (const char* const key : {"seconds", "peak_memory_bytes"}) whole.erase(key), report.erase(key);
    EXPECT_EQ(report, whole);
    if (!test::built_with_sanitizer()) EXPECT_LT(peak, (8 << 20) + 70e6);  // the program itself, and its buffers
    // What is too little is told in the words that were typed.
    for (const char* const method : {"marching-cubes", "cubes"}) {
        std::vector<std::string> little = with_memory("1K");
        little.insert(little.begin(), {"surface", "--method", method});
        const ProgramResult refused = run_strata(little);
        EXPECT_EQ(refused.exit_code, 1);
        EXPECT_NE(refused.err.find("1024 are allowed"), std::string::npos) << refused.err;
    }
    // Slices of an attribute fit into their quarter; two of the field's and what is made of them do not into the half less that.
    std::filesystem::copy_file(sphere(), file("other.nrrd"));
    const std::string given = std::to_string(8 * kSide * kSide * sizeof(float));
    const ProgramResult refused = run_strata({"surface", file("sphere.nrrd"), "--iso", "0", "--attributes", file("other.nrrd"), "--memory", given, "-o", file("never.ply")});
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_NE(refused.err.find("slices of the field"), std::string::npos) << refused.err;
    EXPECT_NE(refused.err.find(" " + given + " are allowed"), std::string::npos) << refused.err;
}

// A closed surface within h^2 / 8R of the sphere on the edges, whatever file it goes to; what is said of it is what is in the file.
TEST_F(Surface, ASphereInEveryFormat) {
    const std::string in = sphere();
    for (const char* const ending : {"ply", "obj", "stl", "glb"}) {
        const std::string out = file(std::string("out.") + ending);
        const json report = surface({in, "-o", out, "--iso", "0", "--normals"});
        EXPECT_EQ(report["components"], 1);
        EXPECT_EQ(report["boundary_edges"], 0);
        EXPECT_EQ(report["nonmanifold_edges"], 0);
        EXPECT_EQ(report["euler_characteristic"], 2);
        EXPECT_NEAR(report["volume"].get<double>() / (4 * pi / 3 * std::pow(7.25, 3)), 1.0, 0.005);
        EXPECT_NEAR(report["area"].get<double>() / (4 * pi * 7.25 * 7.25), 1.0, 0.005);
        EXPECT_EQ(report["output_bytes"], std::filesystem::file_size(out));
        EXPECT_NEAR(report["bounds"]["max"][0].get<double>(), 7.25, 0.01);
        for (const char* const key : {"seconds", "peak_memory_bytes", "quads", "method"}) EXPECT_TRUE(report.contains(key)) << key;
        if (std::string(ending) == "glb") continue;  // read by another library in the tests of its writer
        const json said = info(out);
        EXPECT_EQ(said["triangles"], report["triangles"]);
        EXPECT_EQ(said["vertices"], report["vertices"]);
        EXPECT_EQ(said["euler_characteristic"], 2);
        EXPECT_NEAR(said["volume"].get<double>(), report["volume"].get<double>(), 1e-3);
        const TriangleMesh mesh = read_mesh(out);
        for (const Vec3d& p : mesh.positions) EXPECT_NEAR(p.norm(), 7.25, 0.25 / (8 * 7.25) + 0.5 / 1024);
        for (size_t i = 0; i < mesh.normals.size(); ++i) EXPECT_GT(mesh.normals[i].cast<double>().dot(mesh.positions[i].normalized()), 0.99);
        EXPECT_EQ(mesh.normals.empty(), std::string(ending) == "stl");
    }
}

// Neither threads nor memory show in the bytes.
TEST_F(Surface, TheSameBytesWhateverThreadsAndMemory) {
    const std::string in = sphere();
    surface({in, "-o", file("a.ply"), "--iso", "0,1", "--threads", "1"});
    surface({in, "-o", file("b.ply"), "--iso", "0,1", "--threads", "3", "--memory", "40M"});
    EXPECT_EQ(test::file_contents(file("a.ply")), test::file_contents(file("b.ply")));
}

TEST_F(Surface, IsovaluesHaveColorsOfTheirOwn) {
    const json report = surface({sphere(), "-o", file("out.ply"), "--iso", "0,2"});
    EXPECT_EQ(report["components"], 2);
    EXPECT_EQ(report["isovalues"], json({0.0, 2.0}));
    const TriangleMesh mesh = read_mesh(file("out.ply"));
    ASSERT_EQ(mesh.colors.size(), mesh.positions.size());
    const auto color_of = [&](size_t i) { return mesh.positions[i].norm() > 6.25 ? 0 : 1; };
    std::array<std::array<uint8_t, 4>, 2> colors{};
    for (size_t i = 0; i < mesh.colors.size(); ++i) colors[size_t(color_of(i))] = mesh.colors[i];
    EXPECT_NE(colors[0], colors[1]);
    for (size_t i = 0; i < mesh.colors.size(); ++i) EXPECT_EQ(mesh.colors[i], colors[size_t(color_of(i))]);
}

// A half space whose border is the plane z = 1.25: open, or closed around the part of the grid below it.
TEST_F(Surface, ClosesAtTheBoundary) {
    write_bytes(file("plane.nrrd"), volume_of([](const Vec3d& p) { return 1.25 - p.z(); }));
    const json open = surface({file("plane.nrrd"), "-o", file("open.ply"), "--iso", "0"});
    EXPECT_EQ(open["euler_characteristic"], 1);
    EXPECT_GT(open["boundary_edges"], 100);
    EXPECT_TRUE(open["volume"].is_null());
    EXPECT_TRUE(open["meets_boundary"]);
    EXPECT_NEAR(open["area"].get<double>(), 19.5 * 19.5, 1e-3);
    const json closed = surface({file("plane.nrrd"), "-o", file("closed.ply"), "--iso", "0", "--close"});
    EXPECT_EQ(closed["boundary_edges"], 0);
    EXPECT_EQ(closed["euler_characteristic"], 2);
    // As much as the box below the plane, but for what closing adds, less than a cell around.
    EXPECT_GT(closed["volume"].get<double>(), 19.5 * 19.5 * 11.25);
    EXPECT_LT(closed["volume"].get<double>(), 20.5 * 20.5 * 11.75);
    const json below = surface({file("plane.nrrd"), "-o", file("below.ply"), "--iso", "0", "--inside", "below", "--close"});
    EXPECT_LT(below["volume"].get<double>(), 20.5 * 20.5 * 8.75);
}

// Nothing at that isovalue: an empty mesh, said so; also of a field without a value.
TEST_F(Surface, AnEmptySurfaceIsNoFailure) {
    const std::string in = sphere();
    const ProgramResult result = run_strata({"surface", in, "-o", file("none.ply"), "--iso", "500"});
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_NE(result.err.find("note: no surface at isovalue 500: values are from -10."), std::string::npos) << result.err;
    EXPECT_NE(result.err.find(" to 7.25, and the mesh is empty"), std::string::npos) << result.err;
    const json none = info(file("none.ply"));
    EXPECT_EQ(none["triangles"], 0);
    EXPECT_TRUE(none["volume"].is_null()) << "it encloses nothing";
    // A single slice has no cells.
    write_bytes(file("slice.nrrd"), "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 1\nencoding: raw\n\nabcd");
    const std::string said = surface({file("slice.nrrd"), "-o", file("slice.ply"), "--iso", "98"})["notes"].dump();
    EXPECT_NE(said.find("there are no cells between samples"), std::string::npos) << said;
    EXPECT_GT(surface({file("slice.nrrd"), "-o", file("closed.ply"), "--iso", "98", "--close"})["triangles"], 0);
    // Of several isovalues those without a surface are named.
    EXPECT_EQ(surface({in, "-o", file("one.ply"), "--iso", "0,500,-600"})["notes"][0].get<std::string>().find("no surface at isovalue 500, -600: values are from -10."), 0);
    write_bytes(file("nan.nrrd"), volume_of([](const Vec3d&) { return std::nan(""); }));
    for (const char* const ending : {"ply", "obj", "stl", "glb"}) {
        const json report = surface({file("nan.nrrd"), "-o", file(std::string("nan.") + ending), "--iso", "0"});
        EXPECT_EQ(report["triangles"], 0);
        EXPECT_EQ(report["nan_samples"], kSide * kSide * kSide);
        EXPECT_TRUE(report["range"]["min"].is_null());
        EXPECT_NE(report["notes"].dump().find("no sample has a value"), std::string::npos);
    }
}

// Samples of 16 bits with the high byte first, behind a header of 10 bytes.
TEST_F(Surface, SamplesAloneNeedDimensionsAndType) {
    std::string bytes = "ten bytes.";
    for (int k = 0; k < 20; ++k)
        for (int j = 0; j < 30; ++j)
            for (int i = 0; i < 24; ++i) {
                const int value = int(1000 * (9 - Vec3d((i - 11.5) * 0.5, j - 14.5, (k - 9.5) * 1.0).norm()));
                bytes += {char(value >> 8), char(value)};
            }
    write_bytes(file("x.raw"), bytes);
    const json report = surface({file("x.raw"), "-o", file("out.ply"), "--iso", "4000", "--dimensions", "24x30x20", "--type", "int16", "--endian", "big", "--spacing", "0.5,1,1"});
    EXPECT_EQ(report["euler_characteristic"], 2);
    EXPECT_NEAR(report["volume"].get<double>() / (4 * pi / 3 * 125), 1.0, 0.05);
    const json behind = surface({file("x.raw"), "-o", file("b.ply"), "--iso", "4000", "--dimensions", "24x30x20", "--type", "int16", "--endian", "big", "--spacing", "0.5,1,1", "--header-bytes", "10"});
    EXPECT_EQ(test::file_contents(file("out.ply")), test::file_contents(file("b.ply")));
    const ProgramResult large = run_strata({"surface", file("x.raw"), "-o", file("c.ply"), "--iso", "0", "--dimensions", "24x30x21", "--type", "int16"});
    EXPECT_EQ(test::refusal_verdict(large), "");
    EXPECT_NE(large.err.find("24 x 30 x 21 samples of int16 are 30240 bytes; the file has 28810"), std::string::npos) << large.err;
}

// Isovalue 0 and the inside below need not be said of a level set, which may reach over negative indices.
TEST_F(Surface, ALevelSetOfATorus) {
    if (!has_openvdb()) GTEST_SKIP() << "this build has no OpenVDB to write a file with";
    MeshLevelSet(torus_mesh({1, 2, 3}, 4.0, 1.5, 200), {.voxel_size = 0.1}).write(file("torus.vdb"), false);
    const json report = surface({file("torus.vdb"), "-o", file("out.ply")});
    EXPECT_EQ(report["inside"], "below");
    EXPECT_EQ(report["components"], 1);
    EXPECT_EQ(report["boundary_edges"], 0);
    EXPECT_EQ(report["euler_characteristic"], 0);
    EXPECT_NEAR(report["volume"].get<double>() / (2 * pi * pi * 4.0 * 1.5 * 1.5), 1.0, 0.005);
    EXPECT_NEAR(report["area"].get<double>() / (4 * pi * pi * 4.0 * 1.5), 1.0, 0.01);
    const ProgramResult beyond = run_strata({"surface", file("torus.vdb"), "-o", file("b.ply"), "--iso", "7"});
    EXPECT_EQ(beyond.exit_code, 2);
    EXPECT_NE(beyond.err.find("which the isovalue 7 takes for inside"), std::string::npos) << beyond.err;
    const json cubes = surface({file("torus.vdb"), "-o", file("cubes.ply"), "--method", "cubes"});
    EXPECT_NEAR(cubes["volume"].get<double>() / (2 * pi * pi * 4.0 * 1.5 * 1.5), 1.0, 0.02);
    EXPECT_NEAR(cubes["solid_voxels"].get<double>() * 0.001, cubes["volume"].get<double>(), 1e-3);
}

// The solid sphere of integers whose faces are known from the literature.
class CubesOfASphere : public Surface {
protected:
    void SetUp() override {
        test::LasFile file{.point_format = 0, .scale = {0.5, 0.5, 0.5}, .max = {16, 16, 16}};
        for (int i = -16; i < 16; ++i)
            for (int j = -16; j < 16; ++j)
                for (int k = -16; k < 16; ++k)
                    if (i * i + j * j + k * k <= 256) file.records.push_back(test::las_record(0, {.x = 2 * i + 1, .y = 2 * j + 1, .z = 2 * k + 1}));
        file.min = {-16, -16, -16};
        const std::vector<std::byte> bytes = file.bytes();
        std::ofstream(points_, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    }
    static void expect_known(const json& report) {
        EXPECT_EQ(report["method"], "cubes");
        EXPECT_EQ(report["solid_voxels"], 17'074);
        EXPECT_EQ(report["faces_uncut"], 102'444);
        EXPECT_EQ(report["faces_culled"], 4'770);
        EXPECT_LE(report["rectangles"], 2'100);
        EXPECT_DOUBLE_EQ(report["volume"].get<double>(), 17'074.0);
        EXPECT_DOUBLE_EQ(report["area"].get<double>(), 4'770.0);
        EXPECT_EQ(report["boundary_edges"], 0);
        EXPECT_EQ(report["components"], 1);
    }
    const std::string points_ = file("points.las");
};

TEST_F(CubesOfASphere, HasTheKnownFaces) {
    expect_known(surface({points_, "-o", file("a.ply"), "--method", "cubes", "--voxel-size", "1"}));
    ASSERT_EQ(run_strata({"voxelize", points_, "-o", file("a.svo"), "--voxel-size", "1", "--quiet"}).exit_code, 0);
    expect_known(surface({file("a.svo"), "-o", file("b.ply")}));
    EXPECT_EQ(test::file_contents(file("a.ply")), test::file_contents(file("b.ply")));
    const json said = info(file("b.ply"));
    EXPECT_DOUBLE_EQ(said["volume"].get<double>(), 17'074.0);
}

// Cells of 2, 4, 8 voxels: each that has a voxel.
TEST_F(CubesOfASphere, OfCoarserCellsBySizeAndByError) {
    ASSERT_EQ(run_strata({"voxelize", points_, "-o", file("a.svo"), "--voxel-size", "1", "--quiet"}).exit_code, 0);
    const int origin = info(file("a.svo"))["origin"][0];  // as of y and z
    for (const int side : {2, 4, 8}) {
        std::set<std::array<int, 3>> occupied;
        for (int i = -16; i < 16; ++i)
            for (int j = -16; j < 16; ++j)
                for (int k = -16; k < 16; ++k)
                    if (i * i + j * j + k * k <= 256) occupied.insert({(i - origin) / side, (j - origin) / side, (k - origin) / side});
        const size_t cells = occupied.size();
        const json report = surface({file("a.svo"), "-o", file("c.ply"), "--overwrite", "--voxel-size", std::to_string(side + 0.5)});
        EXPECT_EQ(report["cell_size"], side);
        EXPECT_EQ(report["solid_voxels"], cells);
        EXPECT_DOUBLE_EQ(report["volume"].get<double>(), double(cells) * side * side * side);
    }
    EXPECT_EQ(surface({file("a.svo"), "-o", file("c.ply"), "--overwrite", "--error", "2"})["cell_size"], 2);    // sqrt(3)
    EXPECT_EQ(surface({file("a.svo"), "-o", file("c.ply"), "--overwrite", "--error", "1.7"})["cell_size"], 1);

    // A parallel view of 100 units: of as many pixels a pixel is a voxel, of twice as many it is half of one.
    write_bytes(file("camera.json"), R"({"eye": [100, 0, 0], "target": [0, 0, 0], "ortho_height": 100})");
    const auto cell_in_picture = [&](const char* error, const char* size) {
        return surface({file("a.svo"), "-o", file("c.ply"), "--overwrite", "--error", error, "--camera", file("camera.json"), "--size", size})["cell_size"];
    };
    EXPECT_EQ(cell_in_picture("2px", "100x100"), 2);
    EXPECT_EQ(cell_in_picture("2px", "200x200"), 1);
    EXPECT_EQ(cell_in_picture("4px", "200x200"), 2);
    // What render shows without a camera: the ball, 33 units wide, about as high as the picture.
    EXPECT_EQ(surface({file("a.svo"), "-o", file("c.ply"), "--overwrite", "--error", "30px"})["cell_size"], 1);
    EXPECT_EQ(surface({file("a.svo"), "-o", file("c.ply"), "--overwrite", "--error", "30px", "--size", "480x270"})["cell_size"], 2);
}

// The share of cells that is occupied crosses 1/2 near the sphere that the voxels fill: of cells of 4 voxels within a cell or so, and it is smooth.
TEST_F(CubesOfASphere, MarchingCubesOfCoverage) {
    ASSERT_EQ(run_strata({"voxelize", points_, "-o", file("a.svo"), "--voxel-size", "1", "--quiet"}).exit_code, 0);
    for (const int side : {1, 2, 4}) {
        const json report = surface({file("a.svo"), "-o", file("c.ply"), "--overwrite", "--method", "marching-cubes", "--voxel-size", std::to_string(side)});
        EXPECT_EQ(report["method"], "marching-cubes");
        EXPECT_EQ(report["isovalues"], json({0.5}));
        EXPECT_EQ(report["boundary_edges"], 0);
        EXPECT_EQ(report["nonmanifold_edges"], 0);
        EXPECT_EQ(report["euler_characteristic"], 2);
        EXPECT_NEAR(report["volume"].get<double>() / 17'074.0, 1.0, 0.06);
    }
    const json points = surface({points_, "-o", file("d.ply"), "--method", "marching-cubes", "--voxel-size", "1"});
    EXPECT_EQ(points["euler_characteristic"], 2);
}

// Faces of different colors do not merge: two bars of two voxels have four sides each, and the row two ends.
TEST_F(Surface, CubesKeepTheColorsOfPoints) {
    test::LasFile points{.point_format = 2, .scale = {0.5, 0.5, 0.5}, .max = {4, 1, 1}};
    for (int i = 0; i < 4; ++i) points.records.push_back(test::las_record(2, {.x = 2 * i + 1, .y = 1, .z = 1, .rgb = {uint16_t(i < 2 ? 65535 : 0), 0, uint16_t(i < 2 ? 0 : 65535)}}));
    const std::vector<std::byte> bytes = points.bytes();
    std::ofstream(file("row.las"), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    const json report = surface({file("row.las"), "-o", file("row.ply"), "--method", "cubes", "--voxel-size", "1"});
    EXPECT_EQ(report["rectangles"], 2 * 4 + 2);
    EXPECT_DOUBLE_EQ(report["volume"].get<double>(), 4.0);
    const TriangleMesh mesh = read_mesh(file("row.ply"));
    for (size_t i = 0; i < mesh.colors.size(); ++i)
        if (mesh.positions[i].x() != 2.0) EXPECT_EQ(mesh.colors[i], (mesh.positions[i].x() < 2.0 ? std::array<uint8_t, 4>{255, 0, 0, 255} : std::array<uint8_t, 4>{0, 0, 255, 255}));
}

// A wrong command line ends with 2 and says what is expected; a volume without an isovalue says its range.
TEST_F(Surface, AWrongCommandLineIsExitCode2) {
    const std::string in = sphere(), out = file("out.ply");
    write_bytes(file("cube.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const std::pair<std::vector<std::string>, const char*> rows[] = {
        {{in, "-o", out}, "--iso V is expected; the values of "},
        {{in, "-o", out}, " are from -10.0"},
        {{in, "--iso", "0"}, "--output OUT is expected"},
        {{in, "-o", file("out.dae"), "--iso", "0"}, ".ply, .obj, .stl or .glb"},
        {{in, "-o", out, "--iso", "1,"}, "--iso"},
        {{in, "-o", out, "--iso", "x"}, "--iso"},
        {{in, "-o", out, "--iso", "nan"}, "--iso"},
        {{in, "-o", out, "--iso", "1,2,1"}, "--iso: 1 is there twice"},
        {{in, "-o", out, "--iso", "0", "--error", "-1px"}, "--error: expected a number of voxels or, with px, of pixels"},
        {{in, "-o", out, "--iso", "0", "--error", "px"}, "--error: expected a number"},
        {{in, "-o", out, "--iso", "0", "--error", "1", "--size", "10x10"}, "--size is for --error in pixels, such as --error 1px"},
        {{in, "-o", out, "--iso", "0", "--camera", "x.json"}, "--camera is for --error in pixels"},
        {{in, "-o", out, "--iso", "0", "--method", "dual"}, "--method: expected marching-cubes, cubes, smooth or balls"},
        {{in, "-o", out, "--iso", "0", "--inside", "left"}, "--inside: expected above or below"},
        {{in, "-o", out, "--iso", "0", "--method", "cubes", "--close"}, "--close is for --method marching-cubes"},
        {{in, "-o", out, "--iso", "0", "--voxel-size", "1"}, "--voxel-size is for voxels"},
        {{in, "-o", out, "--iso", "0", "--grid", "a"}, "is no .vdb file"},
        {{in, "-o", out, "--iso", "0", "--type", "int8"}, "--dimensions XxYxZ is expected"},
        {{in, "-o", out, "--iso", "0", "--dimensions", "4x4"}, "--dimensions: expected three numbers"},
        {{in, "-o", out, "--iso", "0", "--dimensions", "4x4x0"}, "--dimensions: expected three numbers"},
        {{in, "-o", out, "--iso", "0", "--dimensions", "4x4x4", "--type", "rgb"}, "--type: expected int8"},
        {{in, "-o", out, "--iso", "0", "--dimensions", "4x4x4", "--endian", "middle"}, "--endian: expected little or big"},
        {{in, "-o", out, "--iso", "0", "--dimensions", "4x4x4", "--spacing", "1,0,1"}, "--spacing: expected three numbers above 0"},
        {{file("cube.obj"), "-o", out, "--iso", "0"}, "--method cubes or marching-cubes with --voxel-size"},
        {{file("cube.obj"), "-o", out, "--method", "marching-cubes", "--voxel-size", "1", "--iso", "0"}, "a share above 0"},
        {{file("cube.obj"), "-o", out, "--method", "marching-cubes", "--voxel-size", "1", "--inside", "below"}, "nothing is outside"},
        {{file("cube.obj"), "-o", out, "--method", "cubes"}, "--voxel-size S is expected"},
        {{file("cube.obj"), "-o", out, "--method", "cubes", "--voxel-size", "0"}, "--voxel-size: expected a positive number"},
        {{file("cube.obj"), "-o", out, "--method", "cubes", "--voxel-size", "1", "--iso", "0"}, "--iso is for --method marching-cubes"},
        {{in, "-o", out, "--iso", "0", "--attributes", ""}, "--attributes: expected names"},
        {{in, "-o", out, "--iso", "0", "--attributes", "a,,b"}, "--attributes: expected names"},
        {{in, "-o", out, "--iso", "0", "--attributes", "a,b,a"}, "--attributes: 'a' is there twice"},
        {{in, "-o", out, "--iso", "0", "--attributes", "a,b,c,d,e,f,g,h,i,j,k,l,m,n,o,p,q"}, "--attributes: expected at most 16 names, got 17"},
        {{file("cube.obj"), "-o", out, "--method", "cubes", "--voxel-size", "1", "--attributes", "a"}, "cube.obj is a mesh"},
        {{in, in, "-o", out, "--iso", "0"}, "one volume, grid, mesh or voxel file at a time"},
    };
    for (const auto& [words, said] : rows) {
        std::vector<std::string> all = {"surface"};
        all.insert(all.end(), words.begin(), words.end());
        const ProgramResult result = run_strata(all);
        EXPECT_EQ(result.exit_code, 2) << said << "\n" << result.err;
        EXPECT_NE(result.err.find(said), std::string::npos) << said << "\n" << result.err;
        EXPECT_FALSE(std::filesystem::exists(out));
    }
}

// Damage ends with 1 and one line, and leaves nothing, or what was there.
TEST_F(Surface, WhatFailsLeavesNothingHalfWritten) {
    const std::string whole = volume_of(to_sphere), out = file("out.ply");
    const auto expect_refusal = [&](std::vector<std::string> words, const std::string& said) {
        words.insert(words.begin(), {"surface"});
        const ProgramResult result = run_strata(words);
        EXPECT_EQ(test::refusal_verdict(result), "");
        EXPECT_NE(result.err.find(said), std::string::npos) << said << "\n" << result.err;
    };
    write_bytes(file("short.nrrd"), whole.substr(0, whole.size() - 1));
    expect_refusal({file("short.nrrd"), "-o", out, "--iso", "0"}, "short.nrrd: byte ");
    write_bytes(file("unknown.bin"), "values");
    expect_refusal({file("unknown.bin"), "-o", out, "--iso", "0"}, "not a format that strata knows; this version reads las, laz, ");
    expect_refusal({file("unknown.bin"), "-o", out, "--iso", "0"}, "if it is samples alone, --dimensions XxYxZ says how they lie");
    std::filesystem::remove(file("unknown.bin"));
    const std::string spacing_line = "spacings: 0.5 0.5 0.5";
    for (const char* const spacing : {"0.5 0 0.5", "0.5 0.5 -0.5"}) {
        std::string lying = whole;
        lying.replace(lying.find(spacing_line), spacing_line.size(), std::string("spacings: ") + spacing);
        write_bytes(file("lying.nrrd"), lying);
        expect_refusal({file("lying.nrrd"), "-o", out, "--iso", "0"}, "lying.nrrd: line 6: spacings above 0 are expected");
    }
    write_bytes(file("large.nrrd"), "NRRD0004\ntype: float\ndimension: 3\nsizes: 4000000000 4000000000 4000000000\nencoding: raw\nendian: little\n\n");
    expect_refusal({file("large.nrrd"), "-o", out, "--iso", "0"}, "large.nrrd: line 4: ");
    EXPECT_EQ(test::entries(folder_.path()), 3u) << "nothing but the inputs";

    write_bytes(file("sphere.nrrd"), whole);
    expect_refusal({file("sphere.nrrd"), "-o", file("no/out.ply"), "--iso", "0"}, "no/out.ply");
    std::filesystem::create_directory(file("folder.ply"));
    expect_refusal({file("sphere.nrrd"), "-o", file("folder.ply"), "--iso", "0", "--overwrite"}, "folder.ply");
    write_bytes(out, "earlier");
    expect_refusal({file("sphere.nrrd"), "-o", out, "--iso", "0"}, "--overwrite replaces it");
    expect_refusal({file("short.nrrd"), "-o", out, "--iso", "0", "--overwrite"}, "short.nrrd");
    EXPECT_EQ(test::file_contents(out), "earlier");
    EXPECT_EQ(test::entries(folder_.path()), 6u);
    std::filesystem::copy(file("sphere.nrrd"), file("in.ply"));
    expect_refusal({file("in.ply"), "-o", file("in.ply"), "--iso", "0", "--overwrite"}, "is an input");
    const ProgramResult usual = run_strata({"surface", file("sphere.nrrd"), "-o", out, "--iso", "0", "--overwrite", "--quiet"});
    EXPECT_EQ(usual.exit_code, 0);
    EXPECT_TRUE(usual.out.empty() && usual.err.empty());
}

TEST_F(Surface, RealVolumes) {
    const char* const data = std::getenv("STRATA_DATA");
    if (data == nullptr || !std::filesystem::exists(std::string(data) + "/volume/headsq_quarter.mha")) GTEST_SKIP() << "the folder STRATA_DATA with real volumes is not there";
    const std::string volumes = std::string(data) + "/volume/";
    // The skull: at isovalue 1150 of the CT, cut off at the neck.
    const json skull = surface({volumes + "headsq_quarter.mha", "-o", file("skull.ply"), "--iso", "1150"});
    EXPECT_GT(skull["triangles"], 70'000);
    EXPECT_EQ(skull["nonmanifold_edges"], 0);
    EXPECT_EQ(skull["flipped_edges"], 0);
    EXPECT_EQ(skull["range"], (json{{"min", 0.0}, {"max", 3926.0}}));
    const json closed = surface({volumes + "headsq_quarter.mha", "-o", file("closed.ply"), "--iso", "1150", "--close"});
    EXPECT_EQ(closed["boundary_edges"], 0);
    EXPECT_GT(closed["volume"], 0.0);
    // Samples of 4 mm beside their header, of bytes; the surface must enclose about as much as samples above the isovalue fill.
    const json head = surface({volumes + "HeadMRVolume.mhd", "-o", file("head.stl"), "--iso", "60", "--close"});
    const std::string samples = test::file_contents(volumes + "HeadMRVolume.raw");
    const auto above = std::count_if(samples.begin(), samples.end(), [](char c) { return uint8_t(c) >= 60; });
    EXPECT_NEAR(head["volume"].get<double>() / (double(above) * 64), 1.0, 0.05);
    EXPECT_EQ(surface({volumes + "carotid.vtk", "-o", file("carotid.obj"), "--iso", "200", "--close"})["boundary_edges"], 0);
    const ProgramResult points = run_strata({"surface", volumes + "sphere_points.vdb", "-o", file("points.ply")});
    EXPECT_EQ(test::refusal_verdict(points), "");
    EXPECT_NE(points.err.find("a grid of float, double, bool or mask is expected"), std::string::npos) << points.err;
}

}  // namespace
}  // namespace strata
