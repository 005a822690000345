// strata surface: cubes of volumes, by the real program.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "io/mesh/mesh_reader.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/surface_program.h"

namespace strata {
namespace {

using nlohmann::json;
using test::run_strata;

class CubesOfVolumes : public test::SurfaceProgram {
protected:
    /// A NRRD file; T is of type `type`.
    template <typename T>
    std::string volume(const std::string& name, const char* type, std::array<int, 3> size, const std::function<T(int, int, int)>& value, const std::string& placement = "") {
        std::string bytes;
        for (int k = 0; k < size[2]; ++k)
            for (int j = 0; j < size[1]; ++j)
                for (int i = 0; i < size[0]; ++i) {
                    const T v = value(i, j, k);
                    bytes.append(reinterpret_cast<const char*>(&v), sizeof v);
                }
        std::ofstream(file(name), std::ios::binary) << "NRRD0004\ntype: " << type << "\ndimension: 3\nsizes: " << size[0] << ' ' << size[1] << ' ' << size[2] << '\n'
                                                    << placement << "encoding: raw\nendian: little\n\n" << bytes;
        return file(name);
    }
    std::string ball() {
        return volume<uint8_t>("ball.nrrd", "uint8", {32, 32, 32}, [](int i, int j, int k) { return uint8_t((i - 16) * (i - 16) + (j - 16) * (j - 16) + (k - 16) * (k - 16) <= 256 ? 200 : 0); });
    }
};

TEST_F(CubesOfVolumes, TheBallOfIntegers) {
    std::string first;
    for (const char* const memory : {"4M", "1G"})
        for (const char* const threads : {"1", "3"}) {
            const json report = surface({ball(), "-o", file("out.ply"), "--method", "cubes", "--iso", "100", "--memory", memory, "--threads", threads});
            EXPECT_EQ(report["method"], "cubes");
            EXPECT_EQ(report["solid_voxels"], 17'074);
            EXPECT_EQ(report["faces_uncut"], 102'444);
            EXPECT_EQ(report["faces_culled"], 4'770);
            EXPECT_LE(report["rectangles"], 2'100);
            EXPECT_EQ(report["volume"], 17'074.0);
            EXPECT_EQ(report["boundary_edges"], 0);
            const std::string bytes = test::file_contents(file("out.ply"));
            if (first.empty()) first = bytes;
            EXPECT_EQ(bytes, first) << memory << ' ' << threads;
        }
    // What is outside is the rest.
    EXPECT_EQ(surface({ball(), "-o", file("rest.ply"), "--method", "cubes", "--iso", "100", "--inside", "below"})["solid_voxels"], 32 * 32 * 32 - 17'074);
    const json quads = surface({ball(), "-o", file("quads.ply"), "--method", "cubes", "--iso", "100", "--quads"});
    EXPECT_EQ(quads["quads"], quads["rectangles"]);
}

// Each sample is the center of its cell; steps and turned axes are the file's.
TEST_F(CubesOfVolumes, LieWhereTheFileSays) {
    const std::string placement = "space: left-posterior-superior\nspace directions: (0.5,0,0) (0,-0.25,0) (0,0,3)\nspace origin: (10,20,30)\n";
    const std::string in = volume<int16_t>("one.nrrd", "int16", {3, 4, 5}, [](int i, int j, int k) { return int16_t(i == 1 && j == 2 && k == 3 ? -5 : -6); }, placement);
    const json report = surface({in, "-o", file("one.ply"), "--method", "cubes", "--iso=-5", "--normals"});
    EXPECT_EQ(report["solid_voxels"], 1);
    EXPECT_NEAR(report["volume"], 0.5 * 0.25 * 3.0, 1e-6);  // and not less than 0, though the axes are left-handed
    const Box3d box = read_mesh(file("one.ply")).bounds();
    EXPECT_LT((box.min - Vec3d(10.25, 19.375, 37.5)).norm(), 1e-5) << box.min.transpose();
    EXPECT_LT((box.max - Vec3d(10.75, 19.625, 40.5)).norm(), 1e-5) << box.max.transpose();
}

TEST_F(CubesOfVolumes, LabelsAreColorsAndValues) {
    const std::string in = volume<uint16_t>("labels.nrrd", "uint16", {80, 80, 80}, [](int i, int j, int k) { return uint16_t(i < 10 || j < 10 || k < 10 || i >= 70 || j >= 70 || k >= 70 ? 0 : i < 40 ? 1 : j < 40 ? 257 : 60'000); });
    const json report = surface({in, "-o", file("labels.ply"), "--labels"});
    EXPECT_EQ(report["method"], "cubes");
    EXPECT_EQ(report["solid_voxels"], 60 * 60 * 60);
    EXPECT_EQ(report["faces_culled"], 6 * 60 * 60);
    ASSERT_EQ(report["labels"].size(), 3u);
    EXPECT_EQ(report["labels"][0], json({{"value", 1}, {"color", report["labels"][0]["color"]}, {"voxels", 30 * 60 * 60}}));
    EXPECT_EQ(report["labels"][2]["value"], 60'000);
    EXPECT_EQ(report["attributes"][0]["max"], 60'000);
    std::set<std::string> colors;
    for (const json& label : report["labels"]) colors.insert(label["color"]);
    EXPECT_EQ(colors.size(), 3u) << "1 and 257 have the same color among categories";
    const TriangleMesh mesh = read_mesh(file("labels.ply"), {.scalars = true});
    ASSERT_EQ(mesh.scalars.size(), 1u);
    EXPECT_EQ(mesh.scalars[0].name, "label");
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
        char color[8];
        std::snprintf(color, sizeof color, "#%02x%02x%02x", mesh.colors[v][0], mesh.colors[v][1], mesh.colors[v][2]);
        const float value = mesh.scalars[0].values[v];
        const auto label = std::find_if(report["labels"].begin(), report["labels"].end(), [&](const json& l) { return l["value"] == value; });
        ASSERT_NE(label, report["labels"].end()) << value;
        EXPECT_EQ((*label)["color"], color);
        if (mesh.positions[v].x() < 39) EXPECT_EQ(value, 1.0f);
    }
    // Seen through, one shows the others behind it.
    const std::string glass = report["labels"][0]["color"].get<std::string>().substr(1) + ":90";
    EXPECT_EQ(surface({in, "-o", file("glass.ply"), "--labels", "--transparent", glass})["faces_culled"], 7 * 60 * 60);
    EXPECT_EQ(run_strata({"render", file("labels.ply"), "-o", file("labels.png"), "--size", "100x80", "--color", "label"}).exit_code, 0);
    // Nothing but 0.
    const json none = surface({volume<uint8_t>("none.nrrd", "uint8", {9, 9, 9}, [](int, int, int) { return uint8_t{0}; }), "-o", file("none.ply"), "--labels"});
    EXPECT_EQ(none["triangles"], 0);
    EXPECT_EQ(none["notes"][0], "all labels are 0: the mesh is empty");
}

// Categories have 256 colors: forty times as many labels still have their own each, and more than there may be, or than fit, are refused.
TEST_F(CubesOfVolumes, ManyLabelsHaveColorsOfTheirOwn) {
    const auto number = [](int i, int j, int) { return int32_t(1 + i + 512 * j); };
    const json report = surface({volume<int32_t>("many.nrrd", "int32", {512, 20, 1}, number), "-o", file("many.ply"), "--labels", "--quads"});
    std::set<std::string> colors;
    for (const json& label : report["labels"]) colors.insert(label["color"]);
    EXPECT_EQ(colors.size(), 512u * 20u);
    refuse({volume<int32_t>("more.nrrd", "int32", {512, 2049, 1}, number), "--labels"}, 1, "more.nrrd: sample (0, 2048, 0): one more label than the 1048576 that there may be");
    refuse({volume<int32_t>("large.nrrd", "int32", {512, 512, 1}, number), "--labels", "--memory", "200M"}, 1, " bytes of memory or more, 209715200 are allowed; a coarser volume needs less");
}

TEST_F(CubesOfVolumes, WhatIsWrongIsSaid) {
    const std::string in = ball();
    refuse({in, "--method", "cubes"}, 2, "--iso V is expected; the values of ");
    refuse({in, "--method", "cubes", "--iso", "1,2"}, 2, "one isovalue is expected, got 2");
    refuse({in, "--method", "cubes", "--iso", "1", "--close"}, 2, "--close is for --method marching-cubes");
    refuse({in, "--method", "cubes", "--iso", "1", "--voxel-size", "2"}, 2, "--voxel-size is for voxels");
    refuse({in, "--method", "cubes", "--iso", "1", "--transparent", "000000:9"}, 2, "--transparent is for cubes of several colors");
    refuse({in, "--method", "cubes", "--iso", "1", "--attributes", in}, 2, "--attributes is not for cubes");
    refuse({in, "--labels", "--iso", "1"}, 2, "--iso and --labels");
    refuse({in, "--labels", "--method", "marching-cubes"}, 2, "--labels makes cubes");
    const std::string halves = volume<float>("halves.nrrd", "float", {3, 3, 3}, [](int i, int, int) { return float(i) / 2; });
    refuse({halves, "--labels"}, 1, "halves.nrrd: sample (1, 0, 0): a label is expected, a whole number of less than 2^24, it is 0.5");
    const std::string whole = test::file_contents(in);
    std::ofstream(in, std::ios::binary) << whole.substr(0, whole.size() - 1);
    refuse({in, "--method", "cubes", "--iso", "1"}, 1, "ball.nrrd");
    std::ofstream(file("cube.obj")) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    refuse({file("cube.obj"), "--labels", "--voxel-size", "1"}, 2, "--labels is for volumes");
}

}  // namespace
}  // namespace strata
