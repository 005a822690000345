// strata surface of voxels and points, by the real program: what marching cubes makes of them, and faces of cubes in other ways than closed.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>

#include "io/mesh/mesh_reader.h"
#include "tests/support/las_file.h"
#include "tests/support/run_program.h"
#include "tests/support/surface_program.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

using nlohmann::json;
using std::numbers::pi;
using test::ProgramResult;
using test::run_strata;

class SurfaceOfVoxels : public test::SurfaceProgram {
protected:
    /// A solid ball of a radius of 40 voxels, of which 3 are a unit.
    std::string ball() const {
        const TriangleMesh mesh = sphere_mesh(Vec3d(7, -3, 5), 40.0 / 3.0, 200);
        std::ofstream out(file("ball.obj"));
        for (const Vec3d& p : mesh.positions) out << "v " << p.x() << " " << p.y() << " " << p.z() << "\n";
        for (const auto& t : mesh.triangles) out << "f " << t[0] + 1 << " " << t[1] + 1 << " " << t[2] + 1 << "\n";
        out.close();
        EXPECT_EQ(run_strata({"voxelize", file("ball.obj"), "-o", file("ball.svo"), "--kind", "solid", "--voxel-size",
                              "0.33333333333333333", "--quiet"})
                      .exit_code,
                  0);
        return file("ball.svo");
    }
    /// A row of points, which become voxels of 1: red, green, green, blue.
    std::string row() const {
        test::LasFile points{.point_format = 2, .scale = {0.5, 0.5, 0.5}, .max = {4, 1, 1}};
        for (int i = 0; i < 4; ++i) {
            const auto of = [](bool on) { return uint16_t(on ? 65535 : 0); };
            points.records.push_back(
                test::las_record(2, {.x = 2 * i + 1, .y = 1, .z = 1, .rgb = {of(i == 0), of(i == 1 || i == 2), of(i == 3)}}));
        }
        const std::vector<std::byte> bytes = points.bytes();
        std::ofstream(file("row.las"), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        return file("row.las");
    }
};

TEST_F(SurfaceOfVoxels, SharesOfCellsMakeASmoothBall) {
    const double radius = 40.0 / 3.0, volume = 4.0 / 3.0 * pi * radius * radius * radius, area = 4.0 * pi * radius * radius;
    const std::string in = ball();
    const json smooth = surface({in, "-o", file("a.ply"), "--method", "marching-cubes", "--voxel-size", "0.67"});
    EXPECT_EQ(smooth["method"], "marching-cubes");
    EXPECT_EQ(smooth["boundary_edges"], 0);
    EXPECT_EQ(smooth["euler_characteristic"], 2);
    EXPECT_NEAR(smooth["volume"].get<double>() / volume, 1.0, 0.01);
    EXPECT_NEAR(smooth["area"].get<double>() / area, 1.0, 0.03);
    // Cubes of the same have the area of their steps: 3/2 of a sphere's.
    EXPECT_NEAR(surface({in, "-o", file("b.ply")})["area"].get<double>() / area, 1.5, 0.02);
    // Coarser cells of a wall one voxel thick are not half occupied: that is said.
    ASSERT_EQ(run_strata({"voxelize", file("ball.obj"), "-o", file("shell.svo"), "--voxel-size", "0.33333333333333333", "--quiet"}).exit_code, 0);
    const std::string of_shell = surface({file("shell.svo"), "-o", file("s.ply"), "--method", "marching-cubes", "--voxel-size", "2.7"})["notes"].dump();
    EXPECT_NE(of_shell.find("--iso 0.1 takes more of them in"), std::string::npos) << of_shell;
    EXPECT_GT(surface({file("shell.svo"), "-o", file("s.ply"), "--method", "marching-cubes", "--voxel-size", "2.7", "--iso", "0.05"})["triangles"], 0);
    // A share of 1 is inside only.
    const json inner = surface({in, "-o", file("d.ply"), "--method", "marching-cubes", "--voxel-size", "0.67", "--iso", "1"});
    EXPECT_LT(inner["volume"].get<double>(), smooth["volume"].get<double>());

    refuse({in, "--method", "marching-cubes", "--inside", "below"}, 2, "--inside below is not for voxels");
    refuse({in, "--method", "marching-cubes", "--iso", "0"}, 2, "--iso: of voxels it is a share above 0");
    refuse({in, "--method", "marching-cubes", "--quads"}, 2, "--quads is for --method cubes");
    refuse({in, "--method", "marching-cubes", "--grid", "a"}, 2, "is no .vdb file");
}

TEST_F(SurfaceOfVoxels, RectanglesAsTheyAreAndNormals) {
    const std::string in = ball();
    const json closed = surface({in, "-o", file("a.ply")});
    const json quads = surface({in, "-o", file("b.ply"), "--quads"});
    EXPECT_EQ(quads["quads"], closed["rectangles"]);
    EXPECT_EQ(quads["triangles"], 0);
    EXPECT_EQ(quads["vertices"].get<uint64_t>(), 4 * closed["rectangles"].get<uint64_t>());
    EXPECT_NEAR(quads["volume"].get<double>(), closed["volume"].get<double>(), 1e-6);
    const json halves = surface({in, "-o", file("b.stl"), "--quads"});
    EXPECT_EQ(halves["quads"], 0) << "STL has triangles only";
    EXPECT_EQ(halves["triangles"].get<uint64_t>(), 2 * closed["rectangles"].get<uint64_t>());
    for (const char* const way : {"--normals", "--quads"}) {
        surface({in, "-o", file("c.ply"), "--normals", way});
        const TriangleMesh mesh = read_mesh(file("c.ply"));
        ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
        for (const auto& t : mesh.triangles) {
            const Vec3d normal =
                (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).normalized();
            for (const uint32_t v : t) ASSERT_LT((mesh.normals[v].cast<double>() - normal).norm(), 1e-6);
        }
    }
}

TEST_F(SurfaceOfVoxels, ColorsThatCanBeSeenThrough) {
    const std::string in = row();
    const auto cubes = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {in, "-o", file("a.ply"), "--method", "cubes", "--voxel-size", "1"});
        return surface(words);
    };
    const json opaque = cubes({});
    EXPECT_EQ(opaque["faces_culled"], 4 * 4 + 2);
    EXPECT_DOUBLE_EQ(opaque["volume"].get<double>(), 4.0);
    // Red and blue have a face towards the green glass, which has none towards them, nor within.
    const json glass = cubes({"--transparent", "00ff00:90"});
    EXPECT_EQ(glass["faces_culled"], 4 * 4 + 2 + 2);
    EXPECT_TRUE(glass["volume"].is_null()) << "the glass is open at both ends: " << glass["volume"];
    const TriangleMesh mesh = read_mesh(file("a.ply"));
    for (const auto& color : mesh.colors) EXPECT_EQ(color[3], color[1] == 255 ? 90 : 255);
    const auto summary = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"surface", in, "-o", file("a.ply"), "--overwrite", "--method", "cubes", "--voxel-size", "1"});
        return run_strata(words).err;
    };
    EXPECT_NE(summary({}).find(", volume 4\n"), std::string::npos) << summary({});
    EXPECT_EQ(summary({"--transparent", "00ff00:90"}).find("volume"), std::string::npos);
    // All of glass: one closed part that is as large as its voxels.
    EXPECT_DOUBLE_EQ(cubes({"--transparent", "ff0000:90,00ff00:90,0000ff:90"})["volume"].get<double>(), 4.0);
    // Of two that can be seen through both have one.
    EXPECT_EQ(cubes({"--transparent", "00ff00:90,0000ff:0"})["faces_culled"], 4 * 4 + 2 + 3);

    const std::string expected = "--transparent: expected colors such as 60a0ff:90";
    for (const char* const list : {"", "00ff00", "00ff00:255", "00ff0:9", "00ff00:9,", "00fg00:9", "00ff00:x"})
        refuse({in, "--method", "cubes", "--voxel-size", "1", "--transparent", list}, 2, expected);
    refuse({ball(), "--transparent", "00ff00:9"}, 2, "the voxels have no colors");
}

