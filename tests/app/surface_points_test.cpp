// strata surface of points, by the real program: smooth surfaces near them, and the colors and attributes of points on meshes.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include <Eigen/Geometry>

#include "io/mesh/mesh_reader.h"
#include "tests/support/las_file.h"
#include "tests/support/run_program.h"
#include "tests/support/scanned_points.h"
#include "tests/support/surface_program.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;
using std::numbers::pi;
using test::run_strata;

class SurfaceOfPoints : public test::SurfaceProgram {
protected:
    bool has_note(const json& report, const std::string& part) const {
        for (const auto& note : report["notes"])
            if (note.get<std::string>().find(part) != std::string::npos) return true;
        return false;
    }
    std::string write(const std::string& name, const test::LasFile& las) const {
        const std::vector<std::byte> bytes = las.bytes();
        std::ofstream(file(name), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
        return file(name);
    }
    /// A ball of a radius of 10 around (500, 500, 100), red above its middle and blue below, with intensities that rise by 100 a unit, and classes
    /// 6 and 2. Bounds as said.
    std::string ball(const std::string& name = "ball.las", double highest = 110.0) const {
        test::LasFile las{.point_format = 2, .scale = {0.001, 0.001, 0.001}, .min = {490, 490, 90}, .max = {510, 510, highest}};
        for (const ScannedPoint& p : sphere_points(20'000, 10.0)) {
            const bool up = p.place.z() > 0.0;
            las.records.push_back(test::las_record(2, {.x = int32_t(std::lround((500.0 + p.place.x()) * 1000.0)),
                                                       .y = int32_t(std::lround((500.0 + p.place.y()) * 1000.0)),
                                                       .z = int32_t(std::lround((100.0 + p.place.z()) * 1000.0)),
                                                       .intensity = uint16_t(std::lround(100.0 * (10.0 + p.place.z()))),
                                                       .classification = uint8_t(up ? 6 : 2),
                                                       .rgb = {uint16_t(up ? 65535 : 0), 0, uint16_t(up ? 0 : 65535)}}));
        }
        return write(name, las);
    }

    TemporaryFolder folder_;
};

TEST_F(SurfaceOfPoints, ABallNeedsNothingSaid) {
    const json report = surface({ball(), "-o", file("ball.ply")});
    EXPECT_EQ(report["method"], "smooth");
    EXPECT_EQ(report["components"], 1);
    EXPECT_EQ(report["euler_characteristic"], 2);
    EXPECT_EQ(report["boundary_edges"], 0);
    EXPECT_NEAR(report["volume"].get<double>(), 4.0 / 3.0 * pi * 1000.0, 5.0);
    // 20,000 points on 400 pi square units.
    EXPECT_NEAR(report["voxel_size"].get<double>(), std::sqrt(400.0 * pi / 20'000.0), 0.05);
    EXPECT_NEAR(report["radius"].get<double>(), 3.0 * report["voxel_size"].get<double>(), 1e-9);
    EXPECT_EQ(report["normals"], "fitted");
    EXPECT_TRUE(has_note(report, "--radius 0.7")) << report["notes"];
    EXPECT_TRUE(has_note(report, "the points have no normals"));
    const TriangleMesh mesh = read_mesh(file("ball.ply"), {});
    ASSERT_EQ(mesh.colors.size(), mesh.positions.size());
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
        const Vec3d from = mesh.positions[v] - Vec3d(500, 500, 100);
        EXPECT_NEAR(from.norm(), 10.0, 0.03);
        if (std::abs(from.z()) < 0.8) continue;
        EXPECT_EQ(mesh.colors[v], from.z() > 0.0 ? (std::array<uint8_t, 4>{255, 0, 0, 255}) : (std::array<uint8_t, 4>{0, 0, 255, 255}));
    }
}

TEST_F(SurfaceOfPoints, AttributesOfPoints) {
    for (const std::vector<std::string>& more : {std::vector<std::string>{"--method", "smooth", "--voxel-size", "0.3"}, std::vector<std::string>{"--method", "balls", "--radius", "0.6"}}) {
        std::vector<std::string> words = {ball(), "-o", file("ball.ply"), "--attributes", "intensity,class,rgb[2]", "--normals"};
        words.insert(words.end(), more.begin(), more.end());
        surface(words);
        const TriangleMesh mesh = read_mesh(file("ball.ply"), {.scalars = true});
        ASSERT_EQ(mesh.scalars.size(), 3u);
        ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
        EXPECT_EQ(mesh.scalars[0].name, "intensity");
        EXPECT_EQ(mesh.scalars[1].name, "classification");
        for (size_t v = 0; v < mesh.positions.size(); ++v) {
            const Vec3d from = mesh.positions[v] - Vec3d(500, 500, 100);
            const Vec3d place = 10.0 * from.normalized();  // of the points there
            EXPECT_NEAR(mesh.scalars[0].values[v], 100.0 * (10.0 + place.z()), 20.0);
            EXPECT_TRUE(mesh.scalars[1].values[v] == 6.0f || mesh.scalars[1].values[v] == 2.0f);
            if (std::abs(place.z()) < 1.0) continue;
            EXPECT_EQ(mesh.scalars[1].values[v], place.z() > 0.0 ? 6.0f : 2.0f);
            EXPECT_NEAR(mesh.scalars[2].values[v], place.z() > 0.0 ? 0.0f : 65535.0f, 0.1f);
            EXPECT_EQ(mesh.colors[v][0], place.z() > 0.0 ? 255 : 0);
            if (more[1] == "smooth") EXPECT_GT(mesh.normals[v].dot(from.normalized().cast<float>()), 0.98f);
        }
    }
}

TEST_F(SurfaceOfPoints, TheSameWhateverTheMemoryAndThreads) {
    surface({ball(), "-o", file("one.ply"), "--threads", "1", "--memory", "1G", "--attributes", "intensity"});
    surface({ball(), "-o", file("other.ply"), "--threads", "3", "--memory", "64M", "--attributes", "intensity"});
    const auto bytes = [&](const std::string& name) {
        std::ifstream in(file(name), std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    EXPECT_GT(bytes("one.ply").size(), 100'000u);
    EXPECT_EQ(bytes("one.ply"), bytes("other.ply"));
}

TEST_F(SurfaceOfPoints, AViewpointTurnsThemInsideOut) {
    const json report = surface({ball(), "-o", file("in.ply"), "--viewpoint", "501,500,99"});
    EXPECT_EQ(report["euler_characteristic"], 2);
    EXPECT_LT(report["volume"].get<double>(), -4000.0);
    EXPECT_FALSE(report["sides_chosen"]);
}

TEST_F(SurfaceOfPoints, BoundsThatLieAreMeasured) {
    for (const std::vector<std::string>& more : {std::vector<std::string>{"--method", "smooth", "--voxel-size", "0.3"}, std::vector<std::string>{"--method", "balls", "--radius", "0.6"}}) {
        json right;
        for (const double bricks : {0.0, 0.5, 1.0, 1.5, 2.0, 6.0}) {
            std::vector<std::string> words = {ball("lies.las", 110.0 - bricks * 8 * 0.3), "-o", file("ball.ply")};
            words.insert(words.end(), more.begin(), more.end());
            const json report = surface(words);
            if (bricks == 0.0) right = report;
            EXPECT_EQ(report["boundary_edges"], 0) << bricks << more[1];
            EXPECT_EQ(report["triangles"], right["triangles"]) << bricks << more[1];
            const bool measured = has_note(report, "the header's bounds leave");
            if (bricks == 0.0 || bricks > 2.0) EXPECT_EQ(measured, bricks > 0.0) << report["notes"];
        }
    }
}

// A note names what was chosen, and nothing that was given.
TEST_F(SurfaceOfPoints, SaysWhatItChose) {
    json report = surface({ball(), "-o", file("ball.ply")});
    EXPECT_TRUE(has_note(report, " and --voxel-size"));
    report = surface({ball(), "-o", file("ball.ply"), "--method", "smooth", "--voxel-size", "0.3"});
    EXPECT_TRUE(has_note(report, "--radius"));
    EXPECT_FALSE(has_note(report, "--voxel-size")) << report["notes"];
}

TEST_F(SurfaceOfPoints, SaysWhatCannotBe) {
    const std::string in = ball();
    refuse({in, "--method", "smooth", "--radius", "1", "--voxel-size", "1"}, 2, "--radius: expected 2 to 7 times --voxel-size");
    refuse({in, "--method", "smooth", "--iso", "1"}, 2, "--iso is not for a smooth surface of points");
    refuse({in, "--quads"}, 2, "--quads is for --method cubes");
    refuse({in, "--close"}, 2, "--close is for volumes");
    refuse({in, "--attributes", "height"}, 2, "height");
    refuse({in, "--method", "cubes", "--voxel-size", "1", "--attributes", "intensity"}, 2, "--attributes is for --method smooth or balls, of points; here voxels are made of " + in);
    refuse({in, "--viewpoint", "1,2"}, 2, "--viewpoint");
    refuse({in, "--method", "balls", "--radius", "1", "--viewpoint", "1,2,3"}, 2, "--viewpoint is for --method smooth, of points");
    refuse({in, "--method", "smooth", "--memory", "1M"}, 1, "memory");
    std::ofstream(file("triangle.obj")) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    refuse({file("triangle.obj"), "--method", "smooth"}, 2, "--method smooth is for points");
    refuse({file("triangle.obj")}, 2, "of meshes --method cubes or marching-cubes");
    test::LasFile las{.point_format = 0, .scale = {1, 1, 1}, .max = {9, 9, 9}};
    las.records.assign(1000, test::las_record(0, {.x = 5, .y = 5, .z = 5}));
    refuse({write("equal.las", las)}, 2, "--radius says how far a point reaches");
    // Of one point with a radius there is a mesh, and nothing in it.
    las.records.resize(1);
    const json report = surface({write("one.las", las), "-o", file("none.ply"), "--method", "smooth", "--radius", "1"});
    EXPECT_EQ(report["triangles"], 0);
    EXPECT_TRUE(has_note(report, "normals of 1 point"));
    EXPECT_TRUE(has_note(report, "the surface is empty"));
}

// A terrain of an aerial scan: nearly all of its ground is one part that looks up.
TEST_F(SurfaceOfPoints, ARealScan) {
    const char* const data = std::getenv("STRATA_DATA");
    if (data == nullptr || !std::filesystem::exists(std::string(data) + "/las/sample_c.las")) GTEST_SKIP() << "the folder STRATA_DATA with real scans is not there";
    const json report = surface({std::string(data) + "/las/sample_c.las", "-o", file("ground.ply")});
    EXPECT_GT(report["triangles"].get<int>(), 20'000);
    EXPECT_LT(report["components"].get<int>(), 10);
    EXPECT_EQ(report["nonmanifold_edges"], 0);
    EXPECT_EQ(report["flipped_edges"], 0);
    const TriangleMesh mesh = read_mesh(file("ground.ply"), {});
    double up = 0.0, all = 0.0;
    for (const auto& t : mesh.triangles) {
        const Vec3d area = (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]);
        up += area.z() > 0.0 ? area.norm() : 0.0;
        all += area.norm();
    }
    EXPECT_GT(up, 0.95 * all);
}

}  // namespace
}  // namespace strata
