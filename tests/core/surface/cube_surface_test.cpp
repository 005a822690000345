#include "core/surface/cube_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/math/random.h"
#include "core/voxel/voxel_tree_builder.h"
#include "tests/support/cube_bricks.h"
#include "tests/support/surface_in_memory.h"
#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

using Joints = CubeSurfaceSettings::Joints;

// Faces of single cells: direction, then the cell.
using UnitFace = std::array<int64_t, 4>;

std::vector<UnitFace> faces_by_rule(const VoxelCube& cells) {
    std::vector<UnitFace> faces;
    const int64_t side = cells.side();
    const auto occupied = [&](int64_t x, int64_t y, int64_t z) {
        return x >= 0 && y >= 0 && z >= 0 && x < side && y < side && z < side && cells.at(uint32_t(x), uint32_t(y), uint32_t(z));
    };
    for (int64_t direction = 0; direction < 6; ++direction)
        for (int64_t x = 0; x < side; ++x)
            for (int64_t y = 0; y < side; ++y)
                for (int64_t z = 0; z < side; ++z) {
                    if (!occupied(x, y, z)) continue;
                    std::array<int64_t, 3> n = {x, y, z};
                    n[size_t(direction / 2)] += direction % 2 == 0 ? 1 : -1;
                    if (!occupied(n[0], n[1], n[2])) faces.push_back({direction, x, y, z});
                }
    return faces;
}

// Of quads whose corners are whole in units of `cell` from the frame's origin, which they face outwards from.
std::vector<UnitFace> faces_of(const SurfaceInMemory& surface, const VoxelFrame& frame, double cell) {
    std::vector<UnitFace> faces;
    for (const auto& quad : surface.quads) {
        std::array<Vec3d, 4> p;
        for (size_t i = 0; i < 4; ++i) p[i] = (surface.positions[quad[i]] - frame.origin) / cell;
        const Vec3d normal = (p[1] - p[0]).cross(p[3] - p[0]);
        int axis = 0;
        normal.cwiseAbs().maxCoeff(&axis);
        const bool plus = normal[axis] > 0;
        Vec3d low = p[0].cwiseMin(p[2]), high = p[0].cwiseMax(p[2]);
        EXPECT_EQ(low[axis], high[axis]);
        EXPECT_EQ(std::abs(normal[axis]), (high - low + Vec3d::Unit(axis)).prod());
        for (const Vec3d& corner : {low, high}) EXPECT_EQ(corner, corner.array().round().matrix());
        if (plus) low[axis] -= 1;
        else high[axis] += 1;
        if (!surface.normals.empty()) {
            EXPECT_EQ(surface.normals[quad[0]][axis], plus ? 1.0f : -1.0f);
            EXPECT_EQ(surface.normals[quad[2]], surface.normals[quad[0]]);
        }
        for (auto x = int64_t(low.x()); x < int64_t(high.x()); ++x)
            for (auto y = int64_t(low.y()); y < int64_t(high.y()); ++y)
                for (auto z = int64_t(low.z()); z < int64_t(high.z()); ++z) faces.push_back({2 * axis + (plus ? 0 : 1), x, y, z});
    }
    std::sort(faces.begin(), faces.end());
    return faces;
}

// Cells of 2^shift voxels a side in place of voxels, in the corner of a cube that may be wider.
VoxelCube cells_of(const VoxelCube& voxels, int shift) {
    VoxelCube cells(std::max(1, voxels.levels - shift / 2));
    for (uint32_t x = 0; x < voxels.side(); ++x)
        for (uint32_t y = 0; y < voxels.side(); ++y)
            for (uint32_t z = 0; z < voxels.side(); ++z)
                if (voxels.at(x, y, z)) cells.set(x >> shift, y >> shift, z >> shift);
    return cells;
}

