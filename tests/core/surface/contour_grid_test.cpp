#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/error.h"
#include "core/math/random.h"
#include "core/surface/contour.h"
#include "core/surface/slab_contour.h"
#include "tests/support/surface_shape.h"

namespace strata {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

ScalarGrid grid_of(const std::array<uint32_t, 3>& size, const std::function<double(const Vec3d&)>& value,
                   const GridPlacement& placement = {}) {
    ScalarGrid grid{.placement = placement, .size = size, .values = {}};
    for (uint32_t k = 0; k < size[2]; ++k)
        for (uint32_t j = 0; j < size[1]; ++j)
            for (uint32_t i = 0; i < size[0]; ++i)
                grid.values.push_back(float(value(placement.world_from_index({double(i), double(j), double(k)}))));
    return grid;
}

struct Contoured {
    ContourMesh mesh;
    ContourReport report;

    SurfaceShape shape() const {
        return shape_of({mesh.positions.data(), mesh.positions.size()}, {mesh.triangles.data(), mesh.triangles.size()});
    }
};

Contoured contour(const ScalarGrid& grid, const ContourSettings& settings) {
    Contoured out;
    out.report = contour_grid(grid.placement, grid.size, grid.values, settings, out.mesh);
    EXPECT_EQ(out.report.vertices, out.mesh.positions.size());
    EXPECT_EQ(out.report.triangles, out.mesh.triangles.size());
    return out;
}

template <typename T>
std::string bytes_of(const LargeArray<T>& array) {
    return {reinterpret_cast<const char*>(array.data()), array.size() * sizeof(T)};
}
std::string bytes_of(const ContourMesh& mesh) { return bytes_of(mesh.positions) + bytes_of(mesh.normals) + bytes_of(mesh.triangles); }

// A placement by rotation, unequal spacing and a shear.
GridPlacement leaning_placement(bool mirrored) {
    GridPlacement placement{.origin = {500000.0, -20.0, 7.0}, .axes = Mat3d::Identity()};
    placement.axes.col(0) = Vec3d(0.8, 0.1, 0.0);
    placement.axes.col(1) = Vec3d(-0.2, 1.3, 0.3);
    placement.axes.col(2) = Vec3d(0.1, 0.0, mirrored ? -0.5 : 0.5);
    return placement;
}

// On exact distances, linear interpolation along an edge of length h errs by at most h^2 / 8 times the greatest second derivative, 1 / r,
// and r on the edge is at least R - h.
TEST(ContourGrid, SphereIsWithinItsBoundAndClosed) {
    const double radius = 20.3;
    const Vec3d center(25.1, 24.8, 25.4);
    const auto found = contour(grid_of({51, 52, 53}, [&](const Vec3d& p) { return (p - center).norm() - radius; }),
                               {.isovalues = {0.0}, .inside = ContourInside::below});
    const SurfaceShape shape = found.shape();
    EXPECT_EQ(shape.fault, "");
    EXPECT_EQ(shape.boundary_edges, 0u);
    EXPECT_EQ(shape.euler, 2);
    EXPECT_EQ(shape.components, 1u);
    double largest = 0.0;
    for (const Vec3f& p : found.mesh.positions) largest = std::max(largest, std::abs((p.cast<double>() - center).norm() - radius));
    EXPECT_LE(largest, 1.0 / (8.0 * (radius - 1.0)) + 1e-5);  // and floats of samples and positions
    EXPECT_GT(largest, 0.5 / (8.0 * radius));                 // the bound is met somewhere
    const double volume = 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3);
    EXPECT_GT(shape.volume, 0.0);
    EXPECT_NEAR(shape.volume / volume, 1.0, 1.5 / (radius * radius));
    EXPECT_FALSE(found.report.meets_boundary);
}

TEST(ContourGrid, LeaningAndMirroredAxesFaceOutside) {
    for (const bool mirrored : {false, true})
        for (const ContourInside inside : {ContourInside::above, ContourInside::below}) {
            const GridPlacement placement = leaning_placement(mirrored);
            EXPECT_EQ(placement.is_mirrored(), mirrored);
            const Vec3d center = placement.world_from_index({20.0, 18.0, 22.0});
            const double sign = inside == ContourInside::below ? 1.0 : -1.0;
            const auto found = contour(grid_of(
                                           {41, 37, 45}, [&](const Vec3d& p) { return sign * ((p - center).norm() - 5.0); }, placement),
                                       {.isovalues = {0.0}, .inside = inside, .normals = true});
            const SurfaceShape shape = found.shape();
            EXPECT_EQ(shape.fault, "");
            EXPECT_EQ(shape.boundary_edges, 0u);
            EXPECT_NEAR(shape.volume / (4.0 / 3.0 * std::numbers::pi * 125.0), 1.0, 0.05);
            for (size_t v = 0; v < found.mesh.positions.size(); ++v) {
                const Vec3d ray = found.mesh.origin + found.mesh.positions[v].cast<double>() - center;
                EXPECT_NEAR(ray.norm(), 5.0, 1.4 * 1.4 / (8.0 * 3.6) + 1e-4);
                EXPECT_GT(ray.normalized().dot(found.mesh.normals[v].cast<double>()), 0.99);
                EXPECT_NEAR(found.mesh.normals[v].norm(), 1.0f, 1e-6f);
            }
        }
}

