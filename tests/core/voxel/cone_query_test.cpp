#include "core/voxel/cone_query.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <random>

#include "core/error.h"
#include "core/voxel/voxel_tree_builder.h"

namespace strata {
namespace {

using Sampling = ConeSettings::Sampling;

constexpr Sampling kSamplings[] = {Sampling::nearest, Sampling::linear};

// The voxels of a frame that a function says are occupied.
template <typename IsOccupied>
VoxelTree tree_of(int levels, const IsOccupied& is_occupied) {
    const VoxelFrame frame = {.levels = levels};
    VoxelTreeInMemory memory(frame, {.opacity = true});
    VoxelTreeBuilder builder(frame, {.opacity = true}, memory);
    VoxelBatch batch;
    for (uint64_t code = 0; code < uint64_t{1} << 6 * (levels - 1); ++code) {
        const std::array<uint32_t, 3> block = coordinates_of_code(code);
        uint64_t mask = 0;
        for (uint32_t bit = 0; bit < 64; ++bit) {
            const std::array<uint32_t, 3> cell = coordinates_of_code(bit);
            if (is_occupied(4 * block[0] + cell[0], 4 * block[1] + cell[1], 4 * block[2] + cell[2])) mask |= uint64_t{1} << bit;
        }
        if (mask != 0) batch.blocks.push_back({code, mask, 0});
    }
    builder.add(batch);
    builder.finish();
    return memory.take();
}

// Every cell of every depth is there, as opaque as a medium of one extinction (per voxel) makes it.
VoxelTree fog(int levels, double extinction) {
    VoxelTree tree;
    tree.frame.levels = levels;
    tree.levels.resize(size_t(levels));
    tree.attributes.resize(size_t(2 * levels) + 1);
    for (int level = 0; level < levels; ++level) tree.levels[size_t(level)].masks.assign(size_t{1} << 6 * level, kFullMask);
    for (int depth = 1; depth <= 2 * levels; ++depth) {
        const uint8_t opacity = uint8_t(std::lround(-255.0 * std::expm1(-extinction * std::ldexp(1.0, 2 * levels - depth))));
        tree.attributes[size_t(depth)].opacities.assign(size_t{1} << 3 * depth, {opacity, opacity, opacity});
    }
    index_tree(tree);
    return tree;
}

// Width of cells that a cone from far away looks at on its way through the frame: it hardly grows.
VoxelCone distant_cone(const Vec3d& through, const Vec3d& direction, double width, double before, double after) {
    constexpr double kFar = 1e6;
    return {.origin = through - kFar * direction.normalized(),
            .direction = direction,
            .tangent = 0.5 * width / kFar,
            .from = kFar - before,
            .to = kFar + after};
}

TEST(ConeQuery, FogFollowsBeerLambert) {
    constexpr double kExtinction = 0.02;
    const VoxelTree tree = fog(3, kExtinction);
    const Vec3d middle(32.0, 32.0, 32.0);
    for (const Sampling sampling : kSamplings)
        for (const double step : {0.21, 0.5, 1.0})
            for (const int cones : {1, 3})
                for (const double width : {0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 7.9, 8.0, 11.0, 16.0})
                    for (const Vec3d& direction : {Vec3d(1, 0, 0), Vec3d(0, -2, 0), Vec3d(1, 1, 1), Vec3d(-0.3, 0.1, 0.8)}) {
                        ConeQuery query(tree, {sampling, step, cones});
                        const double length = 20.0;
                        const double opacity = query.opacity(distant_cone(middle, direction, width, 0.5 * length, 0.5 * length));
                        // Opacities are rounded to 1/255: of the cells looked at the finest, which are the most, err most.
                        const double finest = width < 2.0 ? 1.0 : width / 2.0,
                                     error = 0.5 / 255.0 * std::exp(kExtinction * finest) / finest * length;
                        EXPECT_NEAR(-std::log1p(-opacity), kExtinction * length, error) << "step " << step << ", width " << width;
                    }
}

// The same with a cone that becomes wider on its way, through all depths but the coarsest two, whose cells reach out of the fog.
TEST(ConeQuery, FogInAnOpeningCone) {
    const VoxelTree tree = fog(3, 0.02);
    for (const Sampling sampling : kSamplings)
        for (const double step : {0.3, 1.0}) {
            ConeQuery query(tree, {sampling, step, 1});
            const VoxelCone cone = {.origin = {8.0, 32.0, 32.0}, .direction = {1, 0, 0}, .tangent = 0.1, .from = 1.0, .to = 40.0};
            EXPECT_NEAR(-std::log1p(-query.opacity(cone)), 0.02 * 39.0, 0.05);
        }
}

TEST(ConeQuery, NothingHidesNothingAndAllHidesAll) {
    VoxelTree none;
    const VoxelTree empty = tree_of(2, [](uint32_t, uint32_t, uint32_t) { return false; });
    const VoxelTree all = tree_of(3, [](uint32_t, uint32_t, uint32_t) { return true; });
    const VoxelTree far_corner = tree_of(3, [](uint32_t x, uint32_t y, uint32_t z) { return x > 60 && y > 60 && z > 60; });
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    for (const Sampling sampling : kSamplings)
        for (int i = 0; i < 200; ++i) {
            const Vec3d direction(normal(random), normal(random), normal(random));
            const VoxelCone cone = {.origin = Vec3d::Constant(32.0) - 20.0 * direction, .direction = direction, .tangent = 0.02 * (i % 8)};
            EXPECT_EQ(ConeQuery(none, {sampling}).opacity(cone), 0.0);
            EXPECT_EQ(ConeQuery(empty, {sampling}).opacity(cone), 0.0);
            EXPECT_EQ(ConeQuery(all, {sampling}).opacity(cone), 1.0);
            VoxelCone away = cone;
            away.origin = Vec3d(20.0, 20.0, 20.0);
            away.direction = -direction.cwiseAbs();
            EXPECT_EQ(ConeQuery(far_corner, {sampling}).opacity(away), 0.0);
        }
}

// A wall of one voxel is opaque from the front in cells of any width.
TEST(ConeQuery, WallFromTheFront) {
    for (int axis = 0; axis < 3; ++axis)
        for (const uint32_t at : {7u, 8u, 32u, 45u}) {
            const VoxelTree tree = tree_of(3, [&](uint32_t x, uint32_t y, uint32_t z) { return std::array{x, y, z}[size_t(axis)] == at; });
            for (const Sampling sampling : kSamplings)
                for (const double step : {0.1, 0.5, 1.0})
                    for (const double width : {0.1, 1.0, 1.3, 2.0, 4.0, 6.0, 8.0, 16.0}) {
                        ConeQuery query(tree, {sampling, step, 1});
                        EXPECT_EQ(query.opacity(distant_cone({32.2, 31.7, 32.1}, Vec3d::Unit(axis), width, 1e3, 1e3)), 1.0)
                            << "width " << width << ", step " << step;
                        EXPECT_EQ(query.opacity(distant_cone({32.2, 31.7, 32.1}, -Vec3d::Unit(axis), width, 1e3, 1e3)), 1.0);
                    }
        }
}

// From the side it is thin: half of the columns of a cell twice as wide are empty, and a column of two cells hides what both do, as if they
// lay at random. It hides 1 - (1 - opacity)^(length / width).
TEST(ConeQuery, WallFromTheSide) {
    const VoxelTree tree = tree_of(3, [](uint32_t x, uint32_t, uint32_t) { return x == 32; });
    double opacity_of_cell = 1.0;
    for (const double width : {2.0, 4.0, 8.0, 16.0}) {
        opacity_of_cell = 0.5 * (1.0 - std::pow(1.0 - opacity_of_cell, 2.0));
        for (const double step : {0.25, 1.0}) {
            ConeQuery query(tree, {Sampling::nearest, step, 1});
            for (const double length : {8.0, 16.0}) {
                const double cells = length / width,
                             opacity = query.opacity(distant_cone({32.5, 32.5, 32.5}, {0, 0, 1}, width, 0.5 * length, 0.5 * length));
                // 1/510 of rounding in each cell, in the logarithm, and a little of its square.
                EXPECT_NEAR(std::log1p(-opacity), cells * std::log1p(-opacity_of_cell), cells / (1.0 - opacity_of_cell) / 480.0)
                    << "width " << width;
            }
        }
    }
    ConeQuery thin(tree, {Sampling::nearest, 1.0, 1});
    EXPECT_EQ(thin.opacity(distant_cone({32.5, 32.5, 32.5}, {0, 0, 1}, 1.0, 32.0, 32.0)), 1.0);
    EXPECT_EQ(thin.opacity(distant_cone({31.5, 32.5, 32.5}, {0, 0, 1}, 1.0, 32.0, 32.0)), 0.0);
}

// Half a wall, seen from the front by cones around its edge: interpolated opacity is the covered part of the cone's square.
TEST(ConeQuery, EdgeOfAWall) {
    const VoxelTree tree = tree_of(3, [](uint32_t x, uint32_t y, uint32_t) { return x == 32 && y < 32; });
    for (const double width : {1.001, 2.0, 4.0, 8.0})
        for (const double offset : {-0.5, -0.3, 0.0, 0.2, 0.5}) {
            ConeQuery query(tree, {Sampling::linear, 0.125, 1});
            const double opacity = query.opacity(distant_cone({32.0, 32.0 + offset * width, 32.0}, {1, 0, 0}, width, 40.0, 40.0));
            // Along the cone the optical depths of two slices come together, which are what this part hides: exactly.
            EXPECT_NEAR(opacity, 0.5 - offset, 0.01) << "width " << width << ", offset " << offset;
        }
}

// Of a cloud of spheres, in cones of many widths: more cones come nearer to the truth, which a walk along many rays says.
TEST(ConeQuery, MoreConesComeNearerToTheTruth) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform;
    std::vector<std::pair<Vec3d, double>> spheres;
    for (int i = 0; i < 12; ++i)
        spheres.push_back({64.0 * Vec3d(uniform(random), uniform(random), uniform(random)), 2.0 + 6.0 * uniform(random)});
    const VoxelTree tree = tree_of(3, [&](uint32_t x, uint32_t y, uint32_t z) {
        return std::any_of(spheres.begin(), spheres.end(),
                           [&](const auto& sphere) { return (Vec3d(x + 0.5, y + 0.5, z + 0.5) - sphere.first).norm() < sphere.second; });
    });
    std::vector<VoxelCone> cones;
    std::vector<double> truth;
    for (int i = 0; i < 100; ++i) {
        const Vec3d origin = 64.0 * Vec3d(uniform(random), uniform(random), uniform(random)),
                    to = spheres[size_t(i) % spheres.size()].first;
        cones.push_back({.origin = origin, .direction = to - origin, .tangent = 0.05 + 0.3 * uniform(random), .from = 4.0});
        const Vec3d axis = cones.back().direction.normalized(), right = axis.unitOrthogonal(), up = axis.cross(right);
        int rays = 0, hidden = 0;
        for (int y = 0; y < 16; ++y)
            for (int x = 0; x < 16; ++x) {
                const double u = (x + 0.5) / 8.0 - 1.0, v = (y + 0.5) / 8.0 - 1.0;
                if (u * u + v * v > 1.0) continue;
                const Vec3d direction = (axis + cones.back().tangent * (u * right + v * up)).normalized();
                ++rays;
                for (double t = 4.0; t < 111.0; t += 0.125) {
                    const Vec3d p = origin + t * direction;
                    if (p.minCoeff() < 0.0 || p.maxCoeff() >= 64.0 || !is_occupied(tree, uint32_t(p.x()), uint32_t(p.y()), uint32_t(p.z())))
                        continue;
                    ++hidden;
                    break;
                }
            }
        truth.push_back(double(hidden) / rays);
    }
    const auto rms = [&](const ConeSettings& settings) {
        ConeQuery query(tree, settings);
        double sum = 0.0;
        for (size_t i = 0; i < cones.size(); ++i) sum += std::pow(query.opacity(cones[i]) - truth[i], 2.0);
        return std::sqrt(sum / double(cones.size()));
    };
    for (const Sampling sampling : kSamplings) {
        const double one = rms({sampling, 0.5, 1}), four = rms({sampling, 0.5, 4}), sixty_four = rms({sampling, 0.5, 64});
        EXPECT_LT(one, 0.2);
        EXPECT_LT(four, 0.8 * one);
        EXPECT_LT(sixty_four, 0.8 * four);
        RecordProperty(sampling == Sampling::nearest ? "nearest" : "linear",
                       std::to_string(one) + " " + std::to_string(four) + " " + std::to_string(sixty_four));
    }
}

// Ways that the walk keeps from one cone to the next do not show.
TEST(ConeQuery, OrderDoesNotShow) {
    const VoxelTree tree =
        tree_of(3, [](uint32_t x, uint32_t y, uint32_t z) { return (x * 7 + y * 13 + z * 31) % 97 == 0 || (x > 40 && y > 40 && z < 20); });
    std::mt19937 random(6);
    std::normal_distribution<double> normal;
    ConeQuery one(tree);
    for (int i = 0; i < 300; ++i) {
        const Vec3d direction(normal(random), normal(random), normal(random));
        const VoxelCone cone = {.origin = Vec3d::Constant(32.0) + 30.0 * Vec3d(normal(random), normal(random), normal(random)),
                                .direction = direction,
                                .tangent = 0.05 * (i % 6)};
        ConeQuery fresh(tree);
        EXPECT_EQ(one.opacity(cone), fresh.opacity(cone));
    }
}

// Full cells have no nodes below; a tree may end above its frame's voxels. The cones' width, which is not quite that of a cell, looks a
// little at finer cells where there are some.
TEST(ConeQuery, FullCellsAndCoarseTrees) {
    const VoxelTree fine = tree_of(3, [](uint32_t x, uint32_t y, uint32_t) { return x < 32 && y < 48; });
    VoxelTree coarse = fine;
    coarse.levels.resize(2);
    coarse.levels[1].first_child.clear();
    coarse.levels[1].full.clear();
    coarse.attributes.resize(5);
    for (const double width : {4.002, 8.0, 16.0})
        for (const double y : {10.0, 47.0, 49.0}) {
            const VoxelCone cone = distant_cone({32.0, y, 32.0}, {1, 0, 0}, width, 100.0, 100.0);
            EXPECT_NEAR(ConeQuery(coarse).opacity(cone), ConeQuery(fine).opacity(cone), 2e-3) << "width " << width;
        }
}

TEST(ConeQuery, RaysOutsideAndFarAway) {
    const VoxelTree tree = tree_of(2, [](uint32_t, uint32_t, uint32_t) { return true; });
    ConeQuery query(tree);
    EXPECT_EQ(query.opacity({.origin = {-1e9, 8.0, 8.0}, .direction = {1, 0, 0}, .tangent = 1e-12}), 1.0);
    EXPECT_EQ(query.opacity({.origin = {-1e9, 8.0, 8.0}, .direction = {-1, 0, 0}, .tangent = 0.5}), 0.0);
    EXPECT_EQ(query.opacity({.origin = {-1e9, 100.0, 8.0}, .direction = {1, 0, 0}, .tangent = 1e-12}), 0.0);
    EXPECT_LE(query.opacity({.origin = {-1e300, 8.0, 8.0}, .direction = {1, 0, 0}, .tangent = 0.5}), 1.0);  // ends
    EXPECT_EQ(query.opacity({.origin = {8.0, 8.0, 8.0}, .direction = {0, 0, 1}, .from = 5.0, .to = 4.0}), 0.0);
}

TEST(ConeQuery, TreesWithoutOpacityAreRefused) {
    VoxelTree tree = tree_of(2, [](uint32_t x, uint32_t, uint32_t) { return x == 3; });
    tree.attributes.clear();
    EXPECT_THROW(ConeQuery query(tree), Error);
}

}  // namespace
}  // namespace strata