// Only the surface of a volume can meet a boundary.
TEST_F(SurfaceOfVoxels, CloseIsForVolumes) {
    const std::string in = row(), voxels = ball(), said = "--close is for volumes";
    refuse({in, "--close", "--radius", "0.5"}, 2, said);
    refuse({in, "--close", "--method", "cubes", "--voxel-size", "1"}, 2, said);
    refuse({in, "--close", "--method", "marching-cubes", "--voxel-size", "1"}, 2, said);
    refuse({in, in, "--close", "--radius", "0.5"}, 2, said);
    refuse({file("ball.obj"), "--close", "--method", "cubes", "--voxel-size", "1"}, 2, said);
    refuse({voxels, "--close"}, 2, said);
    refuse({voxels, "--close", "--method", "marching-cubes"}, 2, said);
    ASSERT_EQ(run_strata({"convert", in, file("lod"), "--quiet"}).exit_code, 0);
    refuse({file("lod"), "--close", "--radius", "0.5"}, 2, said);
    const ProgramResult grid = run_strata({"voxelize", file("ball.obj"), "-o", file("ball.vdb"), "--kind", "level-set", "--resolution", "32", "--quiet"});
    if (grid.exit_code != 0) GTEST_SKIP() << "grids are not tested: " << grid.err;
    refuse({file("ball.vdb"), "--close"}, 2, said);
    refuse({file("ball.vdb"), "--close", "--method", "cubes"}, 2, said);
}