class CubeSurfaces : public testing::TestWithParam<std::tuple<int, bool>> {
protected:
    void SetUp() override {
        const int kind = std::get<0>(GetParam());
        voxels_ = kind == 0   ? random_cube(1, 0.4, 3)
                  : kind == 1 ? random_cube(2, 0.5, 4)
                  : kind == 2 ? random_cube(3, 0.1, 5)
                  : kind == 3 ? random_boxes(3, 40, 6)
                  : kind == 4 ? random_boxes(4, 60, 7)
                  : kind == 5 ? cube_where(4, [](uint32_t x, uint32_t y,
                                                 uint32_t z) { return in_integer_ball(int(x) - 131, int(y) - 122, int(z) - 128, 110); })
                              : cube_where(4, [](uint32_t, uint32_t, uint32_t) { return true; });
        tree_ = tree_of(voxels_, std::get<1>(GetParam()));
        tree_.levels.resize(size_t(voxels_.levels));  // where all is full, there are no nodes below
        tree_.frame.origin = Vec3d(-8, 4, 2);
        tree_.frame.voxel_size = 0.25;
    }

    VoxelCube voxels_{1};
    VoxelTree tree_;
};

TEST_P(CubeSurfaces, ShowWhatCanBeSeenAtEveryDepth) {
    for (int depth = 1; depth <= tree_.depth(); ++depth) {
        const int shift = tree_.depth() - depth;
        const VoxelCube cells = cells_of(voxels_, shift);
        const std::vector<UnitFace> truth = faces_by_rule(cells);
        const double cell = std::ldexp(0.25, shift);
        SurfaceInMemory separate, closed;
        const CubeSurfaceCounts counts = mesh_cubes(tree_, {.depth = depth, .joints = Joints::separate, .normals = true}, separate);
        EXPECT_EQ(counts.solid_voxels, cells.count());
        EXPECT_EQ(counts.faces_uncut, 6 * cells.count());
        EXPECT_EQ(counts.faces_culled, truth.size());
        EXPECT_EQ(counts.rectangles, separate.quads.size());
        EXPECT_EQ(counts.vertices, 4 * separate.quads.size());
        EXPECT_EQ(separate.normals.size(), separate.positions.size());
        EXPECT_FALSE(separate.refers_ahead);
        ASSERT_TRUE(faces_of(separate, tree_.frame, cell) == truth) << "depth " << depth;

        const CubeSurfaceCounts closed_counts = mesh_cubes(tree_, {.depth = depth}, closed);
        EXPECT_EQ(closed_counts.rectangles, counts.rectangles);
        EXPECT_EQ(closed_counts.faces_culled, counts.faces_culled);
        EXPECT_EQ(closed_counts.vertices, closed.positions.size());
        EXPECT_EQ(closed_counts.triangles, closed.triangles.size());
        EXPECT_EQ(closed_counts.quads, closed.quads.size());
        EXPECT_FALSE(closed.refers_ahead);
        const TriangleMesh mesh = closed.mesh();
        EXPECT_EQ(open_edges(mesh), 0u) << "depth " << depth;
        EXPECT_EQ(area_of(mesh), double(truth.size()) * cell * cell);  // whole numbers of quarters: exact
        EXPECT_EQ(volume_of(mesh), double(cells.count()) * cell * cell * cell);
        size_t flat = 0;
        for (const auto& t : mesh.triangles)
            flat += (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).isZero(0);
        EXPECT_EQ(flat, 0u);
        // No place has two vertices, across bricks either.
        std::vector<std::array<double, 3>> places;
        for (const Vec3d& p : mesh.positions) places.push_back({p.x(), p.y(), p.z()});
        std::sort(places.begin(), places.end());
        EXPECT_EQ(std::adjacent_find(places.begin(), places.end()), places.end());
    }
}

INSTANTIATE_TEST_SUITE_P(CubeSurface, CubeSurfaces, testing::Combine(testing::Range(0, 7), testing::Bool()));

