#include "core/surface/coverage_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/surface/contour.h"
#include "tests/support/cube_bricks.h"
#include "tests/support/surface_in_memory.h"
#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

// The truth: voxels counted one by one.
std::vector<float> shares_of(const VoxelCube& voxels, int shift) {
    const size_t side = voxels.side() >> shift;
    std::vector<float> shares(side * side * side);
    const float part = std::ldexp(1.0f, -3 * shift);
    for (uint32_t x = 0; x < voxels.side(); ++x)
        for (uint32_t y = 0; y < voxels.side(); ++y)
            for (uint32_t z = 0; z < voxels.side(); ++z)
                if (voxels.at(x, y, z)) shares[((z >> shift) * side + (y >> shift)) * side + (x >> shift)] += part;
    return shares;
}

class CoverageFields : public testing::TestWithParam<std::tuple<int, bool>> {};

TEST_P(CoverageFields, HoldTheShareOfEachCell) {
    const auto [kind, with_full] = GetParam();
    const VoxelCube voxels = kind == 0   ? random_cube(1, 0.5, 1)
                             : kind == 1 ? random_cube(3, 0.02, 2)
                             : kind == 2 ? random_boxes(3, 30, 3)
                             : kind == 4 ? cube_where(4, [](uint32_t x, uint32_t, uint32_t) { return x >= 64; })
                                         : cube_where(4, [](uint32_t x, uint32_t y, uint32_t z) {
                                               return in_integer_ball(int(x) - 120, int(y) - 100, int(z) - 140, 90);
                                           });
    VoxelTree tree = tree_of(voxels, with_full);
    tree.levels.resize(size_t(voxels.levels));
    tree.frame.origin = Vec3d(5, 6, 7);
    tree.frame.voxel_size = 0.5;
    for (int depth = 1; depth <= tree.depth(); ++depth) {
        const int shift = tree.depth() - depth;
        const std::vector<float> truth = shares_of(voxels, shift);
        const auto side = int32_t(voxels.side() >> shift);
        CoverageField field(tree, depth, 2);
        EXPECT_EQ(field.placement().world_from_index(Vec3d::Zero()), Vec3d(5, 6, 7) + Vec3d::Constant(0.25 * (1 << shift)));
        EXPECT_EQ(field.placement().axes, 0.5 * (1 << shift) * Mat3d::Identity());
        std::vector<float> found(truth.size(), -1.0f);  // not given
        FieldBrickLayer layer;
        int32_t last = -8;
        while (field.next_layer(layer)) {
            EXPECT_EQ(layer.k % 8, 0);
            EXPECT_GT(layer.k, last);
            last = layer.k;
            ASSERT_EQ(layer.values.size(), layer.corners.size() * 512);
            EXPECT_TRUE(std::is_sorted(layer.corners.begin(), layer.corners.end(),
                                       [](const auto& a, const auto& b) { return a[1] != b[1] ? a[1] < b[1] : a[0] < b[0]; }));
            for (size_t brick = 0; brick < layer.corners.size(); ++brick) {
                bool any = false;
                for (int32_t s = 0; s < 512; ++s) {
                    const float value = layer.values[brick * 512 + size_t(s)];
                    any = any || value != 0;
                    const int32_t i = layer.corners[brick][0] + s % 8, j = layer.corners[brick][1] + s / 8 % 8, k = layer.k + s / 64;
                    if (i >= side || j >= side || k >= side) EXPECT_EQ(value, 0.0f);  // bricks are wider than a small tree
                    else found[size_t((k * side + j) * side + i)] = value;
                }
                EXPECT_TRUE(any);
            }
        }
        EXPECT_TRUE(layer.corners.empty());
        // What is not given is constant, and as said; and no two of them that touch differ.
        const int32_t bricks = std::max(1, side / 8);
        const auto absent = [&](int32_t i, int32_t j, int32_t k) {
            const bool outside = i < 0 || j < 0 || k < 0 || i >= bricks || j >= bricks || k >= bricks;
            return outside || found[size_t((8 * k * side + 8 * j) * side + 8 * i)] < 0.0f;
        };
        const auto said = [&](int32_t i, int32_t j, int32_t k) { return field.absent_value({8 * i, 8 * j, 8 * k}); };
        std::vector<float> filled = found;
        for (int32_t s = 0; s < side * side * side; ++s)
            if (float& value = filled[size_t(s)]; value < 0.0f) value = said(s % side / 8, s / side % side / 8, s / side / side / 8);
        ASSERT_EQ(filled, truth) << "depth " << depth;
        for (int32_t i = -1; i <= bricks; ++i)
            for (int32_t j = -1; j <= bricks; ++j)
                for (int32_t k = -1; k <= bricks; ++k) {
                    if (!absent(i, j, k)) continue;
                    for (int32_t step = 0; step < 27; ++step) {
                        const int32_t a = i + step % 3 - 1, b = j + step / 3 % 3 - 1, c = k + step / 9 - 1;
                        if (absent(a, b, c)) EXPECT_EQ(said(a, b, c), said(i, j, k));
                    }
                }
    }
}