// A linear field's surface is a plane, cut exactly, with its gradient for a normal.
TEST(ContourGrid, PlaneIsExact) {
    const GridPlacement placement = leaning_placement(false);
    const Vec3d normal = Vec3d(0.3, -0.5, 0.8).normalized(), at = placement.world_from_index({5.3, 6.1, 4.7});
    const auto found = contour(grid_of(
                                   {12, 13, 11}, [&](const Vec3d& p) { return normal.dot(p - at); }, placement),
                               {.isovalues = {0.0}, .inside = ContourInside::below, .normals = true});
    EXPECT_GT(found.mesh.positions.size(), 100u);
    for (size_t v = 0; v < found.mesh.positions.size(); ++v) {
        EXPECT_NEAR(normal.dot(found.mesh.origin + found.mesh.positions[v].cast<double>() - at), 0.0, 2e-6);
        EXPECT_GT(normal.dot(found.mesh.normals[v].cast<double>()), 1.0 - 1e-6);
    }
    const SurfaceShape shape = found.shape();
    EXPECT_EQ(shape.fault, "");
    EXPECT_EQ(shape.euler, 1);  // a disk
    EXPECT_TRUE(found.report.meets_boundary);
}

ScalarGrid gyroid(uint32_t side) {
    const double scale = 2.0 * std::numbers::pi * 2.0 / side;
    return grid_of({side, side + 3, side - 2}, [&](const Vec3d& p) {
        return std::sin(scale * p.x()) * std::cos(scale * p.y()) + std::sin(scale * p.y()) * std::cos(scale * p.z()) +
               std::sin(scale * p.z()) * std::cos(scale * p.x());
    });
}

ScalarGrid noise(const std::array<uint32_t, 3>& size, uint64_t seed) {
    Random random(seed);
    return grid_of(size, [&](const Vec3d&) { return random.uniform(-1.0, 1.0); });
}

TEST(ContourGrid, SameBytesWhateverTheThreads) {
    for (const ScalarGrid& grid : {gyroid(70), noise({67, 20, 21}, 5)})
        for (const bool close : {false, true}) {
            ContourSettings settings{.isovalues = {0.1, -0.4}, .close = close, .normals = true};
            const std::string one = bytes_of(contour(grid, settings).mesh);
            EXPECT_GT(one.size(), 10000u);
            for (int threads = 2; threads <= 5; ++threads) {
                settings.threads = threads;
                EXPECT_EQ(bytes_of(contour(grid, settings).mesh) == one, true) << threads;
            }
        }
}

TEST(ContourGrid, SameBytesForEveryInstructionSet) {
    for (const ScalarGrid& grid : {gyroid(70), noise({67, 20, 21}, 6), noise({130, 9, 8}, 7)}) {
        std::string first;
        for (const SimdLevel level : simd_levels()) {
            SlabContour slab(grid.placement, grid.size, {.isovalues = {0.1}}, 0.0, level);
            const SlabSamples samples{.values = grid.values.data(), .first_slice = 0};
            slab.plan(samples, 0, slab.layers());
            const auto part = slab.part_of(0, slab.layers());
            ContourMesh mesh{.origin = {},
                             .positions = LargeArray<Vec3f>(part.vertices),
                             .normals = {},
                             .triangles = LargeArray<std::array<uint32_t, 3>>(part.triangles)};
            slab.emit(samples, 0, slab.layers(),
                      {.positions = mesh.positions.data(), .normals = nullptr, .triangles = mesh.triangles.data()});
            const std::string bytes = bytes_of(mesh);
            if (first.empty()) first = bytes;
            EXPECT_EQ(bytes == first, true) << name_of(level);
        }
    }
}