TEST(CubeSurface, TheIntegerBallHasItsKnownNumbers) {
    // In one brick, and where eight meet: these cut rectangles, and nothing else.
    for (const int middle : {16, 32, 64}) {
        const VoxelTree tree = tree_of(cube_where(
            4, [&](uint32_t x, uint32_t y, uint32_t z) { return in_integer_ball(int(x) - middle, int(y) - middle, int(z) - middle, 16); }));
        SurfaceInMemory surface;
        const CubeSurfaceCounts counts = mesh_cubes(tree, {}, surface);
        EXPECT_EQ(counts.solid_voxels, 17074u);
        EXPECT_EQ(counts.faces_uncut, 102444u);
        EXPECT_EQ(counts.faces_culled, 4770u);
        if (middle < 64) EXPECT_LE(counts.rectangles, 2100u);
        EXPECT_GE(counts.rectangles, 2094u);
        // A sphere by Euler: a triangle has 3 halves of edges, a quad 4. Nowhere do cells touch along an edge only.
        const double edges = 1.5 * double(counts.triangles) + 2.0 * double(counts.quads);
        EXPECT_EQ(double(counts.vertices) - edges + double(counts.triangles + counts.quads), 2.0);
    }
}

TEST(CubeSurface, IsTheSameWhateverTheThreads) {
    VoxelTree tree = tree_of(random_boxes(4, 80, 11), true);
    tree.frame.voxel_size = 0.1;  // no place is exact, but all of one corner are the same
    for (const Joints joints : {Joints::closed, Joints::separate}) {
        SurfaceInMemory first;
        mesh_cubes(tree, {.joints = joints}, first);
        if (joints == Joints::closed) EXPECT_EQ(open_edges(first.mesh()), 0u);
        for (const int threads : {2, 3, 7}) {
            SurfaceInMemory surface;
            mesh_cubes(tree, {.joints = joints, .threads = threads}, surface);
            EXPECT_EQ(surface.positions, first.positions);
            EXPECT_EQ(surface.triangles, first.triangles);
            EXPECT_EQ(surface.quads, first.quads);
            EXPECT_EQ(surface.pieces, first.pieces);
        }
    }
}

// It grows to all cells, whatever the threads.
TEST(CubeSurface, SaysHowFarItIs) {
    const VoxelTree tree = tree_of(random_boxes(4, 80, 11), true);
    for (const Joints joints : {Joints::closed, Joints::separate})
        for (const int threads : {1, 3}) {
            std::vector<std::pair<uint64_t, uint64_t>> calls;
            SurfaceInMemory surface;
            const CubeSurfaceCounts counts = mesh_cubes(
                tree, {.joints = joints, .threads = threads, .on_progress = [&](uint64_t done, uint64_t total) { calls.emplace_back(done, total); }}, surface);
            ASSERT_GE(calls.size(), 10u);
            EXPECT_TRUE(std::is_sorted(calls.begin(), calls.end()));
            EXPECT_LT(calls.front().first, counts.solid_voxels / 2);
            EXPECT_EQ(calls.front().second, counts.solid_voxels);
            EXPECT_EQ(calls.back(), std::pair(counts.solid_voxels, counts.solid_voxels));
        }
}

