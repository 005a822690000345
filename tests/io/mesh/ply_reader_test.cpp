#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tests/io/mesh/mesh_of.h"

namespace strata {
namespace {

using test::Triangles;
using Bytes = std::vector<std::byte>;

test::MeshOf ply(const Bytes& bytes) { return test::mesh_of(read_ply, bytes); }
test::MeshOf ply(const std::string& text) { return test::mesh_of(read_ply, text); }
std::string refusal(const Bytes& bytes) { return test::refusal_of(read_ply, bytes); }
std::string refusal(const std::string& text) { return test::refusal_of(read_ply, text); }

const std::string kPlace = "property float x\nproperty float y\nproperty float z\n";
const std::string kCorners = "property list uchar int vertex_indices\n";

std::string head(const std::string& encoding, const std::string& elements) {
    return "ply\nformat " + encoding + " 1.0\ncomment by hand\n" + elements + "end_header\n";
}
std::string triangle_head(const std::string& encoding) {
    return head(encoding, "element vertex 3\n" + kPlace + "element face 1\n" + kCorners);
}
const std::string kTriangle = triangle_head("ascii") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

// Appends numbers of either byte order.
struct Data {
    Bytes bytes;
    bool big = false;

    template <typename T>
    Data& put(T value) {
        const size_t at = bytes.size();
        test::put(bytes, value);
        if (big) std::reverse(bytes.begin() + ptrdiff_t(at), bytes.end());
        return *this;
    }
};
Data data_of(const std::string& encoding, const std::string& header) { return {test::bytes_of(header), encoding == "binary_big_endian"}; }

// A triangle of floats, 12 bytes a vertex and 13 a face.
Bytes binary_triangle(const std::string& encoding, uint8_t length = 3, std::array<int32_t, 3> corners = {0, 1, 2}) {
    Data data = data_of(encoding, triangle_head(encoding));
    for (const float part : {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f}) data.put(part);
    data.put(length);
    for (const int32_t corner : corners) data.put(corner);
    return data.bytes;
}

TEST(PlyReader, EveryEncodingSaysTheSame) {
    const std::vector<Vec3d> places = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    for (const auto& [result, format] : {std::pair(ply(kTriangle), "PLY, ASCII"), std::pair(ply(binary_triangle("binary_little_endian")), "PLY, binary little-endian"),
                                         std::pair(ply(binary_triangle("binary_big_endian")), "PLY, binary big-endian")}) {
        EXPECT_EQ(result.mesh.positions, places) << format;
        EXPECT_EQ(result.mesh.triangles, (Triangles{{0, 1, 2}})) << format;
        EXPECT_EQ(result.report.format, format);
        EXPECT_EQ(result.report.faces, 1u);
        EXPECT_TRUE(result.report.notes.empty());
    }
}

// Each type holds its least and greatest value, in x y z of a double-only reader; names old and new.
TEST(PlyReader, EveryTypeOfNumber) {
    for (const std::string encoding : {"binary_little_endian", "binary_big_endian"}) {
        for (const bool newer : {false, true}) {
            const auto elements = [&](const char* first, const char* second, const char* third) {
                return head(encoding, std::string("element vertex 1\nproperty ") + first + " x\nproperty " + second + " y\nproperty " + third + " z\n");
            };
            const auto place = [&](Data data) { return ply(data.bytes).mesh.positions.at(0); };
            EXPECT_EQ(place(data_of(encoding, newer ? elements("int8", "uint8", "int16") : elements("char", "uchar", "short")).put(int8_t{-128}).put(uint8_t{255}).put(int16_t{-32768})),
                      Vec3d(-128, 255, -32768));
            EXPECT_EQ(place(data_of(encoding, newer ? elements("uint16", "int32", "uint32") : elements("ushort", "int", "uint")).put(uint16_t{65535}).put(int32_t{-2147483647 - 1}).put(uint32_t{4294967295})),
                      Vec3d(65535, -2147483648.0, 4294967295.0));
            EXPECT_EQ(place(data_of(encoding, newer ? elements("float32", "float64", "int8") : elements("float", "double", "char")).put(0.1f).put(0.1).put(int8_t{7})),
                      Vec3d(double(0.1f), 0.1, 7));
        }
    }
}

// Vertices with normals, colors and what else there is, in odd order; elements before, between and behind; lists within vertices.
TEST(PlyReader, PropertiesAndElementsInAnyOrder) {
    const std::string elements =
        "element camera 2\nproperty double a\nproperty list uint8 float b\n"
        "element face 2\nproperty uchar material\nproperty list ushort uint vertex_index\nproperty float quality\n"
        "element nothing 3\n"
        "element vertex 3\nproperty uchar blue\nproperty float nz\nproperty double z\nproperty list char short spare\nproperty float nx\nproperty int x\n"
        "property ushort red\nproperty float ny\nproperty float alpha\nproperty float y\nproperty uchar green\n"
        "element edge 1\nproperty int vertex1\nproperty int vertex2\n";
    const auto check = [](const test::MeshOf& result) {
        EXPECT_EQ(result.mesh.positions, (std::vector<Vec3d>{{-5, 0.5, 0.1}, {-4, 1.5, 1.1}, {-3, 2.5, 2.1}}));
        EXPECT_EQ(result.mesh.triangles, (Triangles{{2, 1, 0}, {0, 1, 2}, {0, 2, 1}}));
        EXPECT_EQ(result.mesh.normals, (std::vector<Vec3f>{{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}));
        EXPECT_EQ(result.mesh.colors, (std::vector<std::array<uint8_t, 4>>{{255, 20, 30, 128}, {128, 20, 30, 128}, {0, 20, 30, 128}}));
        EXPECT_EQ(result.report.notes, (std::vector<std::string>{"2 of element camera are left out", "3 of element nothing are left out", "1 of element edge are left out"}));
        EXPECT_EQ(result.report.faces, 2u);
    };
    for (const std::string encoding : {"binary_little_endian", "binary_big_endian"}) {
        Data data = data_of(encoding, head(encoding, elements));
        data.put(1.0).put(uint8_t{2}).put(1.0f).put(2.0f).put(1.0).put(uint8_t{0});
        data.put(uint8_t{9}).put(uint16_t{3}).put(2u).put(1u).put(0u).put(0.5f);
        data.put(uint8_t{9}).put(uint16_t{4}).put(0u).put(1u).put(2u).put(1u).put(0.5f);
        for (int i = 0; i < 3; ++i) {
            data.put(uint8_t{30}).put(3.0f).put(double(i) + 0.1).put(int8_t(i));
            for (int k = 0; k < i; ++k) data.put(int16_t{-1});
            data.put(1.0f).put(int32_t(i - 5)).put(uint16_t(i == 0 ? 65535 : i == 1 ? 32896 : 0)).put(2.0f).put(0.5f).put(float(i) + 0.5f).put(uint8_t{20});
        }
        data.put(int32_t{0}).put(int32_t{1});
        check(ply(data.bytes));
    }
    check(ply(head("ascii", elements) + "1 2 1.5 2.5\n1 0\n9 3 2 1 0 0.5\n9 4 0 1 2 1 0.5\n30 3 0.1 0 1 -5 65535 2 0.5 0.5 20\n"
                                         "30 3 1.1 1 -1 1 -4 32896 2 0.5 1.5 20\n30 3 2.1 2 -1 -1 1 -3 0 2 0.5 2.5 20\n0 1\n"));
}

TEST(PlyReader, TextMayBeLaidOutOddly) {
    std::string windows = kTriangle, mac;
    for (size_t at = 0; (at = windows.find('\n', at)) != std::string::npos; at += 2) windows.insert(at, "\r");
    for (const char c : windows)
        if (c != '\n') mac += c;
    for (const std::string& text : {windows, mac, kTriangle.substr(0, kTriangle.size() - 1), kTriangle + "\n\n",
                                    "ply\n  format\tascii  1.0 \nobj_info x y\n\nelement  vertex 3 \n" + kPlace + " element face 1\n" + kCorners + "end_header\n\n0 0 0 \n\n1 0  0\t\n0 +1 0\n 3 0 1 2 \n"}) {
        const test::MeshOf result = ply(text);
        EXPECT_EQ(result.mesh.triangles, (Triangles{{0, 1, 2}})) << text;
        EXPECT_EQ(result.mesh.positions[2], Vec3d(0, 1, 0)) << text;
    }
    // A header whose lines end in CR LF, then bytes, the first of which is a line end to the eye.
    Data data = data_of("binary_little_endian", "ply\r\nformat binary_little_endian 1.0\r\nelement vertex 1\r\nproperty uchar x\r\nproperty uchar y\r\nproperty uchar z\r\nend_header\r\n");
    EXPECT_EQ(ply(data.put(uint8_t{10}).put(uint8_t{13}).put(uint8_t{0}).bytes).mesh.positions[0], Vec3d(10, 13, 0));
}

TEST(PlyReader, ColorsOfEveryType) {
    const auto color = [](const std::string& type, const std::string& values) {
        return ply(head("ascii", "element vertex 1\n" + kPlace + "property " + type + " red\nproperty " + type + " green\nproperty " + type + " blue\n") + "0 0 0 " + values + "\n").mesh.colors.at(0);
    };
    using Color = std::array<uint8_t, 4>;
    EXPECT_EQ(color("uchar", "0 128 255"), (Color{0, 128, 255, 255}));
    EXPECT_EQ(color("char", "0 -128 -1"), (Color{0, 128, 255, 255}));
    EXPECT_EQ(color("ushort", "0 32896 65535"), (Color{0, 128, 255, 255}));
    EXPECT_EQ(color("float", "0 0.5 1"), (Color{0, 128, 255, 255}));
    EXPECT_EQ(color("double", "-7 nan 1e30"), (Color{0, 0, 255, 255}));
    EXPECT_EQ(color("int", "-7 128 1000"), (Color{0, 128, 255, 255}));
    EXPECT_EQ(ply(head("ascii", "element vertex 1\n" + kPlace + "property uchar diffuse_red\nproperty uchar diffuse_green\nproperty uchar diffuse_blue\n") + "0 0 0 1 2 3\n").mesh.colors.at(0),
              (Color{1, 2, 3, 255}));
    // Two of three are no color, and no normal.
    const auto part = ply(head("ascii", "element vertex 1\n" + kPlace + "property uchar red\nproperty uchar green\nproperty float nx\nproperty float ny\n") + "0 0 0 1 2 3 4\n");
    EXPECT_TRUE(part.mesh.colors.empty());
    EXPECT_TRUE(part.mesh.normals.empty());
}

TEST(PlyReader, PointsAloneAreAMeshWithoutTriangles) {
    const auto [mesh, report] = ply(head("ascii", "element vertex 2\n" + kPlace) + "1 2 3\n4 5 6\n");
    EXPECT_EQ(mesh.positions.size(), 2u);
    EXPECT_TRUE(mesh.triangles.empty());
    EXPECT_EQ(report.faces, 0u);
}

TEST(PlyReader, WhatIsNowhereGoes) {
    const auto [mesh, report] = ply(head("ascii", "element vertex 4\n" + kPlace + "element face 4\n" + kCorners) + "nan 0 0\n0 0 0\n1 0 0\n0 1 0\n3 1 2 3\n3 0 1 2\n2 1 2\n0\n");
    EXPECT_EQ(mesh.positions, (std::vector<Vec3d>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}));
    EXPECT_EQ(mesh.triangles, (Triangles{{0, 1, 2}}));
    EXPECT_EQ(report.notes, (std::vector<std::string>{"1 vertices without a finite position are left out, and 1 triangles that use them", "2 faces with fewer than 3 corners are left out"}));
    const auto normals = ply(head("ascii", "element vertex 1\n" + kPlace + "property float nx\nproperty float ny\nproperty float nz\n") + "0 0 0 nan 0 1\n");
    EXPECT_EQ(normals.mesh.normals.at(0), Vec3f(0, 0, 0));
}

// A cube of six squares stays closed.
TEST(PlyReader, PolygonsBecomeFans) {
    EXPECT_EQ(ply(head("ascii", "element vertex 5\n" + kPlace + "element face 1\n" + kCorners) + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 .5 0\n5 4 0 1 2 3\n").mesh.triangles,
              (Triangles{{4, 0, 1}, {4, 1, 2}, {4, 2, 3}}));
}

TEST(PlyReader, EveryTruncationIsRefused) {
    for (const std::string encoding : {"binary_little_endian", "binary_big_endian"}) {
        const Bytes whole = binary_triangle(encoding);
        ASSERT_EQ(ply(whole).mesh.triangles.size(), 1u);
        for (size_t size = 0; size < whole.size(); ++size) EXPECT_NE(refusal(Bytes(whole.begin(), whole.begin() + ptrdiff_t(size))), "") << size;
    }
    // Without the last digit or behind it is where text does not tell.
    for (size_t size = 0; size + 2 < kTriangle.size(); ++size) EXPECT_NE(refusal(kTriangle.substr(0, size)), "") << size;
}

TEST(PlyReader, HeadersThatLieAreRefused) {
    const auto damaged = [](const std::string& from, const std::string& to) {
        std::string text = kTriangle;
        return refusal(text.replace(text.find(from), from.size(), to));
    };
    const size_t data = kTriangle.size() - 26;
    const auto at = [&](size_t longer) { return "mesh: byte " + std::to_string(data + longer); };
    EXPECT_EQ(damaged("vertex 3", "vertex 4000000000"), at(9) + ": the header counts 4000000000 of element vertex, at least 6 bytes each, 27 are left");
    EXPECT_EQ(damaged("vertex 3", "vertex 18446744073709551615"), at(19) + ": the header counts 18446744073709551615 of element vertex, at least 6 bytes each, 27 are left");
    EXPECT_EQ(damaged("face 1", "face 3074457345618258603"), at(18) + ": the header counts 3074457345618258603 of element face, at least 2 bytes each, 9 are left");
    EXPECT_EQ(damaged("vertex 3", "vertex 18446744073709551616"), "mesh: line 4: an element's name and count are expected");
    EXPECT_EQ(damaged("vertex 3", "vertex -3"), "mesh: line 4: an element's name and count are expected");
    EXPECT_EQ(damaged("vertex 3", "vertex 3.5"), "mesh: line 4: an element's name and count are expected");
    EXPECT_EQ(damaged("vertex 3", "vertex"), "mesh: line 4: an element's name and count are expected");
    EXPECT_EQ(damaged("vertex 3", "vortex 3"), "mesh: header: an element vertex is expected");
    EXPECT_EQ(damaged("element face", "element vertex"), "mesh: header: one element vertex is expected");
    EXPECT_EQ(damaged("float z", "float w"), "mesh: header: properties x, y and z of element vertex are expected");
    EXPECT_EQ(damaged("float z", "float y"), "mesh: header: one property y is expected");
    EXPECT_EQ(damaged("float z", "flout z"), "mesh: line 7: a type is expected, such as uchar, int or float");
    EXPECT_EQ(damaged("float z", "float"), "mesh: line 7: a property's name is expected");
    EXPECT_EQ(damaged("uchar int vertex_indices", "float int vertex_indices"), "mesh: line 9: a list's length is expected to be an integer");
    EXPECT_EQ(damaged("uchar int vertex_indices", "uchar float vertex_indices"), "mesh: header: indices are expected to be integers");
    EXPECT_EQ(damaged("vertex_indices", "corners"), "mesh: header: one list vertex_indices or vertex_index of element face is expected");
    EXPECT_EQ(damaged("ascii", "text"), "mesh: line 2: format ascii, binary_little_endian or binary_big_endian is expected");
    EXPECT_EQ(damaged("1.0", "2.0"), "mesh: line 2: version 1.0 is expected");
    EXPECT_EQ(damaged("format ascii 1.0\n", ""), "mesh: line 9: a line 'format ...' is expected before the header's end");
    EXPECT_EQ(damaged("element vertex 3\n", ""), "mesh: line 4: format, element, property, comment or end_header is expected");
    EXPECT_EQ(damaged("end_header\n", ""), "mesh: line 10: format, element, property, comment or end_header is expected");
    EXPECT_EQ(refusal("ply\n"), "mesh: line 2: the file ends in its header, 'end_header' is expected");
    EXPECT_EQ(refusal("plx\n"), "mesh: line 1: 'ply' is expected");
}

TEST(PlyReader, DataThatLieAreRefused) {
    const auto damaged = [](const std::string& from, const std::string& to) {
        std::string text = kTriangle;
        return refusal(text.replace(text.rfind(from), from.size(), to));
    };
    EXPECT_EQ(damaged("3 0 1 2", "3 0 1 3"), "mesh: line 14: vertex 3 is not among the 3 of the file, which count from 0");
    EXPECT_EQ(damaged("3 0 1 2", "3 0 1 -1"), "mesh: line 14: vertex -1 is not among the 3 of the file, which count from 0");
    EXPECT_EQ(damaged("3 0 1 2", "3 0 1 2.5"), "mesh: line 14: an integer is expected");
    EXPECT_EQ(damaged("3 0 1 2", "4 0 1 2"), "mesh: line 14: an integer is expected");
    EXPECT_EQ(damaged("3 0 1 2", "2 0 1 2"), "mesh: line 14: more values than the header's properties");
    EXPECT_EQ(damaged("3 0 1 2", "-3 0 1 2"), "mesh: line 14: a list of -3 values");
    EXPECT_EQ(damaged("3 0 1 2", "9000000000000000000 0 1 2"), "mesh: line 14: an integer is expected");
    EXPECT_EQ(damaged("0 1 0", "0 1"), "mesh: line 13: a number is expected");
    EXPECT_EQ(damaged("0 1 0", "0 1,5 0"), "mesh: line 13: a number is expected");
    EXPECT_EQ(damaged("0 1 0\n", ""), "mesh: line 13: more values than the header's properties");
    EXPECT_EQ(damaged("3 0 1 2\n", "\n"), "mesh: line 15: the file ends, more elements are expected");
    EXPECT_EQ(refusal(kTriangle + "3 0 1 2\n"), "mesh: line 15: the file's end is expected behind the last element");
    for (const std::string encoding : {"binary_little_endian", "binary_big_endian"}) {
        const size_t end = triangle_head(encoding).size() + 36;
        const std::string at = "mesh: byte " + std::to_string(end + 1) + ": ";
        EXPECT_EQ(refusal(binary_triangle(encoding, 255)), at + "a list of 255 values of 4 bytes is beyond the 12 bytes left");
        EXPECT_TRUE(refusal(binary_triangle(encoding, 2)).find("the file's end is expected behind the last element") != std::string::npos);
        EXPECT_TRUE(refusal(binary_triangle(encoding, 3, {0, 1, 3})).find("vertex 3 is not among the 3") != std::string::npos);
        EXPECT_TRUE(refusal(binary_triangle(encoding, 3, {0, -2147483647, 2})).find("vertex -2147483647 is not") != std::string::npos);
        Bytes padded = binary_triangle(encoding);
        padded.push_back(std::byte{'\n'});
        EXPECT_EQ(ply(padded).mesh.triangles.size(), 1u);
    }
    // Lengths of four bytes, too.
    const std::string wide = head("binary_little_endian", "element vertex 1\nproperty char x\nproperty char y\nproperty char z\nproperty list int double far\n");
    for (const int32_t length : {-1, 1 << 28, 0x7FFFFFFF}) {
        Data data = data_of("", wide);
        EXPECT_NE(refusal(data.put(int8_t{0}).put(int8_t{0}).put(int8_t{0}).put(length).bytes), "") << length;
    }
}

// Each type of number becomes a float, in the order of the file; what has a place of its own, lists and texture coordinates are none of them.
TEST(PlyReader, KeepsOtherValuesWhereAskedTo) {
    const std::string elements = "element vertex 2\n" + kPlace + "property double height\nproperty uchar red\nproperty float u\nproperty char a\nproperty uchar b\nproperty short c\n"
                                 "property ushort d\nproperty int e\nproperty uint f\nproperty list uchar int near\nproperty float height\nproperty float NaN\n";
    for (const std::string encoding : {"ascii", "binary_little_endian", "binary_big_endian"}) {
        Data data = data_of(encoding, head(encoding, elements));
        if (encoding == "ascii") {
            data.bytes = test::bytes_of(head(encoding, elements) + "0 0 0 0.5 9 9 -1 255 -32768 65535 -2147483648 4294967295 1 7 8 nan\n1 1 1 -2 9 9 1 2 3 4 5 6 0 8 3\n");
        } else {
            for (int i = 0; i < 3; ++i) data.put(0.0f);
            data.put(0.5).put(uint8_t{9}).put(9.0f).put(int8_t{-1}).put(uint8_t{255}).put(int16_t{-32768}).put(uint16_t{65535}).put(int32_t{-2147483647 - 1}).put(uint32_t{4294967295});
            data.put(uint8_t{1}).put(int32_t{7}).put(8.0f).put(std::numeric_limits<float>::quiet_NaN());
            for (int i = 0; i < 3; ++i) data.put(1.0f);
            data.put(-2.0).put(uint8_t{9}).put(9.0f).put(int8_t{1}).put(uint8_t{2}).put(int16_t{3}).put(uint16_t{4}).put(int32_t{5}).put(uint32_t{6}).put(uint8_t{0}).put(8.0f).put(3.0f);
        }
        EXPECT_TRUE(test::mesh_of(read_ply, data.bytes).mesh.scalars.empty()) << encoding;
        const TriangleMesh mesh = test::mesh_of(read_ply, data.bytes, {.scalars = true}).mesh;
        const std::vector<std::pair<std::string, std::array<float, 2>>> expected = {
            {"height", {0.5f, -2.0f}}, {"a", {-1, 1}}, {"b", {255, 2}}, {"c", {-32768, 3}}, {"d", {65535, 4}}, {"e", {-2147483648.0f, 5}}, {"f", {4294967296.0f, 6}}};
        ASSERT_EQ(mesh.scalars.size(), expected.size() + 1) << encoding;
        for (size_t i = 0; i < expected.size(); ++i) {
            EXPECT_EQ(mesh.scalars[i].name, expected[i].first) << encoding;
            EXPECT_EQ(mesh.scalars[i].values, std::vector<float>(expected[i].second.begin(), expected[i].second.end())) << encoding << ' ' << expected[i].first;
        }
        EXPECT_TRUE(std::isnan(mesh.scalars.back().values[0]));
        EXPECT_EQ(mesh.scalars.back().values[1], 3.0f);
    }
}

TEST(PlyReader, OtherValuesAreBoundedAndLeaveWithTheirVertices) {
    std::string elements = "element vertex 3\n" + kPlace, row;
    for (int i = 0; i < 40; ++i) {
        elements += "property uchar p" + std::to_string(i) + '\n';
        row += ' ' + std::to_string(i);
    }
    const std::string text = head("ascii", elements) + "0 0 0" + row + "\nnan 0 0" + row + "\n1 0 0" + row + '\n';
    const test::MeshOf result = test::mesh_of(read_ply, text, {.scalars = true});
    ASSERT_EQ(result.mesh.scalars.size(), 32u);
    EXPECT_EQ(result.mesh.scalars.back().name, "p31");
    EXPECT_EQ(result.mesh.scalars.back().values, (std::vector<float>{31, 31}));
    ASSERT_EQ(result.report.notes.size(), 2u);
    EXPECT_EQ(result.report.notes[0], "8 properties of vertices beyond the first 32 are left out");
    // 24 bytes a place and 4 a value are counted before they are taken.
    EXPECT_EQ(test::refusal_of(read_ply, test::bytes_of(text), {.most_bytes = 455, .scalars = true}, ErrorKind::limit), "mesh: the mesh needs 456 bytes of memory, 455 are allowed");
}

// Counts say what is needed before anything is taken.
TEST(PlyReader, MemoryIsCapped) {
    std::string text = head("ascii", "element vertex 1000\n" + kPlace + "element face 2000\n" + kCorners);
    for (int i = 0; i < 1000; ++i) text += "0 0 0\n";
    for (int i = 0; i < 2000; ++i) text += "3 0 1 2\n";
    EXPECT_EQ(test::mesh_of(read_ply, text, {.most_bytes = 48'000}).mesh.triangles.size(), 2000u);
    EXPECT_EQ(test::refusal_of(read_ply, test::bytes_of(text), {.most_bytes = 47'999}, ErrorKind::limit), "mesh: the mesh needs 48000 bytes of memory, 47999 are allowed");
}

}  // namespace
}  // namespace strata
