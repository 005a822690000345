#include <cmath>

#include "tests/io/mesh/mesh_of.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

using test::Triangles;

test::MeshOf obj(const std::string& text) { return test::mesh_of(read_obj, text); }
std::string refusal(const std::string& text) { return test::refusal_of(read_obj, text); }

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(ObjReader, ReadsVerticesAndFaces) {
    const auto [mesh, report] = obj("v 1 2 3\nv 0.1 -0.25 1e3\nv 4 5 6 1.0\nf 1 2 3\n");
    ASSERT_EQ(mesh.positions.size(), 3u);
    EXPECT_EQ(mesh.positions[1], Vec3d(0.1, -0.25, 1000.0));
    EXPECT_EQ(mesh.positions[2], Vec3d(4, 5, 6));
    EXPECT_EQ(mesh.triangles, (Triangles{{0, 1, 2}}));
    EXPECT_TRUE(mesh.normals.empty());
    EXPECT_TRUE(mesh.colors.empty());
    EXPECT_EQ(report.format, "OBJ");
    EXPECT_EQ(report.faces, 1u);
    EXPECT_TRUE(report.notes.empty());
}

// The same square in every way to write it.
TEST(ObjReader, EveryWayToWriteAFace) {
    const Triangles square = {{0, 1, 2}, {0, 2, 3}};
    const std::string more = "vt 0 0\nvt 1 1\nvt 0 1\nvt 1 0\nvn 0 0 1\n";
    for (const std::string face : {"f 1 2 3 4", "f 1/1 2/2 3/3 4/4", "f 1//1 2//1 3//1 4//1", "f 1/1/1 2/2/1 3/3/1 4/4/1", "f -4 -3 -2 -1",
                                   "f -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1", "f 1/1/ 2/2/ 3/3/ 4/4/", "f\t1  2\t 3 4  ", "fo 1 2 3 4", "f 1 2 3 4 # a square",
                                   "f 1 2 \\\n3 4", "f 1 2 3\nf 1 3 4", "f +1 +2 +3 +4"}) {
        const auto [mesh, report] = obj(kSquare + more + face + "\n");
        EXPECT_EQ(mesh.triangles, square) << face;
        EXPECT_EQ(obj(kSquare + more + face).mesh.triangles, square) << face;  // no line end
    }
    std::string windows = kSquare + "f 1 2 \\\n3 4\n", mac;
    for (size_t at = 0; (at = windows.find('\n', at)) != std::string::npos; at += 2) windows.insert(at, "\r");
    EXPECT_EQ(obj(windows).mesh.triangles, square);
    for (const char c : windows)
        if (c != '\n') mac += c;
    EXPECT_EQ(obj(mac).mesh.triangles, square);
}

TEST(ObjReader, PolygonsBecomeFans) {
    const auto [mesh, report] = obj(kSquare + "v -1 0.5 0\nf 5 4 3 2 1\n");
    EXPECT_EQ(mesh.triangles, (Triangles{{4, 3, 2}, {4, 2, 1}, {4, 1, 0}}));
    EXPECT_EQ(report.faces, 1u);
}

TEST(ObjReader, StatementsOfOtherThingsArePassed) {
    const auto [mesh, report] = obj("# head\n#\n\nmtllib a b.mtl\no name with 1 2 3\ng a b\n" + kSquare +
                                    "vt 0.5\nvp 1 2\nusemtl red\ns off\ns 1\nf 1 2 3\nl 1 2\np 1\ncurv 0 1 1 2\n");
    EXPECT_EQ(mesh.triangles.size(), 1u);
    ASSERT_EQ(report.notes.size(), 1u);
    EXPECT_EQ(report.notes[0], "3 statements of points, lines, curves and surfaces are left out");
}

// Indices count from the start of the file or back from the line; those from the start may run ahead.
TEST(ObjReader, FacesMayComeBeforeTheirVertices) {
    EXPECT_EQ(obj("f 1 2 3\n" + kSquare).mesh.triangles, (Triangles{{0, 1, 2}}));
    EXPECT_EQ(obj(kSquare + "f -1 -2 -3\nv 5 5 5\nf -1 -2 -3\n").mesh.triangles, (Triangles{{3, 2, 1}, {4, 3, 2}}));
    const auto ahead = obj("f 1//1 2//1 3//1\n" + kSquare + "vn 0 0 2\n");
    ASSERT_EQ(ahead.mesh.normals.size(), 4u);
    EXPECT_EQ(ahead.mesh.normals[2], Vec3f(0, 0, 1));
    EXPECT_EQ(ahead.mesh.normals[3], Vec3f(0, 0, 0));  // no corner says
}