// Voxels in bands of colors: a band's top is one rectangle a brick, and colors are the voxels'.
TEST(CubeSurface, ColorsPartRectanglesAndComeWithThem) {
    constexpr std::array<VoxelColor, 3> kColors = {{{255, 0, 0}, {0, 200, 0}, {10, 20, 30}}};
    const auto tree = [&] {
        const VoxelFrame frame{.levels = 4};
        VoxelTreeInMemory memory(frame, {.color = true});
        VoxelTreeBuilder builder(frame, {.color = true}, memory);
        VoxelBatch batch;
        for (uint64_t code = 0; code < uint64_t{1} << 18; ++code) {
            const auto [x, y, z] = coordinates_of_code(code);
            if (4 * x >= 96 || 4 * y >= 96 || z > 0) continue;
            batch.blocks.push_back({code, kFullMask, 0});
            for (uint64_t bit = 0; bit < 64; ++bit) batch.colors.push_back(kColors[(4 * x + coordinates_of_code(bit)[0]) / 32]);
        }
        builder.add(batch);
        builder.finish();
        return memory.take();
    }();
    SurfaceInMemory separate, closed, plain, glass;
    mesh_cubes(tree, {.joints = Joints::separate, .normals = true}, separate);
    size_t tops = 0;
    for (const auto& quad : separate.quads) {
        const Vec3d low = separate.positions[quad[0]].cwiseMin(separate.positions[quad[2]]);
        const Vec3d high = separate.positions[quad[0]].cwiseMax(separate.positions[quad[2]]);
        const size_t band = size_t(std::max(0.0, std::min(95.0, (low.x() + high.x()) / 2)) / 32);
        for (const uint32_t v : quad)
            EXPECT_EQ(separate.colors[v], (std::array<uint8_t, 4>{kColors[band][0], kColors[band][1], kColors[band][2], 255}));
        if (separate.normals[quad[0]] != Vec3f(0, 0, 1)) continue;
        ++tops;
        EXPECT_EQ(high.x() - low.x(), 32.0);
    }
    EXPECT_EQ(tops, 6u);  // three bands in two bricks along y
    mesh_cubes(tree, {}, closed);
    EXPECT_EQ(open_edges(closed.mesh()), 0u);
    EXPECT_EQ(closed.colors.size(), closed.positions.size());

    const CubeSurfaceCounts without = mesh_cubes(tree, {.colors = false}, plain);
    EXPECT_TRUE(plain.colors.empty());
    EXPECT_EQ(without.rectangles, 4u * 2u + 8u);  // a slab over four bricks

    // The middle band is glass: its two neighbors show their sides through it, 96 x 4 faces each, and it shows none to them.
    const CubeSurfaceCounts opaque_counts = mesh_cubes(tree, {}, plain);
    const CubeSurfaceCounts glass_counts = mesh_cubes(tree, {.transparent = {{kColors[1], 77}}}, glass);
    EXPECT_EQ(glass_counts.faces_culled, opaque_counts.faces_culled + 2 * 96 * 4);
    const auto color_is = [](const std::array<uint8_t, 4>& c) { return c == std::array<uint8_t, 4>{0, 200, 0, 77}; };
    EXPECT_TRUE(std::any_of(glass.colors.begin(), glass.colors.end(), color_is));
}

// The same faces, with vertices for each direction.
TEST(CubeSurface, ClosedFacesHaveNormalsIfAsked) {
    const VoxelTree tree = tree_of(random_boxes(4, 50, 5), true);
    SurfaceInMemory plain, with;
    const CubeSurfaceCounts counts = mesh_cubes(tree, {.threads = 2}, plain);
    const CubeSurfaceCounts with_counts = mesh_cubes(tree, {.normals = true, .threads = 2}, with);
    EXPECT_TRUE(plain.normals.empty());
    ASSERT_EQ(with.normals.size(), with.positions.size());
    EXPECT_EQ(with_counts.triangles, counts.triangles);
    EXPECT_EQ(with_counts.quads, counts.quads);
    EXPECT_GT(with_counts.vertices, counts.vertices);
    const TriangleMesh mesh = with.mesh(), same = plain.mesh();
    EXPECT_EQ(open_edges(mesh), 0u);
    for (size_t i = 0; i < mesh.triangles.size(); ++i) {
        const auto& t = mesh.triangles[i];
        const Vec3d normal = (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).normalized();
        for (size_t k = 0; k < 3; ++k) {
            EXPECT_EQ(mesh.normals[t[k]].cast<double>(), normal);
            EXPECT_EQ(mesh.positions[t[k]], same.positions[same.triangles[i][k]]);
        }
    }
}