// Four points in a row, a unit apart: four balls, or one body.
TEST_F(SurfaceOfVoxels, BallsAroundPoints) {
    const std::string in = row();
    const json apart = surface({in, "-o", file("apart.ply"), "--method", "balls", "--radius", "0.45", "--voxel-size", "0.1"});
    EXPECT_EQ(apart["components"], 4);
    EXPECT_EQ(apart["euler_characteristic"], 8);
    EXPECT_EQ(apart["boundary_edges"], 0);
    EXPECT_NEAR(apart["volume"].get<double>() / (4 * 4.0 / 3.0 * pi * 0.45 * 0.45 * 0.45), 1.0, 0.03);
    const json one = surface({in, "-o", file("one.ply"), "--method", "balls", "--radius", "0.7"});
    EXPECT_EQ(one["components"], 1);
    EXPECT_EQ(one["euler_characteristic"], 2);
    refuse({in, "--radius", "0.5", "--method", "cubes"}, 2, "--radius is for --method smooth or balls");
    refuse({in, "--method", "balls", "--radius", "0.5", "--iso", "1"}, 2, "--iso is not for balls around points");
    refuse({in, "--method", "balls", "--radius", "0.5", "--voxel-size", "2"}, 2, "from 1 to 6 spacings");
    refuse({in, "--radius", "-1"}, 2, "--radius: expected a positive number");
    refuse({ball(), "--radius", "1"}, 2, "--radius is not for voxels");
    refuse({in, "--method", "balls"}, 2, "--method balls: --radius R is expected");
    refuse({in, "--method", "balls", "--radius", "1", "--viewpoint", "1,2,3"}, 2, "--viewpoint is for --method smooth");
    refuse({file("ball.svo"), "--method", "balls", "--radius", "1"}, 2, "--method balls is for points");
}

TEST_F(SurfaceOfVoxels, BallsAreTheSameWhateverTheMemoryAndThreads) {
    const std::string in = STRATA_SOURCE_DIR "/sample_data/village.las";
    const auto bytes = [&](const std::string& name) {
        std::ifstream in_file(file(name), std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in_file), {});
    };
    surface({in, "-o", file("much.ply"), "--method", "balls", "--radius", "2", "--threads", "1"});
    surface({in, "-o", file("little.ply"), "--method", "balls", "--radius", "2", "--threads", "3", "--memory", "48M"});
    EXPECT_GT(bytes("much.ply").size(), 1'000'000u);
    EXPECT_TRUE(bytes("much.ply") == bytes("little.ply"));
}

}  // namespace
}  // namespace strata