// A vertex whose corners differ a little in their normals gets their mean direction.
TEST(ObjReader, NormalsOfCornersAreAveraged) {
    const auto [mesh, report] = obj(kSquare + "vn 0 0 5\nvn 0.6 0 1.8\nvn 0 0 0\nf 1//1 2//1 3//1\nf 1//2 3//1 4//3\nf 1//3 2//3 3//1\n");
    ASSERT_EQ(mesh.normals.size(), 4u);
    EXPECT_NEAR((mesh.normals[0] - (Vec3f(0, 0, 1) + Vec3f(1, 0, 3).normalized()).normalized()).norm(), 0.0f, 1e-6f);  // 18.4 degrees
    EXPECT_EQ(mesh.normals[1], Vec3f(0, 0, 1));
    EXPECT_EQ(mesh.normals[2], Vec3f(0, 0, 1));
    EXPECT_EQ(mesh.normals[3], Vec3f(0, 0, 0));
}

// Where they differ plainly there is an edge, and one normal for it is none; whatever comes first in the file.
TEST(ObjReader, NormalsOfEdgesAreUnknown) {
    const std::string normals = "vn 0 0 5\nvn 3 0 0\nvn 0 0 -1\n", faces = "f 1//1 2//1 3//1\nf 1//2 3//1 4//3\nf 2//3 3//1 4//3\nf 1//1 3//1 4//3\n";
    for (const std::string& text : {kSquare + normals + faces, faces + kSquare + normals, kSquare + faces + normals}) {
        const TriangleMesh mesh = obj(text).mesh;
        ASSERT_EQ(mesh.normals.size(), 4u) << text;
        EXPECT_EQ(mesh.normals[0], Vec3f(0, 0, 0)) << text;  // at right angles
        EXPECT_EQ(mesh.normals[1], Vec3f(0, 0, 0)) << text;  // opposite
        EXPECT_EQ(mesh.normals[2], Vec3f(0, 0, 1)) << text;
        EXPECT_EQ(mesh.normals[3], Vec3f(0, 0, -1)) << text;
    }
}

TEST(ObjReader, NormalsOfASphereAreKept) {
    const TriangleMesh sphere = sphere_mesh({1, 2, 3}, 2.0, 24);
    std::string text;
    const auto line = [&](const char* keyword, const Vec3d& v) { text += keyword + (" " + std::to_string(v.x())) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) + "\n"; };
    for (const Vec3d& p : sphere.positions) line("v", p);
    for (size_t i = 0; i < sphere.triangles.size(); ++i) {  // each corner's own, 7.5 degrees around the radial one
        std::string face = "f";
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t vertex = sphere.triangles[i][k];
            const Vec3d radial = (sphere.positions[vertex] - Vec3d(1, 2, 3)) / 2.0;
            line("vn", radial + 0.13 * (i % 2 ? 1 : -1) * radial.unitOrthogonal());
            face += " " + std::to_string(vertex + 1) + "//" + std::to_string(3 * i + k + 1);
        }
        text += face + "\n";
    }
    const TriangleMesh mesh = obj(text).mesh;
    ASSERT_EQ(mesh.normals.size(), sphere.positions.size());
    std::vector<bool> used(sphere.positions.size());
    for (const auto& triangle : sphere.triangles)
        for (const uint32_t vertex : triangle) used[vertex] = true;
    for (size_t i = 0; i < mesh.normals.size(); ++i)
        if (used[i]) EXPECT_GT(mesh.normals[i].dot((sphere.positions[i] - Vec3d(1, 2, 3)).normalized().cast<float>()), 0.99f) << i;
}

TEST(ObjReader, ColorsFollowCoordinates) {
    using Color = std::array<uint8_t, 4>;
    const auto unit = obj("v 0 0 0\nv 0 0 1 1 0.5 0\nv 0 1 0 0.2 0.4 0.6 0.8\nf 1 2 3\n").mesh.colors;
    EXPECT_EQ(unit, (std::vector<Color>{{255, 255, 255, 255}, {255, 128, 0, 255}, {51, 102, 153, 204}}));
    EXPECT_EQ(obj("v 0 0 0 255 128 1\n").mesh.colors, (std::vector<Color>{{255, 128, 1, 255}}));
    EXPECT_EQ(obj("v 0 0 0 65535 32896 257\n").mesh.colors, (std::vector<Color>{{255, 128, 1, 255}}));
    EXPECT_EQ(obj("v 0 0 0 nan -5 1\nv 1 1 1\n").mesh.colors, (std::vector<Color>{{0, 0, 255, 255}, {255, 255, 255, 255}}));
}

