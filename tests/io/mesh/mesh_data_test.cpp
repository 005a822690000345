// Real files of many makers against facts that were computed by other means, and how files are recognised.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "io/format.h"
#include "tests/io/mesh/mesh_of.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using nlohmann::json;

TEST(MeshData, EveryFileIsWhatTheIndexSays) {
    const char* const folder = std::getenv("STRATA_DATA");
    std::ifstream index(std::string(folder ? folder : "") + "/index.json");
    if (!folder || !index) GTEST_SKIP() << "STRATA_DATA names no folder with index.json";
    size_t files = 0;
    for (const json& entry : json::parse(index)) {
        const std::string kind = entry["format"];
        if (kind != "OBJ" && kind != "STL" && kind != "PLY") continue;
        ++files;
        const std::string path = std::string(folder) + "/" + entry["file"].get<std::string>();
        SCOPED_TRACE(path);
        MeshReport report;
        const TriangleMesh mesh = read_mesh(path, {}, &report);
        EXPECT_EQ(identify_format(path).kind, FormatKind::mesh);
        const std::string note = entry["note"];
        // STL has corners; the index counts the distinct ones in its note.
        const size_t vertices = kind == "STL" ? std::stoul(note) : entry["points"].get<size_t>();
        EXPECT_EQ(mesh.positions.size(), vertices);
        EXPECT_EQ(report.faces, entry["faces"].get<size_t>());
        EXPECT_TRUE(report.notes.empty());
        const Box3d box = mesh.bounds();
        for (size_t axis = 0; axis < 3; ++axis) {
            EXPECT_EQ(box.min[Eigen::Index(axis)], entry["min"][axis].get<double>());
            EXPECT_EQ(box.max[Eigen::Index(axis)], entry["max"][axis].get<double>());
        }
        const std::string attributes = entry["attributes"].dump();
        EXPECT_EQ(!mesh.colors.empty(), attributes.find("colour") != std::string::npos || attributes.find("red") != std::string::npos);
        EXPECT_EQ(!mesh.normals.empty(), attributes.find("vn ") != std::string::npos || attributes.find("nx:") != std::string::npos);
        for (const auto& triangle : mesh.triangles)
            for (const uint32_t vertex : triangle) ASSERT_LT(vertex, mesh.positions.size());
    }
    EXPECT_GE(files, 25u);
}

// The same model in two byte orders, and the same sphere in text and bytes.
TEST(MeshData, TwinsAreEqual) {
    const char* const folder = std::getenv("STRATA_DATA");
    const std::string data = folder ? folder : "";
    if (!std::filesystem::exists(data + "/ply/lucy.ply")) GTEST_SKIP() << "STRATA_DATA has no ply/lucy.ply";
    const TriangleMesh lucy = read_mesh(data + "/ply/lucy.ply"), swapped = read_mesh(data + "/ply/lucy_big_endian.ply");
    EXPECT_EQ(lucy.positions, swapped.positions);
    EXPECT_EQ(lucy.triangles, swapped.triangles);
    const TriangleMesh bytes = read_mesh(data + "/stl/test_sphere.stl"), text = read_mesh(data + "/stl/test_sphere_ascii.stl");
    EXPECT_EQ(bytes.triangles, text.triangles);
    for (size_t i = 0; i < bytes.positions.size(); ++i) EXPECT_NEAR((bytes.positions[i] - text.positions[i]).norm(), 0.0, 1e-6) << i;  // six decimals
    const TriangleMesh colored = read_mesh(data + "/ply/test_pos_color.ply"), colored_text = read_mesh(data + "/ply/test_pos_color_ascii.ply");
    EXPECT_EQ(colored.colors, colored_text.colors);
    EXPECT_EQ(colored.triangles, colored_text.triangles);
}

class MeshFormat : public ::testing::Test {
protected:
    std::string write(const std::string& name, const std::string& text) {
        std::ofstream(folder_.file(name), std::ios::binary) << text;
        return folder_.file(name);
    }
    TemporaryFolder folder_;
};

TEST_F(MeshFormat, ContentDecidesAndTheEndingHelps) {
    const std::string facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    std::string binary(134, '\0');
    binary.replace(0, 5, "solid");
    binary[80] = 1;
    EXPECT_EQ(identify_format(write("a.obj", binary)).name, "stl");
    EXPECT_EQ(identify_format(write("b.obj", "solid a\n" + facet + "endsolid\n")).name, "stl");
    EXPECT_EQ(identify_format(write("b2.obj", "SOLID a\nFACET normal 0 0 1\n")).name, "stl");
    EXPECT_EQ(identify_format(write("c.stl", "# model\r\n\r\nv 1 2 3\r\n")).name, "obj");
    EXPECT_EQ(identify_format(write("d", "mtllib a.mtl\nv 1 2 3\n")).name, "obj");
    EXPECT_EQ(identify_format(write("e.OBJ", "o thing\n")).name, "obj");
    EXPECT_EQ(identify_format(write("f.Stl", "damaged")).name, "stl");
    EXPECT_EQ(identify_format(write("g.obj", "ply\nformat ascii 1.0\n")).name, "ply");
    for (const char* const text : {"v 1 2\n", "hello", "solid ground\n", "# only a comment\n"}) EXPECT_THROW(identify_format(write("h.txt", text)), Error) << text;
    EXPECT_THROW(identify_format(write("i.obj", "")), Error);
}

TEST_F(MeshFormat, AMeshIsReadByItsContent) {
    EXPECT_EQ(read_mesh(write("a.txt", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).triangles.size(), 1u);
    const std::string points = write("p.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\nnan 0 0\n");
    EXPECT_EQ(read_mesh(points).triangles.size(), 0u);
    try {
        read_mesh(points, {.triangles_needed = true});
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::malformed);
        EXPECT_EQ(error.what(), points + ": triangles are expected, there are 0 vertices without any; 1 vertices without a finite position are left out, and 0 triangles that use them");
    }
    const std::string scan = write("s.las", "LASF");
    try {
        read_mesh(scan);
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::unsupported);
        EXPECT_EQ(error.what(), scan + ": las (LAS 1.0 to 1.4, point formats 0 to 10): a mesh is expected here");
    }
    EXPECT_THROW(read_mesh(folder_.file("none")), Error);
}

TEST_F(MeshFormat, PointsOfMeshesAreNoPoints) {
    const std::string path = write("p.ply", "ply\n");
    try {
        open_points({&path, 1});
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::unsupported);
        EXPECT_EQ(error.what(), path + ": ply (Stanford polygon file, a mesh): this version reads it as a mesh only; a file of points is expected here");
    }
}

}  // namespace
}  // namespace strata
