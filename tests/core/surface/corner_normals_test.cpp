#include "core/surface/corner_normals.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "core/math/random.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

Vec3f normal_of(const TriangleMesh& mesh, size_t triangle) {
    const auto& [a, b, c] = mesh.triangles[triangle];
    return (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).normalized().cast<float>();
}

TEST(CornerNormals, PackingKeepsDirections) {
    Random random(1);
    for (int i = 0; i < 20000; ++i) {
        Vec3f n(float(random.normal()), float(random.normal()), float(random.normal()));
        if (i % 7 == 0) n[i % 3] = 0.0f;
        if (i % 11 == 0) n = Vec3f::Unit(i % 3) * (i % 2 == 0 ? 1.0f : -1.0f);
        n.normalize();
        const uint32_t packed = pack_normal(n);
        EXPECT_NE(packed, kNoNormal);
        EXPECT_LT((unpack_normal(packed) - n).norm(), 1e-4f);
        EXPECT_NEAR(unpack_normal(packed).norm(), 1.0f, 1e-6f);
    }
    EXPECT_TRUE(unpack_normal(pack_normal(Vec3f::Zero())).allFinite());
}

// The edges of a box stay edges, whichever way its triangles turn.
TEST(CornerNormals, OfABoxAreThoseOfItsFaces) {
    TriangleMesh mesh = box_mesh({5e5, 5e6, 10}, {1, 2, 3}, Eigen::AngleAxisd(0.4, Vec3d(1, 2, 3).normalized()).toRotationMatrix());
    for (size_t i = 0; i < mesh.triangles.size(); i += 3) std::swap(mesh.triangles[i][0], mesh.triangles[i][1]);
    const std::vector<uint32_t> corners = corner_normals(mesh, 1);
    ASSERT_EQ(corners.size(), 3 * mesh.triangles.size());
    for (size_t i = 0; i < corners.size(); ++i) EXPECT_LT((unpack_normal(corners[i]) - normal_of(mesh, i / 3)).norm(), 1e-4f) << i;
}

// Of a closed surface with symmetric triangles around each vertex they are those of the sphere; else within the angle of a triangle's side.
TEST(CornerNormals, OfASphereAreRadial) {
    for (const uint32_t n : {8u, 32u}) {
        const Vec3d center(3, -2, 7);
        const TriangleMesh mesh = sphere_mesh(center, 2.0, n);
        const std::vector<uint32_t> corners = corner_normals(mesh, 2);
        for (size_t i = 0; i < corners.size(); ++i) {
            const Vec3f radial = (mesh.positions[mesh.triangles[i / 3][i % 3]] - center).normalized().cast<float>();
            EXPECT_GT(unpack_normal(corners[i]).dot(radial), std::cos(0.6 * M_PI / n)) << i;
        }
    }
}

// Stored normals count where they can be those of the triangle, on its side; a vertex of a box has one for three faces.
TEST(CornerNormals, StoredOnesAreTakenWhereTheyFit) {
    TriangleMesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 5}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 1}, {0, 0, 1}};
    const Vec3f tilted = Vec3f(0.1f, 0.2f, 1.0f).normalized();
    mesh.normals = {3.0f * tilted, Vec3f(1, 0, 0), Vec3f::Zero(), Vec3f(1, 0, 0)};
    const std::vector<uint32_t> corners = corner_normals(mesh, 1);
    EXPECT_LT((unpack_normal(corners[0]) - tilted).norm(), 1e-4f);
    EXPECT_LT((unpack_normal(corners[3]) + tilted).norm(), 1e-4f);  // turned the other way
    EXPECT_LT((unpack_normal(corners[1]) - Vec3f::UnitZ()).norm(), 1e-4f);  // too far off
    EXPECT_LT((unpack_normal(corners[2]) - Vec3f::UnitZ()).norm(), 1e-4f);  // unknown
    EXPECT_EQ(corners[6], kNoNormal);  // no area
    EXPECT_EQ(corners[7], kNoNormal);
}