// What cannot be placed goes, and what hangs on it; the rest keeps its order.
TEST(ObjReader, VerticesThatAreNowhereGoWithTheirTriangles) {
    const auto [mesh, report] = obj("v nan 0 0 0 1 0\nv 0 0 0 1 0 0\nv 1 0 0 0 0 1\nv 1 inf 0 0 1 0\nv 0 1 0 1 1 1\nvn 0 0 1\nf 2//1 3//1 5//1\nf 1 2 3\nf 2 3 4 5\n");
    EXPECT_EQ(mesh.positions, (std::vector<Vec3d>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}));
    EXPECT_EQ(mesh.triangles, (Triangles{{0, 1, 2}}));
    EXPECT_EQ(mesh.normals, std::vector<Vec3f>(3, Vec3f(0, 0, 1)));
    EXPECT_EQ(mesh.colors[1], (std::array<uint8_t, 4>{0, 0, 255, 255}));
    ASSERT_EQ(report.notes.size(), 1u);
    EXPECT_EQ(report.notes[0], "2 vertices without a finite position are left out, and 3 triangles that use them");
}

TEST(ObjReader, DegenerateTrianglesAreLegal) {
    EXPECT_EQ(obj(kSquare + "f 1 1 2\n").mesh.triangles, (Triangles{{0, 0, 1}}));
    const auto [mesh, report] = obj(kSquare + "f 1 2\nf 1\nf\n");
    EXPECT_TRUE(mesh.triangles.empty());
    EXPECT_EQ(report.notes, (std::vector<std::string>{"3 faces with fewer than 3 corners are left out"}));
}

TEST(ObjReader, DamageIsToldByItsLine) {
    EXPECT_EQ(refusal(kSquare + "f 1 2 5\n"), "mesh: line 5: vertex 5 is not among the 4 of the file");
    EXPECT_EQ(refusal(kSquare + "f 1 2 -5\n"), "mesh: line 5: vertex -5 is not among the 4 before this line");
    EXPECT_EQ(refusal(kSquare + "f 0 1 2\n"), "mesh: line 5: vertex 0 is not among the 4 before this line");
    EXPECT_EQ(refusal(kSquare + "f 1//1 2//1 3//1\n"), "mesh: line 5: normal 1 is not among the 0 of the file");
    for (const char* const index : {"4294967296", "9223372036854775807", "-9223372036854775808", "-4294967297"})
        EXPECT_TRUE(refusal(kSquare + "f 1 2 " + index + "\n").starts_with("mesh: line 5: vertex " + std::string(index) + " is not among the 4 ")) << index;
    for (const char* const corner : {"99999999999999999999", "1.5", "x", "1/x", "1//x", "1/2/3/4", "1/2x", "/1", "1 2 3,4"})
        EXPECT_EQ(refusal(kSquare + "f 1 2 " + corner + "\n"), "mesh: line 5: corners such as 1, 1/2, 1//3 or 1/2/3 are expected") << corner;
    EXPECT_EQ(refusal("v 0 0\n"), "mesh: line 1: 3, 4, 6 or 7 numbers are expected, there are 2");
    EXPECT_EQ(refusal("v 0 0 0 1 1\n"), "mesh: line 1: 3, 4, 6 or 7 numbers are expected, there are 5");
    EXPECT_EQ(refusal("v 0 0 0 1 1 1 1 1\n"), "mesh: line 1: at most 7 numbers are expected");
    EXPECT_EQ(refusal("\nv 0,5 0 0\n"), "mesh: line 2: number 1 of the line is none");
    EXPECT_EQ(refusal(kSquare + "vn 0 1\n"), "mesh: line 5: 3 numbers are expected, there are 2");
    EXPECT_EQ(refusal(kSquare + "w 1 2 3\n"), "mesh: line 5: a statement of OBJ is expected, such as v or f");
    EXPECT_EQ(refusal("# nothing\n"), "mesh: no vertices: lines of 'v x y z' are expected");
    EXPECT_EQ(refusal(""), "mesh: no vertices: lines of 'v x y z' are expected");
    EXPECT_EQ(refusal(std::string("v 0 0 0\n\0\0\0\0", 12)), "mesh: line 2: a statement of OBJ is expected, such as v or f");
}

// Under the cap it is read; what the message asks for is enough.
TEST(ObjReader, MemoryIsCapped) {
    std::string text;
    for (int i = 0; i < 10'000; ++i) text += "v " + std::to_string(i) + " 0 0\n";
    for (int i = 0; i < 20'000; ++i) text += "f 1 2 " + std::to_string(1 + i % 10'000) + "\n";
    const uint64_t least = 10'000 * 24 + 20'000 * 12;
    EXPECT_EQ(test::mesh_of(read_obj, text, {.most_bytes = 3 * least}).mesh.triangles.size(), 20'000u);
    const std::string line = test::refusal_of(read_obj, test::bytes_of(text), {.most_bytes = least - 1}, ErrorKind::limit);
    ASSERT_TRUE(line.starts_with("mesh: the mesh needs about ")) << line;
    const uint64_t asked = std::stoull(line.substr(27));
    EXPECT_GE(asked, least);
    EXPECT_EQ(test::mesh_of(read_obj, text, {.most_bytes = asked}).mesh.triangles.size(), 20'000u) << line;
}

}  // namespace
}  // namespace strata
