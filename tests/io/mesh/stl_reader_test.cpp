#include <cstring>
#include <limits>

#include "tests/io/mesh/mesh_of.h"

namespace strata {
namespace {

using test::Triangles;
using Bytes = std::vector<std::byte>;
using Facet = std::array<float, 9>;

test::MeshOf stl(const Bytes& bytes) { return test::mesh_of(read_stl, bytes); }
test::MeshOf stl(const std::string& text) { return test::mesh_of(read_stl, text); }
std::string refusal(const Bytes& bytes) { return test::refusal_of(read_stl, bytes); }
std::string refusal(const std::string& text) { return test::refusal_of(read_stl, text); }

Bytes binary(const std::vector<Facet>& facets, std::string head = "made by hand", uint16_t word = 0) {
    head.resize(80);
    Bytes bytes = test::bytes_of(head);
    test::put(bytes, uint32_t(facets.size()));
    for (const Facet& facet : facets) {
        for (int i = 0; i < 3; ++i) test::put(bytes, 0.0f);
        for (const float part : facet) test::put(bytes, part);
        test::put(bytes, word);
    }
    return bytes;
}

// Two triangles that share an edge, one of whose ends has a zero of either sign.
const std::vector<Facet> kTwo = {{0, 0, 0, 1, 0, 0, 0, 1, 0}, {1, 0, -0.0f, 1, 1, 0, 0, 1, 0}};
const Triangles kShared = {{0, 1, 2}, {1, 3, 2}};

std::string text_facet(const std::string& a, const std::string& b, const std::string& c) {
    return "facet normal 0 0 1\n outer loop\n  vertex " + a + "\n  vertex " + b + "\n  vertex " + c + "\n endloop\nendfacet\n";
}
const std::string kText = "solid two words\n" + text_facet("0 0 0", "1 0 0", "0 1 0") + text_facet("1 0 -0", "1 1 0", "0 1 0") + "endsolid two words\n";

TEST(StlReader, CornersAtOnePlaceAreOneVertex) {
    for (const auto& [mesh, report] : {stl(binary(kTwo)), stl(kText)}) {
        EXPECT_EQ(mesh.triangles, kShared);
        EXPECT_EQ(mesh.positions, (std::vector<Vec3d>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}));
        EXPECT_EQ(report.faces, 2u);
        EXPECT_TRUE(report.notes.empty());
    }
    EXPECT_EQ(stl(binary(kTwo)).report.format, "STL, binary");
    EXPECT_EQ(stl(kText).report.format, "STL, ASCII");
}

// A grid of (n + 1)^2 places, each of up to six corners.
TEST(StlReader, ManyCornersAreShared) {
    constexpr int kSide = 300;
    std::vector<Facet> facets;
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            const float a = float(x) / 7, b = float(y) / 7, c = float(x + 1) / 7, d = float(y + 1) / 7;
            facets.push_back({a, b, 0, c, b, 0, c, d, 0});
            facets.push_back({a, b, 0, c, d, 0, a, d, 0});
        }
    const auto [mesh, report] = stl(binary(facets));
    ASSERT_EQ(mesh.positions.size(), size_t((kSide + 1) * (kSide + 1)));
    ASSERT_EQ(mesh.triangles.size(), facets.size());
    for (size_t i = 0; i < facets.size(); ++i)
        for (size_t k = 0; k < 3; ++k)
            ASSERT_EQ(mesh.positions[mesh.triangles[i][k]], Vec3d(facets[i][3 * k], facets[i][3 * k + 1], facets[i][3 * k + 2]));
}

// Many binary files begin like ASCII ones, and attribute words mean something to some programs.
TEST(StlReader, TheSizeTellsBinaryFromText) {
    EXPECT_EQ(stl(binary(kTwo, "solid by a program")).mesh.triangles, kShared);
    EXPECT_EQ(stl(binary(kTwo, "COLOR=\1\2\3\4,MATERIAL=", 0xFFFF)).mesh.triangles, kShared);
    EXPECT_EQ(stl(binary({}, "solid")).mesh.triangles.size(), 0u);
    Bytes padded = binary(kTwo);
    padded.resize(padded.size() + 49);
    EXPECT_EQ(stl(padded).mesh.triangles, kShared);
}

TEST(StlReader, TextIsWordsInAnyLayout) {
    EXPECT_EQ(stl("SOLID\nFACET NORMAL 0 0 1 OUTER LOOP VERTEX 0 0 0 VERTEX 1 0 0\r\nVERTEX 0 1\n0 ENDLOOP ENDFACET\nEndSolid").mesh.triangles, (Triangles{{0, 1, 2}}));
    EXPECT_EQ(stl("solid a\nendsolid a\n").mesh.triangles.size(), 0u);
    EXPECT_EQ(stl("solid facet vertex\n" + text_facet("0 0 0", "1 0 0", "0 1 0") + "endsolid b\n\n solid c\n" + text_facet("1 0 0", "1 1 0", "0 1 0") + "endsolid\n").mesh.triangles,
              kShared);
    EXPECT_EQ(stl("solid n\n" + text_facet("0.1 1e-3 +5", "-1.5E2 0 0", "0 1 0") + "endsolid").mesh.positions[0], Vec3d(0.1, 0.001, 5));
    std::string nan = kText;
    nan.replace(nan.find("0 0 1"), 5, "nan -nan 1.#QNAN");  // normals of slivers
    EXPECT_EQ(stl(nan).mesh.triangles, kShared);
}