INSTANTIATE_TEST_SUITE_P(CoverageField, CoverageFields, testing::Combine(testing::Range(0, 5), testing::Bool()));

TEST(CoverageField, RefusesDepthsThatAreNotThere) {
    const VoxelTree tree = tree_of(random_cube(2, 0.5, 1));
    EXPECT_THROW(CoverageField(tree, 0), Error);
    EXPECT_THROW(CoverageField(tree, 5), Error);
    EXPECT_THROW(CoverageField(VoxelTree{}, 1), Error);
}

// Half of 64^3 cells: 64 bricks in each of 8 layers.
TEST(CoverageField, RefusesALayerBeyondItsMemoryBeforeItTakesAny) {
    const VoxelTree tree = tree_of(random_cube(3, 0.5, 1));
    constexpr uint64_t kSamples = 64 * kFieldBrickSamples * sizeof(float);
    FieldBrickLayer layer;
    CoverageField little(tree, 6, 2, kSamples);  // of these, not of the rest
    try {
        little.next_layer(layer);
        ADD_FAILURE();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::limit);
        EXPECT_NE(std::string(error.what()).find("131072 are allowed"), std::string::npos) << error.what();
    }
    EXPECT_EQ(layer.values.capacity(), 0u);
    CoverageField enough(tree, 6, 2, kSamples + 64 * 24);
    int layers = 0;
    for (; enough.next_layer(layer); ++layers) EXPECT_EQ(layer.corners.size(), 64u);
    EXPECT_EQ(layers, 8);
}

// The surface where half of a cell is filled, of a ball of 100 voxels' radius: closed, and at half the cells' size a quarter as wrong.
TEST(CoverageField, SurfaceAtAHalfConvergesOnTheSolid) {
    constexpr double kRadius = 100.0;
    const Vec3d center(126.3, 128.9, 127.6);
    const VoxelTree tree = tree_of(
        cube_where(4, [&](uint32_t x, uint32_t y, uint32_t z) { return (Vec3d(x + 0.5, y + 0.5, z + 0.5) - center).norm() < kRadius; }),
        true);
    std::vector<double> volume_errors;
    for (const int shift : {4, 3, 2}) {
        CoverageField field(tree, tree.depth() - shift);
        SurfaceInMemory surface;
        contour_bricks(field, {.isovalues = {0.5}}, surface);
        const TriangleMesh mesh = surface.mesh();
        EXPECT_EQ(open_edges(mesh), 0u);
        const double truth = 4.0 / 3.0 * M_PI * kRadius * kRadius * kRadius;
        volume_errors.push_back(std::abs(volume_of(mesh) / truth - 1.0));
        double farthest = 0.0;
        for (const Vec3d& p : mesh.positions) farthest = std::max(farthest, std::abs((p - center).norm() - kRadius));
        // Across an axis shares fall from 1 to 0 within a cell; the line between two samples, one of them 1, meets 0.5 up to
        // (3 - 2 sqrt(2)) / 2 cells from where they do. Then what curvature adds, and half a voxel's diagonal.
        const double cell = std::ldexp(1.0, shift);
        EXPECT_LT(farthest, (1.5 - std::sqrt(2.0)) * cell + cell * cell / (8.0 * kRadius) + std::sqrt(0.75));
    }
    for (const size_t i : {0u, 1u}) {
        EXPECT_GT(volume_errors[i] / volume_errors[i + 1], 3.3);
        EXPECT_LT(volume_errors[i] / volume_errors[i + 1], 5.0);
    }
}

}  // namespace
}  // namespace strata
