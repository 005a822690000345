#include "core/surface/field_surface.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/math/random.h"
#include "core/surface/field_rays.h"
#include "tests/support/field_source.h"

namespace strata {
namespace {

using test::FunctionBricks;
using test::FunctionSlices;

constexpr uint64_t kAmple = uint64_t{1} << 30;

// Random samples, many of them equal, some missing.
std::vector<float> random_samples(Random& random, size_t count, double missing) {
    std::vector<float> samples(count);
    for (float& value : samples) value = random.uniform() < missing ? std::nanf("") : float(std::round(random.normal()));
    return samples;
}

// By the definition: corners on both sides, none missing.
void expect_cells(const FieldBricks& field, const IsoLevel& level, const VoxelTree& tree) {
    const std::array<int32_t, 3> cells = field.cells();
    size_t occupied = 0;
    for (int32_t k = 0; k < cells[2]; ++k)
        for (int32_t j = 0; j < cells[1]; ++j)
            for (int32_t i = 0; i < cells[0]; ++i) {
                int inside = 0, missing = 0;
                const bool last = i + 1 == cells[0] || j + 1 == cells[1] || k + 1 == cells[2];
                const std::array<float, 8> corners = last ? field.cube<2>({i, j, k}) : field.corners({i, j, k});
                for (int n = 0; n < 8; ++n) {
                    const float value = field.sample(i + (n & 1), j + (n >> 1 & 1), k + (n >> 2));
                    ASSERT_TRUE(value == corners[size_t(n)] || (std::isnan(value) && std::isnan(corners[size_t(n)])));
                    inside += level.inside == ContourInside::above ? value >= level.isovalue : value <= level.isovalue;
                    missing += std::isnan(value);
                }
                const bool crossed = missing == 0 && inside > 0 && inside < 8;
                ASSERT_EQ(crossed, is_occupied(tree, uint32_t(i), uint32_t(j), uint32_t(k))) << i << ' ' << j << ' ' << k;
                occupied += crossed;
            }
    EXPECT_EQ(occupied, count_voxels(tree));
}

TEST(FieldSurface, CellsHaveCornersOnBothSides) {
    Random random(1);
    size_t cells = 0;
    for (int round = 0; round < 24; ++round) {
        const std::array<uint32_t, 3> size = {1 + uint32_t(random.uniform() * 30), 1 + uint32_t(random.uniform() * 30),
                                              1 + uint32_t(random.uniform() * 30)};
        const std::vector<float> samples = random_samples(random, size_t(size[0]) * size[1] * size[2], round % 3 == 0 ? 0.05 : 0.0);
        FunctionSlices source(size, [&](int i, int j, int k) { return double(samples[(size_t(k) * size[1] + size_t(j)) * size[0] + size_t(i)]); });
        const FieldBricks field = FieldBricks::of_slices(source, kAmple, 2);
        // A value of samples, one between two, and one that few reach.
        const IsoLevel level = {round % 4 == 0 ? 1.0 : round % 4 == 1 ? 0.5 : 2.0 - 1e-9, round % 2 == 0 ? ContourInside::above : ContourInside::below};
        const VoxelTree tree = surface_cells(field, level, 1, kAmple);
        expect_cells(field, level, tree);
        cells += count_voxels(tree);
        for (const SimdLevel simd : simd_levels()) {
            const VoxelTree other = surface_cells(field, level, 3, kAmple, simd);
            for (size_t n = 0; n < tree.levels.size(); ++n) {
                EXPECT_EQ(tree.levels[n].masks, other.levels[n].masks);
                EXPECT_EQ(tree.levels[n].first_child, other.levels[n].first_child);
            }
        }
    }
    EXPECT_GT(cells, 20'000u);
}

// Bricks here and there, of noise and of one value: what lies between is what the source says of it.
TEST(FieldSurface, CellsBesideBricks) {
    Random random(2);
    const std::vector<float> samples = random_samples(random, 64 * 64 * 64, 0.0);
    FunctionBricks source(
        {-4, -4, -4}, {4, 4, 4}, -1.0f,
        [&](int i, int j, int k) { return double(samples[size_t(((k + 32) * 64 + j + 32) * 64 + i + 32)]); },
        [](int i, int j, int k) { return double((i * 7 + j * 5 + k * 3) % 6 == 0); });
    source.set_absent([](int i, int, int) { return i < 0 ? -1.0 : 1.0; });
    const FieldBricks field = FieldBricks::of_bricks(source, kAmple, 2);
    const VoxelTree tree = surface_cells(field, {0.5}, 2, kAmple);
    expect_cells(field, {0.5}, tree);
    EXPECT_GT(count_voxels(tree), 1000u);
    EXPECT_TRUE(surface_cells(field, {1e9}, 2, kAmple).empty());
}

// 88 bytes a brick for what is crossed in it, then 16 for each block of 4^3 cells with any.
TEST(FieldSurface, CellsKeepToTheirMemory) {
    FunctionSlices source({60, 50, 40}, [](int i, int j, int k) { return (Vec3d(i, j, k) - Vec3d(30, 25, 20)).norm(); });
    const FieldBricks field = FieldBricks::of_slices(source, kAmple, 2);
    const IsoLevel level = {15.0, ContourInside::below};
    const VoxelTree tree = surface_cells(field, level, 2, kAmple);
    const uint64_t bricks = count_crossed_bricks(field, level), first = 88 * bricks, needed = first + 16 * tree.levels.back().masks.size();
    EXPECT_GT(bricks, 50u);
    EXPECT_EQ(surface_cells(field, level, 2, needed).levels.back().masks, tree.levels.back().masks);
    for (const uint64_t memory_bytes : {uint64_t{0}, first - 1, needed - 1}) {
        try {
            surface_cells(field, level, 2, memory_bytes);
            ADD_FAILURE() << memory_bytes;
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::limit);
            const std::string text = "the cells of a surface need " + std::to_string(memory_bytes < first ? first : needed) + " bytes of memory, " + std::to_string(memory_bytes) + " are left";
            EXPECT_EQ(error.what(), text);
        }
    }
}

// Rays of a tile, of each instruction set, find what each finds alone, to the last bit.
TEST(FieldSurface, TilesOfRaysFindWhatSingleRaysFind) {
    Random random(3);
    size_t hits = 0, misses = 0;
    for (int round = 0; round < 16; ++round) {
        const bool noise = round % 4 == 0;
        const std::vector<float> samples = random_samples(random, 50 * 50 * 50, 0.02);
        const double radius = random.uniform(5, 24);
        FunctionSlices source({50, 50, 50}, [&](int i, int j, int k) {
            return noise ? double(samples[size_t((k * 50 + j) * 50 + i)]) : (Vec3d(i, j, k) - Vec3d(25, 24, 26)).norm() - radius;
        });
        const FieldBricks field = FieldBricks::of_slices(source, kAmple, 2);
        const FieldSurface surface(field, {noise ? 1.0 : 0.0, ContourInside::below});
        const Vec3d eye(random.uniform(-40, 90), random.uniform(-40, 90), random.uniform(-40, 90)), forward = (Vec3d(25, 25, 25) - eye).normalized();
        const Vec3d right = forward.unitOrthogonal(), down = forward.cross(right);
        VoxelTile tile{.first = {eye, forward - 0.6 * right - 0.6 * down}, .width = 45, .height = 39};
        if (round % 2 == 0) {
            tile.direction_per_x = 0.03 * right;
            tile.direction_per_y = 0.03 * down;
        } else {
            tile.first = {eye - 30 * right - 30 * down, round % 3 == 0 ? Vec3d(0, 0, eye.z() < 25 ? 1 : -1) : forward};
            tile.origin_per_x = 1.3 * right;
            tile.origin_per_y = 1.5 * down;
        }
        const double least_t = round % 3 == 1 ? 35.5 : 0.0, most_t = round % 5 == 1 ? 50.0 : std::numeric_limits<double>::infinity();
        for (const SimdLevel simd : simd_levels()) {
            std::vector<FieldHit> found(size_t(tile.width) * size_t(tile.height));
            cast_tile(surface, tile, least_t, most_t, found, simd);
            for (int y = 0; y < tile.height; ++y)
                for (int x = 0; x < tile.width; ++x) {
                    const FieldHit& in_tile = found[size_t(y) * size_t(tile.width) + size_t(x)];
                    const auto alone = cast_ray(surface, tile.ray(x, y), least_t, most_t);
                    ASSERT_EQ(alone.has_value(), std::isfinite(in_tile.t)) << round << ": " << x << ' ' << y;
                    alone ? ++hits : ++misses;
                    if (!alone) continue;
                    ASSERT_EQ(alone->t, in_tile.t);
                    ASSERT_EQ(alone->cell, in_tile.cell);
                    ASSERT_EQ(alone->from_inside, in_tile.from_inside);
                    ASSERT_GE(alone->t, least_t);
                    ASSERT_LE(alone->t, most_t);
                }
        }
    }
    EXPECT_GT(hits, 5000u);
    EXPECT_GT(misses, 5000u);
}

}  // namespace
}  // namespace strata
