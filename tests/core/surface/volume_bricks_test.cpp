#include "core/surface/volume_bricks.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "core/error.h"
#include "core/math/random.h"
#include "core/surface/cube_surface.h"
#include "core/surface/surface_report.h"
#include "tests/support/field_source.h"
#include "tests/support/store_in_memory.h"
#include "tests/support/surface_in_memory.h"

namespace strata {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

struct Cubes {
    CubeSurfaceCounts counts;
    SurfaceInMemory surface;
    SurfaceReport report;
};

Cubes cubes_of(SliceSource& source, const VolumeBricksSettings& settings, const CubeSurfaceSettings& how = {}) {
    const VolumeBricks bricks(source, settings);
    Cubes cubes;
    cubes.counts = mesh_cubes(bricks, how, cubes.surface);
    EXPECT_FALSE(cubes.surface.refers_ahead);
    cubes.report = measure_surface(cubes.surface.mesh());
    return cubes;
}

double ball(int i, int j, int k) { return (i - 16) * (i - 16) + (j - 16) * (j - 16) + (k - 16) * (k - 16) <= 256 ? 1.0 : 0.0; }

// The ball of integers, as known from other cubes of it.
TEST(VolumeBricks, TheBallOfIntegers) {
    test::FunctionSlices source({32, 32, 32}, ball);
    const Cubes cubes = cubes_of(source, {.isovalue = 0.5});
    EXPECT_EQ(cubes.counts.solid_voxels, 17'074u);
    EXPECT_EQ(cubes.counts.faces_uncut, 102'444u);
    EXPECT_EQ(cubes.counts.faces_culled, 4'770u);
    EXPECT_LE(cubes.counts.rectangles, 2'100u);
    EXPECT_EQ(cubes.report.volume, 17'074.0);
    EXPECT_EQ(cubes.report.area, 4'770.0);
    EXPECT_EQ(open_edges(cubes.surface.mesh()), 0u);
}

// Over several bricks in every direction, the last ones narrow: what noise has to show, whatever the threads and the memory, and what the inverse of it has.
TEST(VolumeBricks, NoiseShowsTheFacesThatTheRuleSays) {
    constexpr std::array<uint32_t, 3> kSize = {67, 65, 66};
    std::vector<uint8_t> cells(size_t{kSize[0]} * kSize[1] * kSize[2]);
    Random random(7);
    uint64_t solid = 0;
    for (size_t n = 0; n < cells.size(); ++n) solid += cells[n] = random.uniform(0.0, 1.0) < (n / kSize[0] / kSize[1] < 60 ? 0.02 : 0.9);
    const auto at = [&](int i, int j, int k) { return i >= 0 && j >= 0 && k >= 0 && i < int(kSize[0]) && j < int(kSize[1]) && k < int(kSize[2]) && cells[(size_t(k) * kSize[1] + size_t(j)) * kSize[0] + size_t(i)] != 0; };
    uint64_t faces = 0;
    for (int k = 0; k < int(kSize[2]); ++k)
        for (int j = 0; j < int(kSize[1]); ++j)
            for (int i = 0; i < int(kSize[0]); ++i)
                if (at(i, j, k)) faces += uint64_t(!at(i + 1, j, k)) + !at(i - 1, j, k) + !at(i, j + 1, k) + !at(i, j - 1, k) + !at(i, j, k + 1) + !at(i, j, k - 1);
    GridPlacement placement;  // leaning, and left-handed
    placement.origin = {100, -50, 7};
    placement.axes << 0, 0.5, 0.25, 2, 0, 0.125, 0, 0, 1.5;
    ASSERT_LT(placement.axes.determinant(), 0.0);
    std::vector<Vec3d> first;
    test::StoreInMemory scratch;
    for (const bool small : {false, true})
        for (const int threads : {1, 3}) {
            test::FunctionSlices source(kSize, [&](int i, int j, int k) { return at(i, j, k) ? 3.0 : -1.0; }, placement);
            VolumeBricksSettings settings = {.isovalue = 3.0};  // equal is inside
            if (small) settings.memory_bytes = 300'000, settings.scratch = &scratch;
            const Cubes cubes = cubes_of(source, settings, {.normals = threads > 1, .threads = threads});
            EXPECT_EQ(cubes.counts.solid_voxels, solid);
            EXPECT_EQ(cubes.counts.faces_culled, faces);
            EXPECT_NEAR(cubes.report.volume, double(solid) * 1.5, 1e-5 * double(solid));  // a cell has 1/2 x 2 x 3/2
            EXPECT_EQ(open_edges(cubes.surface.mesh()), 0u);
            if (threads > 1) {
                for (const auto& t : cubes.surface.triangles) {
                    const auto& p = cubes.surface.positions;
                    const Vec3d normal = (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]).normalized();
                    ASSERT_NEAR(normal.dot(cubes.surface.normals[t[0]].cast<double>()), 1.0, 1e-4);
                }
                continue;
            }
            if (first.empty()) first = cubes.surface.positions;
            EXPECT_EQ(cubes.surface.positions, first);
        }
    EXPECT_GT(scratch.size(), 0u);
    // The first sample's cell is around it.
    Box3d box;
    for (const Vec3d& p : first) box.extend(p);
    EXPECT_NEAR((box.min - placement.world_from_index({-0.5, -0.5, -0.5})).norm(), 0.0, 1e-4);
    // Below instead of above, with what is unknown on neither side.
    test::FunctionSlices source(kSize, [&](int i, int j, int k) { return i == 5 ? double(kUnknown) : at(i, j, k) ? 3.0 : -1.0; }, placement);
    const VolumeBricks below(source, {.isovalue = -1.0, .inside = ContourInside::below});
    uint64_t unknown_solid = 0;
    for (int k = 0; k < int(kSize[2]); ++k)
        for (int j = 0; j < int(kSize[1]); ++j) unknown_solid += at(5, j, k);
    EXPECT_EQ(below.nan_samples(), uint64_t{kSize[1]} * kSize[2]);
    EXPECT_EQ(below.cells(), cells.size() - below.nan_samples() - (solid - unknown_solid));
}

// A block of two layers of labels in a third one, far larger than a brick: no face where labels meet, each face with its label's color.
TEST(VolumeBricks, LabelsAreMaterials) {
    const auto label = [](int i, int j, int k) { return i < 2 || j < 2 || k < 2 || i >= 98 || j >= 98 || k >= 98 ? 0.0 : k < 50 ? -3.0 : k < 80 ? 300.0 : 7.0; };
    std::vector<int32_t> asked;
    const auto color_of = [&](int32_t value) {
        asked.push_back(value);
        return VoxelColor{uint8_t(value == -3 ? 200 : 0), uint8_t(value == 300 ? 200 : 0), uint8_t(value == 7 ? 200 : 0)};
    };
    test::FunctionSlices source({100, 100, 100}, label);
    const Cubes cubes = cubes_of(source, {.color_of = color_of});
    EXPECT_EQ(asked, (std::vector<int32_t>{-3, 300, 7}));
    EXPECT_EQ(cubes.counts.solid_voxels, 96u * 96u * 96u);
    EXPECT_EQ(cubes.counts.faces_culled, 6u * 96u * 96u);
    EXPECT_EQ(open_edges(cubes.surface.mesh()), 0u);
    EXPECT_EQ(cubes.report.volume, 96.0 * 96.0 * 96.0);
    for (size_t v = 0; v < cubes.surface.positions.size(); ++v) {
        const double k = cubes.surface.positions[v].z();
        const auto& c = cubes.surface.colors[v];
        EXPECT_TRUE(c[0] == 200 ? k <= 49.5 : c[1] == 200 ? k >= 49.5 && k <= 79.5 : k >= 79.5) << k;
    }
    // A middle of glass shows the others' faces through it, and its own.
    test::FunctionSlices again({100, 100, 100}, label);
    test::StoreInMemory scratch;
    const VolumeBricks bricks(again, {.color_of = color_of, .memory_bytes = 4'500'000, .scratch = &scratch});
    EXPECT_GT(scratch.size(), 0u);
    ASSERT_EQ(bricks.labels().size(), 3u);
    EXPECT_EQ(bricks.labels()[1].value, 300);
    EXPECT_EQ(bricks.labels()[1].cells, 96u * 96u * 30u);
    SurfaceInMemory glass;
    const CubeSurfaceCounts counts = mesh_cubes(bricks, {.transparent = {{{0, 200, 0}, uint8_t{90}}}}, glass);
    EXPECT_EQ(counts.faces_culled, 6u * 96u * 96u + 2u * 96u * 96u);
}

// Of more than 256 labels in a brick each keeps its color.
TEST(VolumeBricks, ManyLabels) {
    test::FunctionSlices source({70, 40, 3}, [](int i, int j, int k) { return k == 1 && i % 2 == 0 && j % 2 == 0 ? 1 + i / 2 + 100 * (j / 2) : 0.0; });
    const Cubes cubes = cubes_of(source, {.color_of = [](int32_t value) { return VoxelColor{uint8_t(value), uint8_t(value >> 8), 1}; }});
    EXPECT_EQ(cubes.counts.solid_voxels, 35u * 20u);
    EXPECT_EQ(cubes.counts.faces_culled, 6u * 35u * 20u);
    for (size_t v = 0; v < cubes.surface.positions.size(); ++v) {
        const Vec3d p = cubes.surface.positions[v];
        const int value = cubes.surface.colors[v][0] + 256 * cubes.surface.colors[v][1] - 1, i = 2 * (value % 100), j = 2 * (value / 100);
        ASSERT_LE((p - Vec3d(i, j, 1)).cwiseAbs().maxCoeff(), 0.5) << p.transpose();
    }
}

// As many as may be, one more, and memory for those that the caller keeps something of.
TEST(VolumeBricks, LabelsAreCounted) {
    const auto number = [](int i, int j, int) { return 1.0 + i + 1024.0 * j; };
    const auto black = [](int32_t) { return VoxelColor{}; };
    test::FunctionSlices most({1024, 1024, 1}, number);
    EXPECT_EQ(VolumeBricks(most, {.color_of = black}).labels().size(), VolumeBricks::kMostLabels);
    test::FunctionSlices more({1024, 1025, 1}, number);
    try {
        VolumeBricks(more, {.color_of = black});
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::limit);
        EXPECT_STREQ(error.what(), "sample (0, 1024, 0): one more label than the 1048576 that there may be");
    }
    test::FunctionSlices few({10, 10, 1}, number), again({10, 10, 1}, number);
    EXPECT_EQ(VolumeBricks(few, {.color_of = black, .memory_bytes = 5'000'000}).labels().size(), 100u);
    EXPECT_THROW(VolumeBricks(again, {.color_of = black, .label_bytes = 50'000, .memory_bytes = 5'000'000}), Error);
}

TEST(VolumeBricks, WhatIsNoLabelIsRefused) {
    const auto message = [](double value) {
        test::FunctionSlices source({4, 4, 4}, [&](int i, int j, int k) { return i == 1 && j == 2 && k == 3 ? value : 1.0; });
        try {
            VolumeBricks(source, {.color_of = [](int32_t) { return VoxelColor{}; }});
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::malformed);
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(message(0.5), "sample (1, 2, 3): a label is expected, a whole number of less than 2^24, it is 0.5");
    EXPECT_EQ(message(16'777'216.0), "sample (1, 2, 3): a label is expected, a whole number of less than 2^24, it is 16777216");
    EXPECT_NE(message(1e30), "");
    EXPECT_EQ(message(-16'777'215.0), "");
    EXPECT_EQ(message(kUnknown), "");
    test::FunctionSlices source({64, 64, 64}, ball);
    EXPECT_THROW(VolumeBricks(source, {.isovalue = 0.5, .memory_bytes = 40'000}), Error);
    // Nothing is read, or set aside, for more than can be numbered; and messages say of which volume they are.
    const auto limit = [](std::array<uint32_t, 3> size, const VolumeBricksSettings& settings) {
        test::FunctionSlices slices(size, ball);
        try {
            VolumeBricks(slices, settings);
        } catch (const Error& error) {
            EXPECT_EQ(error.kind, ErrorKind::limit);
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(limit({4'000'000'000, 4'000'000'000, 4'000'000'000}, {}), "4000000000 x 4000000000 x 4000000000 samples: cubes are made of at most 2^40 a slice, and of 2^32 - 1 bricks of 64^3");
    EXPECT_EQ(limit({1 << 20, 1 << 20, 1 << 10}, {.place = "a.nrrd"}), "a.nrrd: 1048576 x 1048576 x 1024 samples: cubes are made of at most 2^40 a slice, and of 2^32 - 1 bricks of 64^3");
    EXPECT_EQ(limit({64, 64, 64}, {.place = "a.nrrd", .isovalue = 0.5, .memory_bytes = 40'000}), "a.nrrd: cells of the volume need 49156 bytes of memory or more, 40000 are allowed; a coarser volume needs less");
    // What bricks hold counts where their faces are made.
    test::FunctionSlices one_ball({64, 64, 64}, ball);
    const VolumeBricks bricks(one_ball, {.isovalue = 0.5});
    EXPECT_GT(bricks.memory_bytes(), 4096u * 8);
    SurfaceInMemory surface;
    try {
        mesh_cubes(bricks, {.memory_bytes = bricks.memory_bytes()}, surface);
        FAIL();
    } catch (const Error& error) {
        EXPECT_EQ(error.what(), "faces of cubes need " + std::to_string(bricks.memory_bytes() + 48) + " bytes of memory or more, " + std::to_string(bricks.memory_bytes()) + " are allowed; a coarser volume needs less");
    }
    test::FunctionSlices none({64, 64, 64}, [](int, int, int) { return 0.0; });
    const Cubes empty = cubes_of(none, {.isovalue = 0.5});
    EXPECT_EQ(empty.counts.solid_voxels, 0u);
    EXPECT_TRUE(empty.surface.positions.empty());
}

}  // namespace
}  // namespace strata
