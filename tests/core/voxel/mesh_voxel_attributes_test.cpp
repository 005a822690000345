#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/voxel/mesh_voxels.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

VoxelBatch batch_of(const TriangleMesh& mesh, const VoxelFrame& frame, const MeshVoxelSettings& settings) {
    VoxelBatch all;
    voxelize_mesh(mesh, frame, settings, [&](const VoxelBatch& batch) {
        all.blocks.insert(all.blocks.end(), batch.blocks.begin(), batch.blocks.end());
        all.normals.insert(all.normals.end(), batch.normals.begin(), batch.normals.end());
        all.colors.insert(all.colors.end(), batch.colors.begin(), batch.colors.end());
    });
    return all;
}

// Calls visit(center, index) for each voxel in its order.
template <class Visit>
size_t each_voxel(const VoxelBatch& batch, Visit&& visit) {
    size_t index = 0;
    for (const VoxelBlock& block : batch.blocks)
        for (int bit = 0; bit < 64; ++bit)
            if (block.mask >> bit & 1) {
                const auto [x, y, z] = coordinates_of_code(block.code << 6 | uint64_t(bit));
                visit(Vec3d(x + 0.5, y + 0.5, z + 0.5), index++);
            }
    return index;
}

const Vec3d kCenter(64.3, 63.1, 65.7);
constexpr double kRadius = 50.0;
const VoxelFrame kFrame = {.levels = 4};

// Red grows along x, green along y, by 2 a voxel.
TriangleMesh colored_sphere(uint32_t n) {
    TriangleMesh mesh = sphere_mesh(kCenter, kRadius, n);
    for (const Vec3d& p : mesh.positions)
        mesh.colors.push_back({uint8_t(std::lround(2.0 * (p.x() - 10.0))), uint8_t(std::lround(2.0 * (p.y() - 10.0))), 77, 255});
    return mesh;
}