TEST(ContourGrid, SeveralIsovaluesAreEachItsOwn) {
    const ScalarGrid grid = gyroid(40);
    const std::vector<double> isovalues = {0.3, -0.2, 0.9};
    uint64_t vertices = 0, triangles = 0;
    int64_t euler = 0;
    for (const double isovalue : isovalues) {
        const auto one = contour(grid, {.isovalues = {isovalue}});
        vertices += one.report.vertices;
        triangles += one.report.triangles;
        euler += one.shape().euler;
    }
    const auto all = contour(grid, {.isovalues = isovalues});
    EXPECT_EQ(all.report.vertices, vertices);
    EXPECT_EQ(all.report.triangles, triangles);
    EXPECT_EQ(all.shape().fault, "");
    EXPECT_EQ(all.shape().euler, euler);
}

TEST(ContourGrid, NoCellsNoSurface) {
    for (const std::array<uint32_t, 3>& size :
         {std::array<uint32_t, 3>{0, 5, 5}, {1, 5, 5}, {5, 1, 5}, {5, 5, 1}, {5, 0, 5}, {1, 1, 1}, {0, 0, 0}}) {
        const auto found = contour(grid_of(size, [](const Vec3d& p) { return p.x() + p.y() + p.z() - 2.5; }), {.isovalues = {0.0}});
        EXPECT_EQ(found.report.triangles, 0u);
        EXPECT_EQ(found.report.vertices, 0u);
    }
}

// Beyond a closed grid all is outside, so that even a single sample has a surface around it, within 2^-10 of the grid.
TEST(ContourGrid, CloseCapsAtTheBoundary) {
    for (const std::array<uint32_t, 3>& size :
         {std::array<uint32_t, 3>{1, 1, 1}, {5, 1, 4}, {70, 6, 5}, {64, 3, 4}, {63, 3, 4}, {62, 3, 4}}) {
        const auto found = contour(grid_of(size, [](const Vec3d&) { return 1.0; }), {.isovalues = {0.0}, .close = true, .normals = true});
        const SurfaceShape shape = found.shape();
        EXPECT_EQ(shape.fault, "");
        EXPECT_EQ(shape.boundary_edges, 0u);
        EXPECT_EQ(shape.euler, 2);
        EXPECT_TRUE(found.report.meets_boundary);
        double box = 1.0;
        for (size_t axis = 0; axis < 3; ++axis) box *= double(size[axis] - 1) + 0x1p-9;
        EXPECT_GT(shape.volume, 0.0);
        EXPECT_LT(shape.volume, box * (1.0 + 1e-5));
        for (const Vec3f& p : found.mesh.positions)
            for (int axis = 0; axis < 3; ++axis) {
                EXPECT_GE(p[axis], -0x1p-10f);
                EXPECT_LE(p[axis], float(size[size_t(axis)] - 1) + 0x1p-10f);
            }
    }
    const auto whole = contour(gyroid(40), {.isovalues = {0.2}, .close = true});
    EXPECT_EQ(whole.shape().fault, "");
    EXPECT_EQ(whole.shape().boundary_edges, 0u);
    EXPECT_GT(contour(gyroid(40), {.isovalues = {0.2}}).shape().boundary_edges, 0u);
}

TEST(ContourGrid, SamplesAtTheIsovalueAreInside) {
    // One sample at the isovalue, all others below: an octahedron whose vertices are held off the sample.
    const auto found = contour(grid_of({3, 3, 3}, [](const Vec3d& p) { return p == Vec3d(1, 1, 1) ? 0.5 : 0.0; }), {.isovalues = {0.5}});
    EXPECT_EQ(found.report.vertices, 6u);
    EXPECT_EQ(found.report.triangles, 8u);
    EXPECT_EQ(found.report.clamped_vertices, 6u);
    EXPECT_EQ(found.report.largest_shift_cells, 0x1p-10);
    for (const Vec3f& p : found.mesh.positions) EXPECT_EQ((p - Vec3f(1, 1, 1)).norm(), 0x1p-10f);
    EXPECT_GT(found.shape().volume, 0.0);
    // Fields of few values meet the isovalue at many samples, and faces and interior tie.
    Random random(3);
    for (int n = 0; n < 300; ++n) {
        const auto ties = contour(grid_of({5, 5, 5}, [&](const Vec3d&) { return double(random.bits() % 3) - 1.0; }),
                                  {.isovalues = {0.0}, .inside = n % 2 == 0 ? ContourInside::above : ContourInside::below, .close = true});
        const SurfaceShape shape = ties.shape();
        ASSERT_EQ(shape.fault, "") << n;
        ASSERT_EQ(shape.boundary_edges, 0u) << n;
    }
    const auto all = contour(grid_of({4, 4, 4}, [](const Vec3d&) { return 0.5; }), {.isovalues = {0.5}});
    EXPECT_EQ(all.report.triangles, 0u);
}