// Colors by eighths of the frame, of the cells of each depth that are stored.
void color_by_octants(VoxelTree& tree) {
    tree.attributes.resize(size_t(tree.depth()) + 1);
    std::vector<uint64_t> codes = {0};  // of a level's nodes
    for (size_t number = 0; number < tree.levels.size(); ++number) {
        const VoxelLevel& level = tree.levels[number];
        std::vector<uint64_t> below;
        for (size_t node = 0; node < level.masks.size(); ++node)
            for (uint64_t bit = 0; bit < 64; ++bit) {
                const uint64_t code = codes[node] << 6 | bit, octant = code >> 3 * (2 * number + 1);
                const VoxelColor color = {uint8_t(octant & 4 ? 200 : 0), uint8_t(octant & 2 ? 200 : 0), uint8_t(octant & 1 ? 200 : 0)};
                if ((level.masks[node] >> (bit & 56) & 0xFF) != 0 && (bit & 7) == 0)
                    tree.attributes[2 * number + 1].colors.push_back(color);
                if ((level.masks[node] >> bit & 1) == 0) continue;
                tree.attributes[2 * number + 2].colors.push_back(color);
                if ((level.full_mask(node) >> bit & 1) == 0) below.push_back(code);
            }
        codes = std::move(below);
    }
    index_tree(tree);
    check_attributes(tree);
}

// Cells below a full one are of its color: as if they were there.
TEST(CubeSurface, FullCellsAreTheCellsTheyHoldWithColors) {
    const VoxelCube voxels = cube_where(
        4, [](uint32_t x, uint32_t y, uint32_t z) { return x >= 64 || in_integer_ball(int(x) - 60, int(y) - 122, int(z) - 128, 50); });
    VoxelTree plain = tree_of(voxels), full = tree_of(voxels, true);
    color_by_octants(plain);
    color_by_octants(full);
    // Two of the colors can be seen through: inside there are faces where the others touch these.
    for (const auto& transparent :
         {std::vector<std::pair<VoxelColor, uint8_t>>{}, {{VoxelColor{200, 0, 0}, 10}, {VoxelColor{200, 200, 0}, 20}}})
        for (const int depth : {8, 7}) {
            SurfaceInMemory expected, found;
            const CubeSurfaceCounts truth = mesh_cubes(plain, {.depth = depth, .transparent = transparent}, expected);
            const CubeSurfaceCounts counts = mesh_cubes(full, {.depth = depth, .transparent = transparent}, found);
            EXPECT_EQ(counts.faces_culled, truth.faces_culled);
            EXPECT_EQ(found.positions, expected.positions);
            EXPECT_EQ(found.colors, expected.colors);
            EXPECT_EQ(found.triangles, expected.triangles);
            EXPECT_EQ(found.quads, expected.quads);
            if (transparent.empty()) EXPECT_EQ(open_edges(found.mesh()), 0u);
        }
}

// A sink that fails ends all threads, and its error is what comes out.
TEST(CubeSurface, AFailingSinkEndsIt) {
    struct Failing : SurfaceSink {
        int left = 3;
        void add(const SurfacePiece&) override {
            if (left-- == 0) throw Error(ErrorKind::io, "full");
        }
    };
    const VoxelTree tree = tree_of(random_boxes(4, 80, 11), true);
    for (const int threads : {1, 3}) {
        Failing sink;
        EXPECT_THROW(mesh_cubes(tree, {.threads = threads}, sink), Error);
        EXPECT_EQ(sink.left, -1);
    }
}