TEST(MeshVoxelAttributes, AreNormalsAndColorsOfTheSurface) {
    for (const uint32_t n : {20u, 300u})  // triangles of 8 and of half a voxel
        for (const VoxelKind kind : {VoxelKind::conservative, VoxelKind::thin}) {
            const VoxelBatch batch =
                batch_of(colored_sphere(n), kFrame, {.kind = kind, .attributes = {.color = true, .normal = true}, .threads = 2});
            // A voxel's triangles reach half its diagonal from its center and are as wide as they are; steps of 1 / 127.
            const double reach = 0.9 + kRadius * M_PI / n, angle = reach / kRadius + 1.0 / 127.0;
            const size_t voxels = each_voxel(batch, [&](const Vec3d& p, size_t i) {
                const Vec3d normal(batch.normals[i][0], batch.normals[i][1], batch.normals[i][2]);
                ASSERT_NEAR(normal.norm(), 127.0, 1.0);
                ASSERT_GT(normal.normalized().dot((p - kCenter).normalized()), std::cos(angle));
                // The nearest point of a triangle in the voxel is within its diagonal; colors of vertices are rounded.
                ASSERT_NEAR(batch.colors[i][0], 2.0 * (p.x() - 10.0), 2.0 * 1.75 + 1.0);
                ASSERT_NEAR(batch.colors[i][1], 2.0 * (p.y() - 10.0), 2.0 * 1.75 + 1.0);
                ASSERT_EQ(batch.colors[i][2], 77);
            });
            EXPECT_EQ(batch.normals.size(), voxels);
            EXPECT_EQ(batch.colors.size(), voxels);
            EXPECT_GT(voxels, 20'000u);
        }
}

TEST(MeshVoxelAttributes, DoNotDependOnThreadsAndTheOrderOfTriangles) {
    TriangleMesh mesh = colored_sphere(60);
    const MeshVoxelSettings settings = {.attributes = {.color = true, .normal = true}};
    const VoxelBatch expected = batch_of(mesh, kFrame, settings);
    std::reverse(mesh.triangles.begin(), mesh.triangles.end());
    MeshVoxelSettings more = settings;
    more.threads = 3;
    const VoxelBatch found = batch_of(mesh, kFrame, more);
    EXPECT_EQ(found.blocks, expected.blocks);
    EXPECT_EQ(found.normals, expected.normals);
    EXPECT_EQ(found.colors, expected.colors);
    EXPECT_EQ(batch_of(mesh, kFrame, {}).blocks, expected.blocks);
}

// By hand: a triangle of area 8 and one of 1/8 in one voxel, at right angles: weights 1 and 1/8.
TEST(MeshVoxelAttributes, WeighByAreaUpToAVoxel) {
    TriangleMesh mesh;
    mesh.positions = {Vec3d(0, 0, 1.5),      Vec3d(4, 0, 1.5),      Vec3d(0, 4, 1.5),
                      Vec3d(1.5, 1.25, 1.2), Vec3d(1.5, 1.75, 1.2), Vec3d(1.5, 1.25, 1.7)};
    mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
    mesh.colors = {{100, 0, 0, 255}, {100, 0, 0, 255}, {100, 0, 0, 255}, {0, 200, 0, 255}, {0, 200, 0, 255}, {0, 200, 0, 255}};
    const VoxelBatch batch = batch_of(mesh, {.levels = 1}, {.attributes = {.color = true, .normal = true}});
    bool met = false;
    each_voxel(batch, [&](const Vec3d& p, size_t i) {
        if (p == Vec3d(1.5, 1.5, 1.5)) {
            met = true;
            EXPECT_EQ(batch.normals[i], (VoxelNormal{16, 0, 126}));  // 127 (1/8, 0, 1) / 1.0078
            EXPECT_EQ(batch.colors[i], (VoxelColor{89, 22, 0}));     // (8 * 100, 200, 0) / 9
        } else {
            EXPECT_EQ(batch.normals[i], (VoxelNormal{0, 0, 127}));
            EXPECT_EQ(batch.colors[i], (VoxelColor{100, 0, 0}));
        }
    });
    EXPECT_TRUE(met);
}

TEST(MeshVoxelAttributes, OfSheetsBackToBackAndOfPointsAreNoNormals) {
    TriangleMesh mesh;
    mesh.positions = {Vec3d(0, 0, 1.5), Vec3d(4, 0, 1.5), Vec3d(0, 4, 1.5)};
    for (const auto& triangles : {std::vector<std::array<uint32_t, 3>>{{0, 1, 2}, {0, 2, 1}}, {{1, 1, 1}}}) {
        mesh.triangles = triangles;
        const VoxelBatch batch = batch_of(mesh, {.levels = 1}, {.attributes = {.normal = true}});
        EXPECT_FALSE(batch.normals.empty());
        for (const VoxelNormal& normal : batch.normals) EXPECT_EQ(normal, VoxelNormal{});
    }
}

TEST(MeshVoxelAttributes, ThatThereAreNotAreRefused) {
    const TriangleMesh mesh = box_mesh(Vec3d::Constant(2.0), Vec3d::Ones());
    const auto failure = [&](const MeshVoxelSettings& settings) -> std::string {
        try {
            batch_of(mesh, {.levels = 1}, settings);
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::usage);
            return error.what();
        }
        return "none";
    };
    EXPECT_EQ(failure({.attributes = {.color = true}}), "the mesh has no colors");
    EXPECT_EQ(failure({.attributes = {.count = true}}), "voxels of a mesh have no count of points");
    EXPECT_EQ(failure({.kind = VoxelKind::solid, .attributes = {.normal = true}}), "voxels of a solid have no attributes");
    EXPECT_EQ(failure({.attributes = {.opacity = true}}), "none");  // of coarser cells: whoever builds the tree finds it
}

}  // namespace
}  // namespace strata