TEST(ContourGrid, WhatIsNotFiniteIsCutInTheMiddle) {
    ScalarGrid grid = grid_of({5, 5, 5}, [](const Vec3d&) { return 1.0; });
    grid.values[62] = kNan;  // the middle
    const auto found = contour(grid, {.isovalues = {0.0}, .normals = true});
    EXPECT_EQ(found.report.nan_samples, 1u);
    EXPECT_EQ(found.report.vertices, 6u);
    EXPECT_EQ(found.report.clamped_vertices, 0u);
    for (const Vec3f& p : found.mesh.positions) EXPECT_EQ((p - Vec3f(2, 2, 2)).norm(), 0.5f);
    EXPECT_LT(found.shape().volume, 0.0);  // a hole
    for (const Vec3f& n : found.mesh.normals) EXPECT_TRUE(n.allFinite());

    Random random(8);
    const float specials[] = {kNan,
                              kInfinity,
                              -kInfinity,
                              1e30f,
                              -1e30f,
                              1e-30f,
                              -1e-30f,
                              1e-42f,
                              -1e-42f,
                              std::numeric_limits<float>::max(),
                              std::numeric_limits<float>::lowest(),
                              0.0f,
                              -0.0f};
    for (int n = 0; n < 300; ++n) {
        ScalarGrid wild = grid_of({6, 5, 7}, [&](const Vec3d&) { return random.uniform(-1.0, 1.0); });
        uint64_t nan = 0;
        for (float& v : wild.values) {
            if (random.uniform() < 0.3) v = specials[random.bits() % std::size(specials)];
            nan += std::isnan(v);
        }
        const auto wilder = contour(wild, {.isovalues = {n % 3 == 0   ? 0.0
                                                         : n % 3 == 1 ? 1e-38
                                                                      : 0.3},
                                           .inside = n % 2 == 0 ? ContourInside::above : ContourInside::below,
                                           .close = n % 5 != 0,
                                           .normals = true});
        const SurfaceShape shape = wilder.shape();
        ASSERT_EQ(shape.fault, "") << n;
        if (n % 5 != 0) ASSERT_EQ(shape.boundary_edges, 0u) << n;
        EXPECT_EQ(wilder.report.nan_samples, nan);
        for (const Vec3f& p : wilder.mesh.positions) ASSERT_TRUE(p.allFinite());
        for (const Vec3f& normal : wilder.mesh.normals) ASSERT_TRUE(normal.allFinite());
    }
    const auto none = contour(grid_of({4, 5, 6}, [](const Vec3d&) { return std::nan(""); }), {.isovalues = {0.0}, .close = true});
    EXPECT_EQ(none.report.nan_samples, 120u);
    EXPECT_EQ(none.report.triangles, 0u);
    EXPECT_GT(none.report.least, none.report.greatest);  // no value
}

TEST(ContourGrid, RangeTellsWhyThereIsNoSurface) {
    for (const double isovalue : {5.0, -5.0, 1e300, -1e300}) {
        const auto found = contour(gyroid(20), {.isovalues = {isovalue}});
        EXPECT_EQ(found.report.triangles, 0u);
        EXPECT_GT(found.report.least, -1.6f);
        EXPECT_LT(found.report.greatest, 1.6f);
        EXPECT_LT(found.report.least, found.report.greatest);
        EXPECT_FALSE(found.report.meets_boundary);
    }
}

TEST(ContourGrid, RefusesWhatIsNoIsovalue) {
    ContourMesh mesh;
    const ScalarGrid grid = gyroid(10);
    for (const double isovalue : {std::nan(""), std::numeric_limits<double>::infinity()})
        EXPECT_THROW(contour_grid(grid.placement, grid.size, grid.values, {.isovalues = {isovalue}}, mesh), Error);
    EXPECT_THROW(contour_grid(grid.placement, {10, 13, 9}, grid.values, {}, mesh), Error);  // the gyroid is 10 x 13 x 8
    EXPECT_THROW(contour_grid(grid.placement, {0xffffffff, 0xffffffff, 0xffffffff}, grid.values, {}, mesh), Error);
    EXPECT_THROW(contour_grid(grid.placement, grid.size, grid.values, {.isovalues = {0.0, 1.0}, .colors = {{0, 0, 0, 0}}}, mesh), Error);
}

}  // namespace
}  // namespace strata