TEST(StlReader, TrianglesThatAreNowhereGo) {
    std::vector<Facet> facets = kTwo;
    facets.push_back({0, 0, 0, 1, 0, 0, 0, std::numeric_limits<float>::quiet_NaN(), 0});
    facets.push_back({std::numeric_limits<float>::infinity(), 0, 0, 1, 0, 0, 0, 1, 7});
    const std::vector<std::string> notes = {"2 triangles without a finite position at each corner are left out"};
    const auto [mesh, report] = stl(binary(facets));
    EXPECT_EQ(mesh.triangles, kShared);
    EXPECT_EQ(mesh.positions.size(), 4u);
    EXPECT_EQ(report.notes, notes);
    std::string text = kText;
    text.insert(text.find("endsolid"), text_facet("nan 0 0", "0 0 1", "0 0 2") + text_facet("1e999 0 0", "0 0 1", "0 0 2"));
    EXPECT_EQ(stl(text).report.notes, notes);
    EXPECT_EQ(stl(binary({{1, 1, 1, 1, 1, 1, 1, 1, 1}})).mesh.triangles, (Triangles{{0, 0, 0}}));  // one point, thrice: legal
}

TEST(StlReader, CountsThatLieAreRefused) {
    const auto with_count = [](uint32_t count, size_t size) {
        Bytes bytes = binary(kTwo);
        std::memcpy(bytes.data() + 80, &count, sizeof count);
        bytes.resize(size);
        return bytes;
    };
    EXPECT_EQ(refusal(with_count(3, 184)), "mesh: byte 84: the header counts 3 triangles, which are 150 bytes; 100 are left");
    EXPECT_EQ(refusal(with_count(0xFFFFFFFF, 184)), "mesh: byte 84: the header counts 4294967295 triangles, which are 214748364750 bytes; 100 are left");
    EXPECT_EQ(refusal(with_count(1, 184)), "mesh: byte 84: the header counts 1 triangles, which are 50 bytes; 100 are left");
    EXPECT_EQ(refusal(with_count(0, 184)), "mesh: byte 84: the header counts 0 triangles, which are 0 bytes; 100 are left");
    EXPECT_EQ(refusal(Bytes(3)), "mesh: byte 0: 84 bytes needed, 3 left");
}

TEST(StlReader, EveryTruncationIsRefused) {
    const Bytes whole = binary(kTwo);
    for (size_t size = 0; size < whole.size(); ++size) EXPECT_NE(refusal(Bytes(whole.begin(), whole.begin() + ptrdiff_t(size))), "") << size;
    // 'endsolid' is the last word that must be there.
    const size_t end = kText.rfind("endsolid") + 8;
    for (size_t size = 0; size < end; ++size) EXPECT_NE(refusal(kText.substr(0, size)), "") << size;
    EXPECT_EQ(stl(kText.substr(0, end)).mesh.triangles, kShared);
}

TEST(StlReader, DamagedTextIsToldByItsLine) {
    const auto damaged = [](const std::string& from, const std::string& to) {
        std::string text = kText;
        return refusal(text.replace(text.find(from), from.size(), to));
    };
    EXPECT_EQ(damaged("normal", "nurmal"), "mesh: line 2: 'normal' is expected");
    EXPECT_EQ(damaged("outer", "inner"), "mesh: line 3: 'outer' is expected");
    EXPECT_EQ(damaged("vertex 1 0 0", "vertex 1 0"), "mesh: line 6: a number is expected");
    EXPECT_EQ(damaged("vertex 1 0 0", "vertex 1,0 0 0"), "mesh: line 5: a number is expected");
    EXPECT_EQ(damaged(" endloop", " vertex 0 0 0\n endloop"), "mesh: line 7: 'endloop' is expected");
    EXPECT_EQ(damaged("facet", "fucet"), "mesh: line 2: 'facet' or 'endsolid' is expected");
    EXPECT_EQ(refusal(kText + text_facet("0 0 0", "0 0 0", "0 0 0")), "mesh: line 17: 'solid' is expected, or the file's end");
    EXPECT_EQ(refusal(kText.substr(0, kText.find("endsolid"))), "mesh: line 16: the file ends within a solid, 'endsolid' is expected");
}

TEST(StlReader, MemoryIsCapped) {
    std::vector<Facet> facets;
    for (int i = 0; i < 10'000; ++i) facets.push_back({float(i), 0, 0, float(i), 1, 0, float(i), 0, 1});
    const Bytes bytes = binary(facets);
    const uint64_t least = 10'000 * 12 + 30'000 * 24;
    const std::string early = test::refusal_of(read_stl, bytes, {.most_bytes = 100'000}, ErrorKind::limit);
    EXPECT_TRUE(early.starts_with("mesh: the mesh needs ")) << early;
    const std::string line = test::refusal_of(read_stl, bytes, {.most_bytes = least}, ErrorKind::limit);
    ASSERT_TRUE(line.starts_with("mesh: the mesh needs about ")) << line;
    EXPECT_EQ(test::mesh_of(read_stl, bytes, {.most_bytes = std::stoull(line.substr(27))}).mesh.positions.size(), 30'000u) << line;
}

TEST(StlReader, TellsBinaryFilesByTheirSize) {
    const Bytes bytes = binary(kTwo);
    const std::string_view head(reinterpret_cast<const char*>(bytes.data()), 84);
    EXPECT_TRUE(is_binary_stl(head, 184));
    EXPECT_FALSE(is_binary_stl(head, 185));
    EXPECT_FALSE(is_binary_stl(head.substr(0, 83), 184));
}

}  // namespace
}  // namespace strata