// Normals of vertices that some program made of the triangles around them say nothing of a box, coarse or fine, or of a wedge.
TEST(CornerNormals, MeansOfTheTrianglesLeaveEdges) {
    TriangleMesh wedge = box_mesh({0, 0, 0}, {1, 1, 1});
    for (size_t i = 4; i < 8; ++i) wedge.positions[i].y() *= 0.3;
    TriangleMesh fine;  // a box of 4 x 4 squares a side
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-1.0, 1.0})
            append(fine, grid_mesh(5, 5, false, false, [&](uint32_t i, uint32_t j) {
                       Vec3d p;
                       p[axis] = side, p[(axis + 1) % 3] = i / 2.0 - 1.0, p[(axis + 2) % 3] = side * (j / 2.0 - 1.0);
                       return p;
                   }));
    for (auto& t : fine.triangles)
        for (uint32_t& vertex : t)  // the first at each place
            vertex = uint32_t(std::find(fine.positions.begin(), fine.positions.end(), fine.positions[vertex]) - fine.positions.begin());
    for (TriangleMesh mesh : {box_mesh({5e5, 5e6, 10}, {1, 2, 3}), fine, wedge})
        for (const char* const weight : {"angle", "area", "none"}) {
            mesh.normals.assign(mesh.positions.size(), Vec3f::Zero());
            for (size_t i = 0; i < mesh.triangles.size(); ++i)
                for (size_t k = 0; k < 3; ++k) {
                    const auto& t = mesh.triangles[i];
                    const Vec3d &p = mesh.positions[t[k]], u = mesh.positions[t[(k + 1) % 3]] - p, v = mesh.positions[t[(k + 2) % 3]] - p;
                    const double angle = std::atan2(u.cross(v).norm(), u.dot(v)), area = u.cross(v).norm();
                    mesh.normals[t[k]] += float(weight[1] == 'n' ? angle : weight[1] == 'r' ? area : 1.0) * normal_of(mesh, i);
                }
            for (Vec3f& normal : mesh.normals) normal = ((normal.normalized() * 1000.0f).array().round() / 1000.0f).matrix();  // as text has it
            const std::vector<uint32_t> corners = corner_normals(mesh, 1);
            for (size_t i = 0; i < corners.size(); ++i) EXPECT_LT((unpack_normal(corners[i]) - normal_of(mesh, i / 3)).norm(), 1e-4f) << weight << ' ' << i;
        }
}

// A tube of three sides, whose normals are those of the round one that it stands for, a little wider at one end: 60 degrees off its sides.
TEST(CornerNormals, StoredOnesOfThinPartsAreTaken) {
    TriangleMesh mesh;
    for (uint32_t i = 0; i < 6; ++i) {
        const double angle = 2.0 * M_PI * (i / 2) / 3.0;
        mesh.normals.push_back(Vec3f(float(std::cos(angle)), float(std::sin(angle)), 0.05f).normalized());
        mesh.positions.push_back(Vec3d(std::cos(angle), std::sin(angle), i % 2));
    }
    for (uint32_t i = 0; i < 6; i += 2) {
        mesh.triangles.push_back({i, (i + 2) % 6, i + 1});
        mesh.triangles.push_back({i + 1, (i + 2) % 6, (i + 3) % 6});
    }
    const std::vector<uint32_t> corners = corner_normals(mesh, 1);
    for (size_t i = 0; i < corners.size(); ++i) {
        const Vec3f& stored = mesh.normals[mesh.triangles[i / 3][i % 3]];
        EXPECT_NEAR(stored.dot(normal_of(mesh, i / 3)), 0.5f, 1e-3f);
        EXPECT_LT((unpack_normal(corners[i]) - stored).norm(), 1e-4f) << i;
    }
}

// More triangles at a vertex than are compared with each other: a cone stays round at its foot and its tip is no direction of one side.
TEST(CornerNormals, ManyTrianglesAtAVertexAreBounded) {
    constexpr uint32_t kSides = 200000;
    TriangleMesh mesh;
    mesh.positions.push_back({0, 0, 0.1});
    for (uint32_t i = 0; i < kSides; ++i) mesh.positions.push_back({std::cos(2 * M_PI * i / kSides), std::sin(2 * M_PI * i / kSides), 0});
    for (uint32_t i = 0; i < kSides; ++i) mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % kSides});
    const std::vector<uint32_t> corners = corner_normals(mesh, 2);
    EXPECT_LT((unpack_normal(corners[0]) - Vec3f::UnitZ()).norm(), 1e-4f);
    EXPECT_GT(unpack_normal(corners[1]).dot(normal_of(mesh, 0)), 0.9999f);
    // A steep one's sides keep their own.
    mesh.positions[0] = {0, 0, 3};
    const std::vector<uint32_t> steep = corner_normals(mesh, 2);
    EXPECT_GT(unpack_normal(steep[0]).dot(normal_of(mesh, 0)), 0.9999f);
}

TEST(CornerNormals, DoNotDependOnThreads) {
    Random random(5);
    TriangleMesh mesh;
    for (int i = 0; i < 30000; ++i) mesh.positions.push_back({random.normal(), random.normal(), random.normal()});
    for (int i = 0; i < 90000; ++i) {
        std::array<uint32_t, 3> t;
        for (uint32_t& vertex : t) vertex = uint32_t(random.bits() % mesh.positions.size());
        mesh.triangles.push_back(t);
    }
    const std::vector<uint32_t> one = corner_normals(mesh, 1);
    EXPECT_EQ(one, corner_normals(mesh, 4));
    for (const uint32_t packed : one)
        if (packed != kNoNormal) ASSERT_NEAR(unpack_normal(packed).norm(), 1.0f, 1e-5f);
}

TEST(CornerNormals, NothingGivesNothing) { EXPECT_TRUE(corner_normals({}, 2).empty()); }

}  // namespace
}  // namespace strata