// The least memory that makes a bar of 4 x 4 cells through some bricks, 64 long each.
uint64_t least_memory_of_bar(uint32_t bricks, Joints joints) {
    const VoxelFrame frame{.levels = 6};
    VoxelTreeInMemory memory(frame, {});
    VoxelTreeBuilder builder(frame, {}, memory);
    VoxelBatch batch;
    for (uint32_t x = 0; x < 16 * bricks; ++x) batch.blocks.push_back({octant_code(x, 0, 0), kFullMask, 0});
    builder.add(batch);
    builder.finish();
    const VoxelTree tree = memory.take();
    uint64_t too_little = 0, enough = uint64_t{1} << 20;
    while (enough - too_little > 1) {
        const uint64_t bytes = (too_little + enough) / 2;
        SurfaceInMemory surface;
        try {
            const CubeSurfaceCounts counts = mesh_cubes(tree, {.joints = joints, .memory_bytes = bytes}, surface);
            EXPECT_EQ(counts.rectangles, 4u * bricks + 2);
            enough = bytes;
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::limit);
            EXPECT_NE(std::string(error.what()).find(" " + std::to_string(bytes) + " are allowed"), std::string::npos) << error.what();
            too_little = bytes;
        }
    }
    return enough;
}

// A brick of a bar has 8 corners on its outside, in a list that may have grown to twice that, and as many vertices there, of 16 bytes: these
// are let go of when the next is done, and add nothing to a longer bar. Separate rectangles keep nothing.
TEST(CubeSurface, MemoryIsCountedAndLetGoOf) {
    const double closed = double(least_memory_of_bar(64, Joints::closed) - least_memory_of_bar(16, Joints::closed)) / 48;
    EXPECT_GE(closed, 68 + 8 * 4);
    EXPECT_LE(closed, 68 + 16 * 4);
    EXPECT_EQ(least_memory_of_bar(64, Joints::separate) - least_memory_of_bar(16, Joints::separate), 48u * 20);
    // 4 rectangles at least of a brick in work, each of 4 vertices with a position.
    EXPECT_GE(least_memory_of_bar(16, Joints::separate), 16 * 20 + 4 * 4 * (sizeof(Vec3f) + 12 + 4));
}

TEST(CubeSurface, SaysWhatItCannotDo) {
    const VoxelTree tree = tree_of(random_cube(2, 0.5, 1));
    SurfaceInMemory surface;
    EXPECT_THROW(mesh_cubes(tree, {.depth = 5}, surface), Error);
    EXPECT_THROW(mesh_cubes(tree, {.depth = -1}, surface), Error);
    EXPECT_THROW(mesh_cubes(tree, {.transparent = {{VoxelColor{1, 2, 3}, 9}}}, surface), Error);
    EXPECT_EQ(mesh_cubes(VoxelTree{}, {}, surface).rectangles, 0u);
    EXPECT_EQ(surface.pieces, 0u);
}

// Truth: the farthest corner of a coarse cell from the voxel in its other corner.
TEST(CubeSurface, DepthFollowsFromTheError) {
    const VoxelTree tree = tree_of(random_cube(3, 0.5, 1));  // depth 6
    EXPECT_EQ(depth_of_error(tree, 0.0), 6);
    EXPECT_EQ(depth_of_error(tree, 1.73), 6);
    EXPECT_EQ(depth_of_error(tree, 1.74), 5);
    EXPECT_EQ(depth_of_error(tree, 3 * 1.7321), 4);
    EXPECT_EQ(depth_of_error(tree, 1e9), 1);
    // A picture of 100 pixels for 100 units of height: errors are in voxels.
    Camera camera{.projection = Projection::orthographic, .eye = Vec3d(32, 32, 200), .height = 100.0, .near_depth = 1.0};
    EXPECT_EQ(depth_of_error_px(tree, camera, 100, 100, 1.74), 5);
    EXPECT_EQ(depth_of_error_px(tree, camera, 200, 200, 1.74), 6);
    // In perspective the nearest place of the box counts, here 136 units from the eye.
    camera.projection = Projection::perspective;
    camera.fov_rad = 2.0 * std::atan(0.5);
    EXPECT_EQ(depth_of_error_px(tree, camera, 136, 136, 1.74), 5);
    EXPECT_EQ(depth_of_error_px(tree, camera, 137, 137, 1.733), 6);
    camera.eye = Vec3d(500, 32, 200);
    EXPECT_EQ(depth_of_error_px(tree, camera, 100, 100, 0.001), 1) << "nothing is seen";
}

}  // namespace
}  // namespace strata
