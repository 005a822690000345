#include "io/mesh/surface_writer.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#ifdef STRATA_TINYGLTF
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_INCLUDE_STB_IMAGE
#define TINYGLTF_NO_INCLUDE_STB_IMAGE_WRITE
#define TINYGLTF_NO_INCLUDE_JSON
#include <tiny_gltf.h>
#endif

#include "core/error.h"
#include "core/surface/surface_report.h"
#include "io/mesh/mesh_reader.h"
#include "io/mesh/ply_header.h"
#include "tests/support/scan_files.h"
#include "tests/support/temporary_folder.h"

namespace strata {
namespace {

using std::numbers::pi;

/// A tube of rings in pieces of a ring each, closed by fans: quads refer to the piece before, a fan to the first one.
struct Tube {
    Vec3d at = Vec3d::Zero();
    double size = 1.0;
    uint32_t around = 12, rings = 9;
    bool one_origin = true;
    uint8_t opacity = 255;  // of the last vertex

    struct Piece {
        Vec3d origin;
        std::vector<Vec3f> positions, normals;
        std::vector<std::array<uint8_t, 4>> colors;
        std::vector<std::array<uint32_t, 3>> triangles;
        std::vector<std::array<uint32_t, 4>> quads;
    };
    std::vector<Piece> pieces() const {
        std::vector<Piece> all(rings + 1);
        for (uint32_t ring = 0; ring < rings; ++ring) {
            Piece& piece = all[ring];
            piece.origin = at + (one_origin ? Vec3d::Zero().eval() : Vec3d(0, 0, size * ring));
            for (uint32_t i = 0; i < around; ++i) {
                const double angle = 2 * pi * i / around;
                piece.positions.emplace_back(float(size * std::cos(angle)), float(size * std::sin(angle)), one_origin ? float(size * ring) : 0.0f);
                piece.normals.emplace_back(float(std::cos(angle)), float(std::sin(angle)), 0.0f);
                piece.colors.push_back({uint8_t(ring * 20), uint8_t(i * 3), uint8_t(255 - ring), 255});
                const auto vertex = [&](uint32_t row, uint32_t column) { return row * around + column % around; };
                if (ring > 0) piece.quads.push_back({vertex(ring - 1, i), vertex(ring - 1, i + 1), vertex(ring, i + 1), vertex(ring, i)});
            }
        }
        Piece& ends = all.back();
        ends.origin = at;
        ends.positions = {{0, 0, 0}, {0, 0, float(size * (rings - 1))}};
        ends.normals = {{0, 0, -1}, {0, 0, 0}};
        ends.colors = {{0, 0, 0, 255}, {255, 255, 255, opacity}};
        for (uint32_t i = 0; i < around; ++i) {
            ends.triangles.push_back({around * rings, (i + 1) % around, i});
            ends.triangles.push_back({around * rings + 1, around * (rings - 1) + i, around * (rings - 1) + (i + 1) % around});
        }
        return all;
    }
    uint64_t vertices() const { return uint64_t{around} * rings + 2; }
    uint64_t quads() const { return uint64_t{around} * (rings - 1); }
    uint64_t triangles() const { return 2 * uint64_t{around} + 2 * quads(); }  // with split quads
    double edge() const { return size * 2 * std::sin(pi / around); }
    Box3d bounds() const { return {.min = at - Vec3d(size, size, 0), .max = at + Vec3d(size, size, size * rings)}; }
};

/// What is written of a tube, and what a file says of itself.
std::vector<std::string> write(const std::string& path, const Tube& tube, bool attributes) {
    MeasuredSurface measured(nullptr, nullptr, 0);
    const auto writer = make_surface_writer(path, {.overwrite = true, .normals = attributes, .colors = attributes, .bounds = tube.bounds(), .edge = tube.edge(),
                                                   .scratch_folder = std::filesystem::path(path).parent_path(), .positions = &measured.positions()});
    measured.set_next(writer.get());
    for (const Tube::Piece& piece : tube.pieces()) {
        SurfacePiece one = {.origin = piece.origin, .positions = piece.positions, .triangles = piece.triangles, .quads = piece.quads};
        if (attributes) one.normals = piece.normals, one.colors = piece.colors;
        measured.add(one);
    }
    const uint64_t bytes = writer->commit(Durability::unsynced);
    EXPECT_EQ(bytes, std::filesystem::file_size(path));
    return writer->notes();
}

Vec3d vertex_of(const std::vector<Tube::Piece>& pieces, const Tube& tube, uint32_t vertex) {
    const Tube::Piece& piece = pieces[vertex / tube.around];
    return piece.origin + piece.positions[vertex % tube.around].cast<double>();
}

// Far from 0, as maps are, and in pieces with origins of their own.
Tube far_tube() { return {.at = Vec3d(500'000.25, 5'300'000.5, 312.125), .size = 0.01, .one_origin = false}; }

class SurfaceFile : public testing::TestWithParam<const char*> {
protected:
    const TemporaryFolder folder_;
    const std::string path_ = folder_.file(std::string("out") + GetParam());
    const bool is_stl_ = std::string(GetParam()) == ".stl", is_obj_ = std::string(GetParam()) == ".obj";
};

TEST_P(SurfaceFile, IsReadBackAsItWas) {
    for (const bool attributes : {false, true}) {
        const Tube tube;
        const std::vector<std::string> notes = write(path_, tube, attributes);
        EXPECT_EQ(notes.size(), is_stl_ && attributes ? 1u : 0u);
        MeshReport said;
        const TriangleMesh mesh = read_mesh(path_, {}, &said);
        EXPECT_TRUE(said.notes.empty());
        ASSERT_EQ(mesh.positions.size(), tube.vertices());
        ASSERT_EQ(mesh.triangles.size(), tube.triangles());
        EXPECT_EQ(said.faces, is_stl_ ? tube.triangles() : 2 * tube.around + tube.quads()) << "quads stay quads";
        const SurfaceReport report = measure_surface(mesh);
        EXPECT_TRUE(report.is_closed());
        EXPECT_EQ(report.euler_characteristic, 2);
        EXPECT_GT(report.volume, 0.0);
        EXPECT_EQ(mesh.normals.empty(), !attributes || is_stl_);
        EXPECT_EQ(mesh.colors.empty(), !attributes || is_stl_);
        if (is_stl_) continue;
        const std::vector<Tube::Piece> pieces = tube.pieces();
        for (uint32_t i = 0; i < tube.vertices(); ++i) {
            EXPECT_LT((mesh.positions[i] - vertex_of(pieces, tube, i)).norm(), 1e-5 * tube.edge()) << i;
            if (!attributes) continue;
            EXPECT_LT((mesh.normals[i] - pieces[i / tube.around].normals[i % tube.around]).norm(), 2e-5) << i;
            EXPECT_EQ(mesh.colors[i], pieces[i / tube.around].colors[i % tube.around]) << i;
        }
    }
}

// A tube of a centimetre at a northing of 5,300 km, where floats are half a metre apart.
TEST_P(SurfaceFile, KeepsCoordinatesOfMapsOrSaysWhatIsLost) {
    const Tube tube = far_tube();
    const std::vector<std::string> notes = write(path_, tube, false);
    const TriangleMesh mesh = read_mesh(path_);
    if (is_stl_) {
        ASSERT_EQ(notes.size(), 1u);
        EXPECT_NE(notes[0].find("up to 0.32 units are lost"), std::string::npos) << notes[0];  // 5.3e6 / 2^24
        return;
    }
    const std::vector<Tube::Piece> pieces = tube.pieces();
    ASSERT_EQ(mesh.positions.size(), tube.vertices());
    for (uint32_t i = 0; i < tube.vertices(); ++i) EXPECT_LT((mesh.positions[i] - vertex_of(pieces, tube, i)).norm(), 1e-5 * tube.edge()) << i;
    EXPECT_NEAR(measure_surface(mesh).volume, 0.01 * 0.01 * 0.01 * 8 * 6 * std::sin(pi / 6), 1e-5 * 3e-6);
}

TEST_P(SurfaceFile, MayBeEmpty) {
    VertexPositions positions(nullptr, 0);
    const auto writer = make_surface_writer(path_, {.normals = true, .scratch_folder = folder_.path(), .positions = &positions});
    const uint64_t bytes = writer->commit(Durability::synced);
    EXPECT_EQ(bytes, std::filesystem::file_size(path_));
    if (is_obj_) {  // any text is such a file, so that one without vertices is not taken for a mesh
        EXPECT_EQ(test::file_contents(path_), "# made by strata\n");
        return;
    }
    const TriangleMesh mesh = read_mesh(path_);
    EXPECT_TRUE(mesh.positions.empty());
    EXPECT_TRUE(mesh.triangles.empty());
}

TEST_P(SurfaceFile, IsWholeOrAbsent) {
    {
        VertexPositions positions(nullptr, 0);
        const auto writer = make_surface_writer(path_, {.scratch_folder = folder_.path(), .positions = &positions});
        writer->add({});
    }
    EXPECT_TRUE(std::filesystem::is_empty(folder_.path())) << "without commit() nothing stays";
    write(path_, Tube(), false);
    VertexPositions positions(nullptr, 0);
    EXPECT_THROW(make_surface_writer(path_, {.scratch_folder = folder_.path(), .positions = &positions}), Error) << "it exists";
}

// One vertex of glass among others: its opacity is kept, or its loss said.
TEST_P(SurfaceFile, KeepsOpacityOrSaysThatItIsLost) {
    const std::vector<std::string> notes = write(path_, {.opacity = 90}, true);
    const TriangleMesh mesh = read_mesh(path_);
    if (is_stl_ || is_obj_) {
        ASSERT_EQ(notes.size(), 1u);
        EXPECT_NE(notes[0].find(is_obj_ ? "OBJ has no opacity" : "STL has no colors"), std::string::npos) << notes[0];
        return;
    }
    EXPECT_TRUE(notes.empty());
    EXPECT_EQ(mesh.colors.back()[3], 90);
    EXPECT_EQ(mesh.colors.front()[3], 255);
}

// What is written of a tube with two attributes, each with a name that no format has, and values that tell the vertex.
std::vector<std::string> write_scalars(const std::string& path, const Tube& tube, const std::vector<std::string>& names, bool unknown) {
    MeasuredSurface measured(nullptr, nullptr, 0);
    const auto writer = make_surface_writer(path, {.overwrite = true, .normals = true, .colors = true, .scalars = names, .bounds = tube.bounds(), .edge = tube.edge(),
                                                   .scratch_folder = std::filesystem::path(path).parent_path(), .positions = &measured.positions()});
    measured.set_next(writer.get());
    uint32_t vertex = 0;
    for (const Tube::Piece& piece : tube.pieces()) {
        std::vector<std::vector<float>> values(names.size());
        for (size_t i = 0; i < piece.positions.size(); ++i, ++vertex)
            for (size_t s = 0; s < names.size(); ++s) values[s].push_back(unknown && vertex % 10 == 3 ? std::numeric_limits<float>::quiet_NaN() : float(vertex) + 0.25f * float(s));
        std::vector<VertexScalars> scalars;
        for (size_t s = 0; s < names.size(); ++s) scalars.push_back({names[s], values[s]});
        measured.add({.origin = piece.origin, .positions = piece.positions, .normals = piece.normals, .colors = piece.colors, .scalars = scalars, .triangles = piece.triangles, .quads = piece.quads});
    }
    const uint64_t bytes = writer->commit(Durability::unsynced);
    EXPECT_EQ(bytes, std::filesystem::file_size(path));
    return writer->notes();
}

TEST_P(SurfaceFile, KeepsAttributesOrSaysThatTheyAreLost) {
    for (const size_t count : {1, 2, 16}) {
        std::vector<std::string> names;
        for (size_t s = 0; s < count; ++s) names.push_back(s == 0 ? "bone density" : s == 1 ? std::string(500, 'w') : "x");
        const Tube tube;
        const std::vector<std::string> notes = write_scalars(path_, tube, names, true);
        const TriangleMesh mesh = read_mesh(path_, {.scalars = true});
        ASSERT_EQ(mesh.positions.size(), is_stl_ ? mesh.positions.size() : tube.vertices());
        if (is_stl_ || is_obj_) {
            ASSERT_FALSE(notes.empty());
            EXPECT_NE(notes.back().find("no attributes of vertices: they are left out"), std::string::npos) << notes.back();
            EXPECT_TRUE(mesh.scalars.empty());
            continue;
        }
        EXPECT_TRUE(notes.empty());
        ASSERT_EQ(mesh.scalars.size(), count);
        EXPECT_EQ(mesh.scalars[0].name, "bone_density");
        if (count > 1) EXPECT_EQ(mesh.scalars[1].name, std::string(72, 'w'));
        if (count > 2) EXPECT_EQ(mesh.scalars[2].name, "x_2") << "x is a coordinate";
        if (count > 3) EXPECT_EQ(mesh.scalars[3].name, "x_3");
        for (size_t s = 0; s < count; ++s)
            for (uint32_t i = 0; i < tube.vertices(); ++i) {
                const float value = mesh.scalars[s].values[i];
                if (i % 10 == 3) EXPECT_TRUE(std::isnan(value)) << s << ' ' << i;
                else EXPECT_EQ(value, float(i) + 0.25f * float(s)) << s << ' ' << i;
            }
        EXPECT_TRUE(measure_surface(mesh).is_closed());
    }
}

INSTANTIATE_TEST_SUITE_P(Formats, SurfaceFile, testing::Values(".ply", ".obj", ".stl"), [](const auto& at) { return std::string(at.param).substr(1); });

TEST(SurfaceNames, EndingsInAnyCaseTellTheFormat) {
    for (const char* const name : {"a.ply", "b.OBJ", "c.Stl", "d.e.glb"}) EXPECT_TRUE(is_surface_name(name)) << name;
    for (const char* const name : {"a", "ply", "a.gltf", ".glb"}) EXPECT_FALSE(is_surface_name(name)) << name;
    EXPECT_THROW(make_surface_writer("a.dae", {}), Error);
}

// Attributes that are called as what the reader knows come back as attributes.
TEST(PlyWriter, NoAttributeIsReadAsSomethingElse) {
    const TemporaryFolder folder;
    const Tube tube;
    const std::vector<std::string> names(ply::kNamesWithMeaning.begin(), ply::kNamesWithMeaning.end());
    write_scalars(folder.file("out.ply"), tube, names, false);
    const TriangleMesh mesh = read_mesh(folder.file("out.ply"), {.scalars = true});
    ASSERT_EQ(mesh.scalars.size(), names.size());
    for (size_t s = 0; s < names.size(); ++s) {
        EXPECT_EQ(mesh.scalars[s].name, names[s] + "_2");
        EXPECT_EQ(mesh.scalars[s].values[7], 7.0f + 0.25f * float(s));
    }
}

// The numbers that a float cannot hold take doubles, others do not.
TEST(PlyWriter, TakesDoublesWhereFloatsLoseThem) {
    const TemporaryFolder folder;
    write(folder.file("near.ply"), Tube(), false);
    EXPECT_NE(test::file_contents(folder.file("near.ply")).find("property float x"), std::string::npos);
    write(folder.file("far.ply"), far_tube(), false);
    EXPECT_NE(test::file_contents(folder.file("far.ply")).find("property double x"), std::string::npos);
}

// Section 4.4 of glTF 2.0, by hand.
TEST(GlbWriter, IsOneFileOfTwoChunks) {
    const TemporaryFolder folder;
    const Tube tube = far_tube();
    write(folder.file("out.glb"), tube, true);
    const std::string file = test::file_contents(folder.file("out.glb"));
    const auto word = [&](size_t at) {
        uint32_t value;
        std::memcpy(&value, file.data() + at, 4);
        return value;
    };
    EXPECT_EQ(file.substr(0, 4), "glTF");
    EXPECT_EQ(word(4), 2u);
    EXPECT_EQ(word(8), file.size());
    EXPECT_EQ(file.substr(16, 4), "JSON");
    const uint32_t json_bytes = word(12);
    EXPECT_EQ(json_bytes % 4, 0u);
    const nlohmann::json document = nlohmann::json::parse(file.substr(20, json_bytes));
    const size_t binary = 20 + json_bytes;
    EXPECT_EQ(file.substr(binary + 4, 4), std::string("BIN\0", 4));
    EXPECT_EQ(word(binary) + binary + 8, file.size());
    EXPECT_EQ(document["buffers"][0]["byteLength"], word(binary));
    EXPECT_EQ(document["accessors"][0]["count"], tube.vertices());
    // The node stands where the first piece does, z turned to y.
    EXPECT_EQ(document["nodes"][0]["translation"], nlohmann::json({500'000.25, 312.125, -5'300'000.5}));
    VertexPositions none(nullptr, 0);
    make_surface_writer(folder.file("empty.glb"), {.scratch_folder = folder.path()})->commit(Durability::unsynced);
    const std::string empty = test::file_contents(folder.file("empty.glb"));
    uint32_t size;
    std::memcpy(&size, empty.data() + 8, 4);
    EXPECT_EQ(size, empty.size());
    EXPECT_EQ(nlohmann::json::parse(empty.substr(20)).count("meshes"), 0u);
}

// Section 3.9.4 of glTF 2.0: the alpha of colors shows only by BLEND or MASK; what is opaque needs no sorting.
TEST(GlbWriter, BlendsWhatCanBeSeenThrough) {
    const TemporaryFolder folder;
    const auto material = [&](const Tube& tube, bool attributes) {
        write(folder.file("out.glb"), tube, attributes);
        const std::string file = test::file_contents(folder.file("out.glb"));
        uint32_t json_bytes;
        std::memcpy(&json_bytes, file.data() + 12, 4);
        return nlohmann::json::parse(file.substr(20, json_bytes))["materials"][0];
    };
    EXPECT_FALSE(material(Tube(), true).contains("alphaMode"));
    EXPECT_FALSE(material({.opacity = 90}, false).contains("alphaMode")) << "no color was written";
    EXPECT_EQ(material({.opacity = 254}, true)["alphaMode"], "BLEND");
    EXPECT_EQ(material({.opacity = 0}, true)["alphaMode"], "BLEND");
}

// Sections 3.6.2.2 and 3.7.2.1 of glTF 2.0: names of attributes of one's own begin with _, and no value is NaN.
TEST(GlbWriter, KeepsAttributesOfVertices) {
    const TemporaryFolder folder;
    const Tube tube;
    std::vector<std::string> names = {"bone density", "x\"\\\n"};
    for (int i = 0; i < 14; ++i) names.emplace_back(100, 'w');  // as long as names may be
    EXPECT_TRUE(write_scalars(folder.file("whole.glb"), tube, names, false).empty());
    const std::vector<std::string> notes = write_scalars(folder.file("out.glb"), tube, names, true);
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_NE(notes[0].find("GLB has no unknown values: 176 of attributes are 0 there"), std::string::npos) << notes[0];  // 110 vertices, 11 of them, 16 times
    const std::string file = test::file_contents(folder.file("out.glb"));
    uint32_t json_bytes;
    std::memcpy(&json_bytes, file.data() + 12, 4);
    const nlohmann::json document = nlohmann::json::parse(file.substr(20, json_bytes));
    const nlohmann::json& attributes = document["meshes"][0]["primitives"][0]["attributes"];
    EXPECT_EQ(attributes.size(), 3u + 16u);
    const nlohmann::json& view = document["bufferViews"][0];
    EXPECT_EQ(view["byteStride"], 12 + 12 + 8 + 16 * 4);
    for (const auto& [name, offset, shift] : {std::tuple("_bone_density", 0u, 0.0f), std::tuple("_x___", 1u, 0.25f)}) {
        ASSERT_TRUE(attributes.contains(name)) << attributes;
        const nlohmann::json& accessor = document["accessors"][attributes[name].get<size_t>()];
        EXPECT_EQ(accessor["type"], "SCALAR");
        EXPECT_EQ(accessor["componentType"], 5126);
        EXPECT_EQ(accessor["count"], tube.vertices());
        EXPECT_EQ(accessor["byteOffset"], 32 + 4 * offset);
        for (uint32_t i = 0; i < tube.vertices(); ++i) {
            float value;
            std::memcpy(&value, file.data() + 20 + json_bytes + 8 + i * 96 + 32 + 4 * offset, 4);
            EXPECT_EQ(value, i % 10 == 3 ? 0.0f : float(i) + shift) << name << ' ' << i;
        }
    }
    EXPECT_THROW(make_surface_writer(folder.file("many.glb"), {.scalars = std::vector<std::string>(61, "a"), .scratch_folder = folder.path()}), Error);
}

// Another program's reader finds the same surface, by way of the node's rotation and translation.
TEST(GlbWriter, IsReadByTinygltf) {
#ifdef STRATA_TINYGLTF
    const TemporaryFolder folder;
    for (const Tube& tube : {Tube(), far_tube()}) {
        write(folder.file("out.glb"), tube, true);
        tinygltf::Model model;
        tinygltf::TinyGLTF loader;
        std::string problem, warning;
        ASSERT_TRUE(loader.LoadBinaryFromFile(&model, &problem, &warning, folder.file("out.glb"))) << problem;
        EXPECT_EQ(problem + warning, "");
        ASSERT_EQ(model.meshes.size(), 1u);
        const tinygltf::Primitive& primitive = model.meshes[0].primitives[0];
        EXPECT_EQ(primitive.mode, TINYGLTF_MODE_TRIANGLES);
        const auto at = [&](int accessor_number, size_t i) {
            const tinygltf::Accessor& accessor = model.accessors[size_t(accessor_number)];
            const tinygltf::BufferView& view = model.bufferViews[size_t(accessor.bufferView)];
            return model.buffers[0].data.data() + view.byteOffset + accessor.byteOffset + i * size_t(accessor.ByteStride(view));
        };
        const auto vector_at = [&](int accessor, size_t i) {
            std::array<float, 3> parts;
            std::memcpy(parts.data(), at(accessor, i), sizeof parts);
            return Vec3f(parts[0], parts[1], parts[2]);
        };
        const tinygltf::Node& node = model.nodes[size_t(model.scenes[0].nodes[0])];
        const Eigen::Quaterniond turn(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
        const Vec3d shift(node.translation[0], node.translation[1], node.translation[2]);
        const int positions = primitive.attributes.at("POSITION"), normals = primitive.attributes.at("NORMAL"), colors = primitive.attributes.at("COLOR_0");
        ASSERT_EQ(model.accessors[size_t(positions)].count, tube.vertices());
        const std::vector<Tube::Piece> pieces = tube.pieces();
        const tinygltf::Accessor& limits = model.accessors[size_t(positions)];
        for (uint32_t i = 0; i < tube.vertices(); ++i) {
            const Vec3f position = vector_at(positions, i);
            for (int axis = 0; axis < 3; ++axis) {
                EXPECT_GE(position[axis], limits.minValues[size_t(axis)]);
                EXPECT_LE(position[axis], limits.maxValues[size_t(axis)]);
            }
            const Vec3d there = turn * position.cast<double>() + shift;  // y is up
            const Vec3d here(there.x(), -there.z(), there.y());
            EXPECT_LT((here - vertex_of(pieces, tube, i)).norm(), 1e-5 * tube.edge()) << i;
            EXPECT_NEAR(vector_at(normals, i).norm(), 1.0f, 1e-6f);
            std::array<uint16_t, 4> color;
            std::memcpy(color.data(), at(colors, i), sizeof color);
            const auto& stored = pieces[i / tube.around].colors[i % tube.around];
            for (size_t k = 0; k < 3; ++k) {
                const double linear = color[k] / 65535.0, srgb = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
                EXPECT_EQ(std::lround(255 * srgb), stored[k]) << i;
            }
        }
        TriangleMesh mesh;
        for (uint32_t i = 0; i < tube.vertices(); ++i) mesh.positions.push_back(vector_at(positions, i).cast<double>());
        ASSERT_EQ(model.accessors[size_t(primitive.indices)].count, 3 * tube.triangles());
        for (size_t i = 0; i < tube.triangles(); ++i) {
            mesh.triangles.emplace_back();
            std::memcpy(mesh.triangles.back().data(), at(primitive.indices, 3 * i), 12);
        }
        EXPECT_TRUE(measure_surface(mesh).is_closed());
        EXPECT_GT(measure_surface(mesh).volume, 0.0);
    }
#else
    GTEST_SKIP() << "tinygltf was not found when this was built";
#endif
}

}  // namespace
}  // namespace strata
