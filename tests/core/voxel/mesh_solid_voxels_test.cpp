#include <gtest/gtest.h>

#include <cmath>

#include "core/math/random.h"
#include "core/voxel/mesh_voxels.h"
#include "tests/support/run_program.h"
#include "tests/support/test_meshes.h"
#include "tests/support/voxels_of_mesh.h"

namespace strata {
namespace {

Vec3d center_of(uint32_t x, uint32_t y, uint32_t z) { return {x + 0.5, y + 0.5, z + 0.5}; }

// Solid angles of all triangles, one by one.
double winding_number(const TriangleMesh& mesh, const Vec3d& p) {
    double sum = 0.0;
    for (const auto& t : mesh.triangles) {
        const Vec3d a = mesh.positions[t[0]] - p, b = mesh.positions[t[1]] - p, c = mesh.positions[t[2]] - p;
        const double la = a.norm(), lb = b.norm(), lc = c.norm();
        sum += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
    }
    return sum / (4.0 * M_PI);
}

// Vertices where snapping leaves them.
TriangleMesh snapped(TriangleMesh mesh, const VoxelFrame& frame) {
    const double unit = std::ldexp(1.0, snapped_bits(frame));
    for (Vec3d& p : mesh.positions) p = (p * unit).array().round() / unit;
    return mesh;
}

// Compares every twentieth center or so, sanitized every hundredth, with its winding number in double precision, but for those that have it within `margin` of 1/2,
// or not a number.
void expect_those_wound_around(const TriangleMesh& mesh, const VoxelFrame& frame, double margin, const char* name) {
    const CellGrid found = cells_of(mesh, frame, VoxelKind::solid);
    const TriangleMesh twin = snapped(mesh, frame);
    uint64_t compared = 0, inside = 0, asked = 0;
    Random random(6);
    const uint64_t step = test::built_with_sanitizer() ? 100 : 20;
    for (uint32_t x = 0; x < found.side; ++x)
        for (uint32_t y = 0; y < found.side; ++y)
            for (uint32_t z = 0; z < found.side; ++z) {
                if (found.side > 16 && random.bits() % step != 0) continue;
                ++asked;
                const double w = winding_number(twin, center_of(x, y, z));
                if (!(std::abs(w - 0.5) > margin)) continue;
                ++compared;
                inside += w > 0.5;
                ASSERT_EQ(found.at(x, y, z), w > 0.5) << name << ": " << x << ' ' << y << ' ' << z << " has " << w;
            }
    EXPECT_GT(compared, asked * 95 / 100) << name;
    EXPECT_GT(inside, 0u) << name;
}

const VoxelFrame kSmallFrame = {.levels = 2}, kFrame = {.levels = 3}, kLargerFrame = {.levels = 4};

TEST(MeshSolidVoxels, OfABoxAreTheCentersInIt) {
    const Vec3d center(33.3, 30.2, 31.7), half(20.4, 11.3, 25.6);
    const CellGrid found = cells_of(box_mesh(center, half), kFrame, VoxelKind::solid);
    for (uint32_t x = 0; x < 64; ++x)
        for (uint32_t y = 0; y < 64; ++y)
            for (uint32_t z = 0; z < 64; ++z)
                ASSERT_EQ(found.at(x, y, z), ((center_of(x, y, z) - center).array().abs() < half.array()).all())
                    << x << ' ' << y << ' ' << z;
}

// Faces through centers: a center on a lower face counts as if it lay higher, inside; on an upper face, outside. So boxes side by side
// share no voxel and leave none out.
TEST(MeshSolidVoxels, OfABoxWithFacesThroughCentersAreHalfOpen) {
    const CellGrid found = cells_of(box_mesh(Vec3d::Constant(8.5), Vec3d(3.0, 4.0, 5.0)), kSmallFrame, VoxelKind::solid);
    EXPECT_EQ(found.count(), 6u * 8 * 10);
    for (uint32_t x = 0; x < 16; ++x)
        for (uint32_t y = 0; y < 16; ++y)
            for (uint32_t z = 0; z < 16; ++z) ASSERT_EQ(found.at(x, y, z), x >= 5 && x < 11 && y >= 4 && y < 12 && z >= 3 && z < 13);
}

// Tetrahedra with corners on centers and between, as the fan of a point over the triangles of a box: each center inside is in one.
TEST(MeshSolidVoxels, OfPartsThatFillABoxShareNone) {
    Random random(5);
    for (int i = 0; i < 60; ++i) {
        const Vec3d apex =
            (2.0 * Vec3d(random.uniform(5.0, 11.0), random.uniform(5.0, 11.0), random.uniform(5.0, 11.0))).array().floor() / 2.0;
        const TriangleMesh box = box_mesh(Vec3d::Constant(8.0 + 0.5 * (i & 1)), Vec3d(4.0, 5.0, 6.0));
        CellGrid sum(16);
        for (const auto& t : box.triangles) {
            TriangleMesh part;
            part.positions = {box.positions[t[0]], box.positions[t[1]], box.positions[t[2]], apex};
            part.triangles = {{0, 1, 2}, {1, 0, 3}, {2, 1, 3}, {0, 2, 3}};
            const CellGrid cells = cells_of(part, kSmallFrame, VoxelKind::solid);
            for (size_t k = 0; k < cells.cells.size(); ++k) sum.cells[k] = uint8_t(sum.cells[k] + cells.cells[k]);
        }
        ASSERT_TRUE(sum == cells_of(box, kSmallFrame, VoxelKind::solid)) << i;
    }
}

// A mesh of radius between the inscribed polyhedron's and R: the rings' sagitta is R (1 - cos(pi / 2n)).
TEST(MeshSolidVoxels, OfASphereAreTheCentersInIt) {
    const Vec3d center(127.3, 129.1, 126.2);
    const double radius = 111.7;
    const uint32_t n = 200;
    const CellGrid found = cells_of(sphere_mesh(center, radius, n), kLargerFrame, VoxelKind::solid);
    const double least = radius * std::pow(std::cos(M_PI / (2 * n)), 2) - 1e-4;
    uint64_t between = 0;
    for (uint32_t x = 0; x < 256; ++x)
        for (uint32_t y = 0; y < 256; ++y)
            for (uint32_t z = 0; z < 256; ++z) {
                const double r = (center_of(x, y, z) - center).norm();
                if (r > radius + 1e-4) {
                    ASSERT_FALSE(found.at(x, y, z));
                } else if (r < least) {
                    ASSERT_TRUE(found.at(x, y, z));
                } else {
                    ++between;
                }
            }
    EXPECT_LT(between, 4.0 * M_PI * radius * radius * (radius - least) * 2.0);
    const double volume = 4.0 / 3.0 * M_PI * radius * radius * radius;
    EXPECT_NEAR(double(found.count()), volume, 4.0 * M_PI * radius * radius * (radius - least) + 10.0 * radius);
}

TEST(MeshSolidVoxels, AreThoseThatClosedMeshesWindAround) {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
    expect_those_wound_around(sphere_mesh(Vec3d(32.1, 31.7, 32.4), 20.3, 9), kFrame, 0.01, "sphere");
    expect_those_wound_around(torus_mesh(Vec3d(32.1, 31.7, 32.4), 19.0, 7.0, 12), kFrame, 0.01, "torus");
    expect_those_wound_around(box_mesh(Vec3d(32.1, 31.7, 32.4), Vec3d(20.0, 15.5, 10.25), turn), kFrame, 0.01, "turned box");
    // Beyond the frame on every side, in some and in all directions.
    expect_those_wound_around(torus_mesh(Vec3d(8.1, 7.7, 4.4), 19.0, 12.0, 12), kSmallFrame, 0.01, "torus around the frame");
    expect_those_wound_around(box_mesh(Vec3d(8.1, 7.7, 8.4), Vec3d(20.0, 15.5, 100.0), turn), kSmallFrame, 0.01, "box around the frame");
    expect_those_wound_around(box_mesh(Vec3d(8.1, 7.7, 8.4), Vec3d(5.0, 5.0, 1e6), turn), kSmallFrame, 0.01, "beam through the frame");
    expect_those_wound_around(box_mesh(Vec3d(8.1, 7.7, 2e5), Vec3d(5.0, 5.0, 2e5 - 3.0)), kSmallFrame, 0.01, "tower");
}

// Two spheres that overlap are one body (w = 2 where they do), one in another fills it, and the inner one inside out hollows it.
TEST(MeshSolidVoxels, OfOverlappingAndNestedShells) {
    const TriangleMesh first = sphere_mesh(Vec3d(26.1, 32.0, 32.0), 15.0, 12), second = sphere_mesh(Vec3d(38.3, 31.0, 32.0), 14.0, 12);
    const auto solid = [](const TriangleMesh& mesh) { return cells_of(mesh, kFrame, VoxelKind::solid); };
    const CellGrid a = solid(first), b = solid(second);
    TriangleMesh both = first;
    append(both, second);
    const CellGrid united = solid(both);
    for (size_t i = 0; i < united.cells.size(); ++i) ASSERT_EQ(united.cells[i], a.cells[i] | b.cells[i]);

    TriangleMesh inner = sphere_mesh(Vec3d(26.1, 32.0, 32.0), 8.0, 12), nested = first;
    const CellGrid c = solid(inner);
    append(nested, inner);
    EXPECT_TRUE(solid(nested) == a);
    turn_inside_out(inner);
    EXPECT_EQ(solid(inner).count(), 0u);  // w = -1
    TriangleMesh hollow = first;
    append(hollow, inner);
    const CellGrid shell = solid(hollow);
    for (size_t i = 0; i < shell.cells.size(); ++i) ASSERT_EQ(shell.cells[i], a.cells[i] & !c.cells[i]);
}

// As STL files have it: no triangle shares a vertex with another.
TEST(MeshSolidVoxels, DoNotNeedSharedVertices) {
    const TriangleMesh mesh = torus_mesh(Vec3d(32.1, 31.7, 32.4), 19.0, 7.0, 30);
    TriangleMesh loose;
    for (const auto& t : mesh.triangles) {
        const uint32_t first = uint32_t(loose.positions.size());
        for (const uint32_t v : t) loose.positions.push_back(mesh.positions[v]);
        loose.triangles.push_back({first, first + 1, first + 2});
    }
    EXPECT_TRUE(cells_of(loose, kFrame, VoxelKind::solid) == cells_of(mesh, kFrame, VoxelKind::solid));
}

TEST(MeshSolidVoxels, AreThoseThatOpenMeshesWindAround) {
    const auto without = [](TriangleMesh mesh, auto&& removed) {
        std::erase_if(mesh.triangles, [&](const auto& t) {
            return removed(Vec3d((mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0));
        });
        return mesh;
    };
    const Vec3d c(32.1, 31.7, 32.4);
    const TriangleMesh sphere = sphere_mesh(c, 20.3, 12);
    expect_those_wound_around(without(sphere, [&](const Vec3d& p) { return p.z() > c.z() + 17.0; }), kFrame, 1e-9,
                              "sphere with a hole above");
    expect_those_wound_around(without(sphere, [&](const Vec3d& p) { return p.x() < c.x() - 15.0; }), kFrame, 1e-9,
                              "sphere with a hole aside");
    expect_those_wound_around(without(sphere, [&](const Vec3d& p) { return p.z() > c.z(); }), kFrame, 1e-9, "lower half of a sphere");
    expect_those_wound_around(without(sphere, [&](const Vec3d& p) { return p.x() + p.y() - p.z() > 31.0; }), kFrame, 1e-9,
                              "half of a sphere, askew");
    expect_those_wound_around(
        without(sphere, [&](const Vec3d& p) { return p.z() > c.z() + 12.0 || p.z() < c.z() - 12.0 || p.x() > c.x() + 12.0; }), kFrame, 1e-9,
        "three holes");
    expect_those_wound_around(without(sphere, [&](const Vec3d& p) { return int(p.x() * 7.0 + p.y() * 3.0) % 4 == 0; }), kFrame, 1e-9,
                              "rags");
    TriangleMesh two = without(sphere, [&](const Vec3d& p) { return p.z() > c.z() + 8.0; });
    append(two, without(sphere_mesh(c + Vec3d(3.0, 2.0, -5.0), 11.0, 9), [&](const Vec3d& p) { return p.y() > c.y() + 6.0; }));
    expect_those_wound_around(two, kFrame, 1e-9, "an open one in an open one");
    expect_those_wound_around(without(sphere_mesh(Vec3d(8.1, 7.7, 4.4), 24.0, 9), [&](const Vec3d& p) { return p.z() > 20.0; }),
                              kSmallFrame, 1e-9, "hole above the frame");
    // Twice the same half: w is twice as large.
    TriangleMesh doubled = without(sphere, [&](const Vec3d& p) { return p.z() > c.z(); });
    append(doubled, doubled);
    expect_those_wound_around(doubled, kFrame, 1e-9, "twice a half");
}

// A hole whose rim lies in a plane: the winding number is 1/2 on the plane in the hole. So the solid is that of the closed mesh.
TEST(MeshSolidVoxels, OfABoxWithoutLidAreThoseOfTheBox) {
    for (const double z : {0.0, 0.3}) {
        TriangleMesh box = box_mesh(Vec3d(32.1, 31.7, 32.4 + z), Vec3d(20.0, 15.5, 10.25));
        const CellGrid closed = cells_of(box, kFrame, VoxelKind::solid);
        std::erase_if(box.triangles, [&](const auto& t) {
            return std::all_of(t.begin(), t.end(), [&](uint32_t v) { return box.positions[v].z() > 32.4; });
        });
        ASSERT_EQ(box.triangles.size(), 10u);
        EXPECT_TRUE(cells_of(box, kFrame, VoxelKind::solid) == closed);
    }
}

// With the open face through centers, these have a winding number of 1/2, which is not over it; one is the apex of the cap.
TEST(MeshSolidVoxels, OfABoxThatIsOpenAtCentersAreThoseBeyondThem) {
    for (int face = 0; face < 6; ++face) {
        const int axis = face / 2;
        const Vec3d center = Vec3d::Constant(8.5), half(3.0, 4.0, 5.0);
        TriangleMesh box = box_mesh(center, half);
        const double open = center[axis] + (face % 2 ? half[axis] : -half[axis]);
        std::erase_if(box.triangles, [&](const auto& t) {
            return std::all_of(t.begin(), t.end(), [&](uint32_t v) { return box.positions[v][axis] == open; });
        });
        ASSERT_EQ(box.triangles.size(), 10u);
        const CellGrid found = cells_of(box, kSmallFrame, VoxelKind::solid);
        for (uint32_t x = 0; x < 16; ++x)
            for (uint32_t y = 0; y < 16; ++y)
                for (uint32_t z = 0; z < 16; ++z) {
                    const Vec3d from_center = center_of(x, y, z) - center;
                    if ((from_center.array().abs() == half.array()).count() > 1) continue;  // on the rim it has no value
                    const bool in_box = x >= 5 && x < 11 && y >= 4 && y < 12 && z >= 3 && z < 13;
                    ASSERT_EQ(found.at(x, y, z), in_box && center[axis] + from_center[axis] != open)
                        << face << ": " << x << ' ' << y << ' ' << z;
                }
    }
}

TEST(MeshSolidVoxels, ComeInWholeCubes) {
    // A box of 4^4 voxels at a place where cubes of 64 and of 16 fit in.
    const auto blocks =
        blocks_of(box_mesh(Vec3d::Constant(128.0), Vec3d::Constant(128.0 - 16.0)), {.levels = 5}, {.kind = VoxelKind::solid});
    EXPECT_EQ(count_voxels(blocks), 224u * 224 * 224);
    uint64_t cubes_of_64 = 0;
    for (const VoxelBlock& block : blocks) {
        EXPECT_GE(block.height, 1);
        cubes_of_64 += block.height == 2 && block.mask == kFullMask;
    }
    EXPECT_EQ(cubes_of_64, 8u);
}

TEST(MeshSolidVoxels, OfALargeSphereAreFewBlocks) {
    const TriangleMesh mesh = sphere_mesh(Vec3d::Constant(2048.0), 2000.0, 4);
    uint64_t voxels = 0, blocks = 0;
    voxelize_mesh(mesh, {.levels = 6}, {.kind = VoxelKind::solid, .threads = 2}, [&](const VoxelBatch& batch) {
        for (const VoxelBlock& block : batch.blocks) voxels += uint64_t(std::popcount(block.mask)) << 6 * block.height;
        blocks += batch.blocks.size();
    });
    // Centers in a body are as many as its volume has voxels, but for those at its surface of 35 million, whose errors nearly cancel.
    EXPECT_NEAR(double(voxels) / volume_of(mesh), 1.0, 1e-6);
    EXPECT_LT(blocks, voxels / 512);  // 8 times more if all masks were of voxels
}

TEST(MeshSolidVoxels, DoNotDependOnThreadsAndTheOrderOfTriangles) {
    TriangleMesh mesh = sphere_mesh(Vec3d(130.0, 120.0, 125.0), 110.0, 60);
    mesh.triangles.erase(mesh.triangles.begin() + 1000, mesh.triangles.begin() + 1500);
    append(mesh, box_mesh(Vec3d::Constant(100.0), Vec3d(30.0, 70.0, 90.0)));
    const auto expected = blocks_of(mesh, {.levels = 4}, {.kind = VoxelKind::solid});
    for (const int threads : {2, 3, 8}) EXPECT_EQ(blocks_of(mesh, {.levels = 4}, {.kind = VoxelKind::solid, .threads = threads}), expected);
    std::reverse(mesh.triangles.begin(), mesh.triangles.end());
    EXPECT_EQ(blocks_of(mesh, {.levels = 4}, {.kind = VoxelKind::solid, .threads = 2}), expected);
}

TEST(MeshSolidVoxels, OfWhatHasNoInsideAreNone) {
    TriangleMesh mesh;
    mesh.positions = {Vec3d(3, 3, 3), Vec3d(12, 4, 5), Vec3d(5, 13, 6)};
    mesh.triangles = {{0, 1, 2}};
    EXPECT_EQ(cells_of(mesh, kSmallFrame, VoxelKind::solid).count(), 0u);
    mesh.triangles = {{0, 1, 2}, {0, 2, 1}};
    EXPECT_EQ(cells_of(mesh, kSmallFrame, VoxelKind::solid).count(), 0u);
    mesh.triangles = {{0, 1, 1}, {0, 0, 0}};
    EXPECT_EQ(cells_of(mesh, kSmallFrame, VoxelKind::solid).count(), 0u);
}

}  // namespace
}  // namespace strata
