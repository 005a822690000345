// strata surface --attributes, from file to mesh to pixel, by the real program.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "io/mesh/mesh_reader.h"
#include "tests/support/run_program.h"
#include "tests/support/scan_files.h"
#include "tests/support/surface_program.h"
#include "tests/support/vdb_file.h"

namespace strata {
namespace {

using nlohmann::json;
using test::ProgramResult;
using test::run_strata;

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

void write_bytes(const std::string& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

struct Volume {
    std::array<int, 3> size = {30, 30, 30};
    Vec3d spacing = Vec3d::Constant(0.5), origin = Vec3d(100, 200, -7);
    std::function<double(const Vec3d&)> value;

    // MetaImage, floats.
    std::string file() const {
        std::string text = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nDimSize =";
        for (const int n : size) text += ' ' + std::to_string(n);
        text += "\nElementSpacing =";
        for (const double s : spacing) text += ' ' + std::to_string(s);
        text += "\nOffset =";
        for (const double o : origin) text += ' ' + std::to_string(o);
        return text + "\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n" + samples();
    }
    std::string samples() const {
        std::string bytes;
        for (int k = 0; k < size[2]; ++k)
            for (int j = 0; j < size[1]; ++j)
                for (int i = 0; i < size[0]; ++i) {
                    const auto v = float(value(origin + spacing.cwiseProduct(Vec3d(i, j, k))));
                    bytes.append(reinterpret_cast<const char*>(&v), 4);
                }
        return bytes;
    }
};

const Vec3d kMiddle(107, 207, 0);
double ball(const Vec3d& p) { return 5.0 - (p - kMiddle).norm(); }
double linear(const Vec3d& p) { return 2.0 * p.x() - p.y() + 0.25 * p.z(); }

class SurfaceAttributes : public test::SurfaceProgram {
protected:
    void SetUp() override {
        write_bytes(file("ball.mha"), Volume{.value = ball}.file());
        write_bytes(file("heat.mha"), Volume{.value = linear}.file());
        // Elsewhere, with other steps, and only over a half of the ball.
        write_bytes(file("half.mha"), Volume{.size = {11, 12, 9}, .spacing = {1.5, 1.25, 1.0}, .origin = {99, 199, 0}, .value = linear}.file());
        write_bytes(file("none.mha"), Volume{.value = [](const Vec3d&) { return double(kUnknown); }}.file());
    }
    TriangleMesh mesh(const std::string& name) const { return read_mesh(file(name), {.scalars = true}); }
};

// A linear field is exact at vertices, from a volume on the same grid and from another one, and unknown where that one ends.
TEST_F(SurfaceAttributes, ValuesOfOtherVolumes) {
    std::string first;
    for (const char* const memory : {"100K", "1G"})
        for (const char* const threads : {"1", "3"}) {
            const json report = surface({file("ball.mha"), "-o", file("out.ply"), "--iso", "0", "--attributes", file("heat.mha") + ',' + file("half.mha"), "--memory", memory, "--threads", threads});
            const TriangleMesh found = mesh("out.ply");
            ASSERT_EQ(found.scalars.size(), 2u);
            EXPECT_EQ(found.scalars[0].name, "heat");
            EXPECT_EQ(found.scalars[1].name, "half");
            size_t unknown = 0;
            for (size_t v = 0; v < found.positions.size(); ++v) {
                const double expected = linear(found.positions[v]);
                EXPECT_NEAR(found.scalars[0].values[v], expected, 1e-4) << v;  // 100 in floats
                const float half = found.scalars[1].values[v];
                if (found.positions[v].z() < -0.5 - 1e-3) EXPECT_TRUE(std::isnan(half)) << v;
                else if (found.positions[v].z() > 1e-3) EXPECT_NEAR(half, expected, 1e-4) << v;
                unknown += std::isnan(half);
            }
            EXPECT_EQ(report["attributes"][0]["name"], "heat");
            EXPECT_EQ(report["attributes"][0]["unknown"], 0);
            // Over the ball it is 2 x - y + z / 4 within 5 |(2, -1, 1/4)| of the middle's, less what lies between vertices.
            EXPECT_NEAR(report["attributes"][0]["min"], 7 - 5 * std::sqrt(5.0625), 0.1);
            EXPECT_NEAR(report["attributes"][0]["max"], 7 + 5 * std::sqrt(5.0625), 0.1);
            EXPECT_EQ(report["attributes"][1]["unknown"], unknown);
            EXPECT_GT(unknown, found.positions.size() / 3);
            const std::string bytes = test::file_contents(file("out.ply"));
            if (first.empty()) first = bytes;
            EXPECT_EQ(bytes, first) << memory << ' ' << threads;
        }
    // info says them; and the picture of one that is the height is that of the heights.
    const json said = json::parse(run_strata({"info", "--json", file("out.ply")}).out);
    EXPECT_EQ(said["attributes"].back()["name"], "half");
    write_bytes(file("z.mha"), Volume{.value = [](const Vec3d& p) { return p.z(); }}.file());
    surface({file("ball.mha"), "-o", file("heights.ply"), "--iso", "0", "--attributes", file("z.mha")});
    EXPECT_EQ(run_strata({"render", file("heights.ply"), "-o", file("a.png"), "--size", "200x150", "--color", "elevation", "--range=-4,4"}).exit_code, 0);
    const ProgramResult same = run_strata({"render", file("heights.ply"), "-o", file("b.png"), "--size", "200x150", "--color", "z", "--range=-4,4", "--reference", file("a.png"), "--threshold", "3"});
    EXPECT_EQ(same.exit_code, 2) << "z is a coordinate of PLY, so that the attribute is z_2";
    const ProgramResult renamed = run_strata({"render", file("heights.ply"), "-o", file("b.png"), "--size", "200x150", "--color", "z_2", "--range=-4,4", "--reference", file("a.png"), "--threshold", "3"});
    EXPECT_EQ(renamed.exit_code, 0) << renamed.err;
}

TEST_F(SurfaceAttributes, FormatsKeepThemOrSayThatTheyDoNot) {
    for (const char* const ending : {"obj", "stl", "glb"}) {
        const json report = surface({file("ball.mha"), "-o", file(std::string("out.") + ending), "--iso", "0", "--attributes", file("half.mha")});
        ASSERT_EQ(report["notes"].size(), 1u) << report["notes"];
        const std::string note = report["notes"][0];
        EXPECT_NE(note.find(ending == std::string("glb") ? "GLB has no unknown values" : "has no attributes of vertices"), std::string::npos) << note;
    }
    const json report = surface({file("ball.mha"), "-o", file("none.ply"), "--iso", "0", "--attributes", file("none.mha")});
    ASSERT_EQ(report["notes"].size(), 1u);
    EXPECT_EQ(report["notes"][0], "attribute none: its value is known nowhere on the surface");
    EXPECT_TRUE(report["attributes"][0]["min"].is_null());
}

TEST_F(SurfaceAttributes, SamplesAloneHaveThemToo) {
    write_bytes(file("ball.raw"), Volume{.value = ball}.samples());
    write_bytes(file("heat.raw"), Volume{.value = linear}.samples());
    surface({file("ball.raw"), "-o", file("raw.ply"), "--iso", "0", "--dimensions", "30x30x30", "--type", "float", "--spacing", "0.5,0.5,0.5", "--attributes", file("heat.raw")});
    const TriangleMesh found = mesh("raw.ply");
    ASSERT_EQ(found.scalars.size(), 1u);
    for (size_t v = 0; v < found.positions.size(); ++v) EXPECT_NEAR(found.scalars[0].values[v], linear(found.positions[v] + Vec3d(100, 200, -7)), 1e-4);
    // A file that says what it is counts as that, a damaged one too: as samples alone it would be long enough.
    const std::vector<std::string> raw = {file("ball.raw"), "--iso", "0", "--dimensions", "8x8x8", "--type", "float", "--header-bytes", "0", "--attributes"};
    const auto with = [&](const std::string& attributes) {
        std::vector<std::string> words = raw;
        words.push_back(attributes);
        return words;
    };
    const std::string whole = Volume{.value = linear}.file();
    write_bytes(file("short.mha"), whole.substr(0, whole.size() - 4));
    refuse(with(file("short.mha")), 1, "short.mha");
    std::string unknown = whole;
    unknown.replace(unknown.find("MET_FLOAT"), 9, "MET_OTHER");
    write_bytes(file("unknown.mha"), unknown);
    refuse(with(file("unknown.mha")), 1, "MET_OTHER");
}

TEST_F(SurfaceAttributes, WhatIsWrongIsSaidInALine) {
    const std::string in = file("ball.mha"), heat = file("heat.mha");
    std::filesystem::create_directory(file("other"));
    write_bytes(file("other/heat.mha"), Volume{.value = linear}.file());
    write_bytes(file("cube.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    refuse({in, "--iso", "0", "--attributes", heat + ',' + file("other/heat.mha")}, 2, "two of them would be called 'heat'");
    refuse({in, "--iso", "0", "--attributes", file("missing.mha")}, 1, "missing.mha");
    refuse({in, "--iso", "0", "--attributes", file("cube.obj")}, 2, "a volume file is expected");
    refuse({in, "--iso", "0", "--attributes", folder_.path()}, 2, "a volume file is expected");
    // Shorter than its header says, at once; or, where that does not show, when it is read.
    const std::string whole = Volume{.value = linear}.file();
    write_bytes(file("short.mha"), whole.substr(0, whole.size() - 4));
    refuse({in, "--iso", "0", "--attributes", file("short.mha")}, 1, "short.mha");
    write_bytes(file("long.mha"), Volume{.size = {200, 200, 200}, .value = linear}.file());
    refuse({in, "--iso", "0", "--attributes", file("long.mha"), "--memory", "8M"}, 1, "its values need");
    const ProgramResult over = run({in, "-o", heat, "--iso", "0", "--attributes", heat, "--overwrite"});
    EXPECT_NE(over.exit_code, 0);
    EXPECT_EQ(test::file_contents(heat), whole);
}

// A file of text ends in the middle of its samples, beyond the surface: it is read to its end all the same.
TEST_F(SurfaceAttributes, DamageBeyondTheSurfaceIsFound) {
    std::string text = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 30 30 30\nSPACING 0.5 0.5 0.5\nORIGIN 100 200 -7\nPOINT_DATA 27000\nSCALARS s float 1\nLOOKUP_TABLE default\n";
    for (int i = 0; i < 26990; ++i) text += "1 ";
    write_bytes(file("text.vtk"), text + "1 1 1 1 1 1 1 1 1 1\n");
    surface({file("ball.mha"), "-o", file("whole.ply"), "--iso", "0", "--attributes", file("text.vtk")});
    write_bytes(file("text.vtk"), text + '\n');
    refuse({file("ball.mha"), "--iso", "0", "--attributes", file("text.vtk")}, 1, "text.vtk");
}

// Other grids of the same file: numbers, three numbers, and colors, which are light and only where they are active.
TEST_F(SurfaceAttributes, GridsOfTheSameFile) {
    const Vec3d middle(15, 16, 14);
    const auto to_ball = [&](int x, int y, int z) { return std::clamp(float((Vec3d(x, y, z) - middle).norm() - 9.3), -3.0f, 3.0f); };
    const auto linear_index = [](const Vec3d& p) { return 2.0 * p.x() - p.y() + 0.25 * p.z(); };
    test::VdbFileByHand vdb;
    vdb.add({.name = "surface", .background = {3.0f}, .value = [&](int x, int y, int z) { return std::vector<float>{to_ball(x, y, z)}; }, .grid_class = "level set"});
    vdb.add({.name = "heat", .value = [&](int x, int y, int z) { return std::vector<float>{float(linear_index(Vec3d(x, y, z)))}; }});
    vdb.add({.name = "coarse", .value = [&](int x, int y, int z) { return std::vector<float>{float(linear_index(Vec3d(2 * x, 2 * y, 2 * z)))}; }, .voxel_size = 2.0, .leaves = 2});
    vdb.add({.name = "flow", .type = "vec3s", .background = {0, 0, 0}, .value = [&](int x, int y, int z) { return std::vector<float>{float(x), float(2 * y), float(-z)}; }});
    // Light of 0.5 where it is red, 1/8 where it is blue; what is not active is white.
    vdb.add({.name = "Cd", .type = "vec3s", .background = {1, 1, 1}, .value = [&](int x, int y, int z) {
                 if (to_ball(x, y, z) > 0.0f) return std::vector<float>{1, 1, 1};
                 return x < 15 ? std::vector<float>{0.5f, 0, 0} : std::vector<float>{0, 0, 0.125f};
             }, .is_active = [&](int x, int y, int z) { return to_ball(x, y, z) <= 0.0f; }});
    write_bytes(file("grids.vdb"), vdb.bytes());
    std::string first;
    for (const char* const memory : {"64M", "3M"}) {  // with less, values wait in a file
        const json report = surface({file("grids.vdb"), "-o", file("grids.ply"), "--attributes", "heat,coarse,flow,Cd", "--memory", memory});
        ASSERT_EQ(report["attributes"].size(), 5u);
        const TriangleMesh found = mesh("grids.ply");
        ASSERT_EQ(found.scalars.size(), 5u);
        EXPECT_EQ(found.scalars[2].name, "flow_x");
        ASSERT_EQ(found.colors.size(), found.positions.size());
        ASSERT_GT(found.positions.size(), 1000u);
        size_t red = 0, blue = 0;
        for (size_t v = 0; v < found.positions.size(); ++v) {
            const Vec3d p = found.positions[v];
            EXPECT_NEAR(found.scalars[0].values[v], linear_index(p), 1e-5) << v;
            EXPECT_NEAR(found.scalars[1].values[v], linear_index(p), 1e-5) << v;
            EXPECT_NEAR(found.scalars[2].values[v], p.x(), 1e-5) << v;
            EXPECT_NEAR(found.scalars[3].values[v], 2 * p.y(), 1e-5) << v;
            EXPECT_NEAR(found.scalars[4].values[v], -p.z(), 1e-5) << v;
            // sRGB of 1/2 is 188, of 1/8 99.
            if (p.x() < 13.99) EXPECT_EQ(found.colors[v], (std::array<uint8_t, 4>{188, 0, 0, 255})) << p.transpose();
            if (p.x() > 15.01) EXPECT_EQ(found.colors[v], (std::array<uint8_t, 4>{0, 0, 99, 255})) << p.transpose();
            red += p.x() < 13.99;
            blue += p.x() > 15.01;
        }
        EXPECT_GT(std::min(red, blue), 400u);
        const std::string bytes = test::file_contents(file("grids.ply"));
        if (first.empty()) first = bytes;
        EXPECT_EQ(bytes, first);
    }
    refuse({file("grids.vdb"), "--attributes", "cold"}, 2, "no grid cold, there are surface (float), heat (float)");
    refuse({file("grids.vdb"), "--grid", "flow", "--iso", "1"}, 1, "values of float, double, bool or mask are expected");
    refuse({file("grids.vdb"), "--method", "cubes", "--attributes", "heat"}, 2, "--attributes is not for cubes");
    // A cut of the file anywhere in its last grid is found.
    const std::string whole = vdb.bytes();
    for (const size_t size : {whole.size() - 1, whole.size() - 300'000}) {
        write_bytes(file("cut.vdb"), whole.substr(0, size));
        refuse({file("cut.vdb"), "--attributes", "Cd"}, 1, "cut.vdb");
    }
}

// Voxels of two colors: the smooth surface has them.
TEST_F(SurfaceAttributes, ColorsOfVoxels) {
    std::string ply = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n";
    for (int i = 0; i < 8; ++i) ply += std::to_string(i & 1) + ' ' + std::to_string(i >> 1 & 1) + ' ' + std::to_string(i >> 2) + (i >> 2 ? " 0 0 255\n" : " 255 0 0\n");
    ply += "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";
    write_bytes(file("cube.ply"), ply);
    ASSERT_EQ(run_strata({"voxelize", file("cube.ply"), "-o", file("cube.svo"), "--resolution", "32"}).exit_code, 0);
    refuse({file("cube.svo"), "--attributes", "color"}, 2, "--attributes is for points, volumes and .vdb grids; " + file("cube.svo") + " is a file of voxels");
    surface({file("cube.svo"), "-o", file("smooth.ply"), "--method", "marching-cubes"});
    const TriangleMesh found = mesh("smooth.ply");
    ASSERT_EQ(found.colors.size(), found.positions.size());
    for (size_t v = 0; v < found.positions.size(); ++v) {
        const double z = found.positions[v].z();
        const auto& c = found.colors[v];
        EXPECT_EQ(c[1], 0);
        EXPECT_EQ(c[3], 255);
        if (z < -0.01) EXPECT_GT(c[0], 240);
        if (z > 1.01) EXPECT_GT(c[2], 240);
        if (z > 0.05 && z < 0.95) EXPECT_NEAR(c[2] / 255.0, z, 0.07);  // two voxels of 1/32
    }
}

}  // namespace
}  // namespace strata
