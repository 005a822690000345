#include "core/cloud/neighbor_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <flann/flann.hpp>
#include <tuple>

#include "core/math/random.h"

namespace strata {
namespace {

using Point = std::array<int32_t, 3>;

Point array_of(const Vec3i& p) { return {p.x(), p.y(), p.z()}; }

std::vector<TreePoint> numbered(const std::vector<Vec3i>& positions) {
    std::vector<TreePoint> points;
    for (const Vec3i& position : positions) points.push_back({position, uint32_t(points.size())});
    return points;
}

// The plain twin: all points in order of (distance, position), cut after k.
std::vector<Point> sorted_neighbors(const std::vector<Vec3i>& positions, const Vec3d& scale, const Vec3i& center, size_t k) {
    std::vector<std::tuple<double, Point>> all;
    for (const Vec3i& p : positions) all.emplace_back(squared_distance(center, p, scale), array_of(p));
    std::sort(all.begin(), all.end());
    std::vector<Point> nearest;
    for (size_t i = 0; i < std::min(k, all.size()); ++i) nearest.push_back(std::get<1>(all[i]));
    std::sort(nearest.begin(), nearest.end());
    return nearest;
}

std::vector<Point> sorted_points(std::span<const Vec3i> points) {
    std::vector<Point> sorted;
    for (const Vec3i& p : points) sorted.push_back(array_of(p));
    std::sort(sorted.begin(), sorted.end());
    return sorted;
}

// Every point's neighbors by both ways of asking are those of the twin.
void expect_exact(const std::vector<Vec3i>& positions, const Vec3d& scale, uint32_t k) {
    const NeighborTree tree(numbered(positions), scale);
    NeighborSearch search(tree, k);
    std::vector<bool> seen(positions.size(), false);
    for_each_neighborhood(tree, k, 1, [&](const TreePoint& point, const Neighborhood& neighbors) {
        ASSERT_EQ(array_of(point.position), array_of(positions[point.index]));
        ASSERT_EQ(array_of(neighbors.center), array_of(point.position));
        EXPECT_FALSE(seen[point.index]);
        seen[point.index] = true;
        const std::vector<Point> expected = sorted_neighbors(positions, scale, point.position, k);
        ASSERT_EQ(sorted_points(neighbors.points), expected);
        double farthest = 0.0;
        for (const Vec3i& p : neighbors.points) farthest = std::max(farthest, squared_distance(point.position, p, scale));
        EXPECT_EQ(neighbors.radius_squared, farthest);
        ASSERT_EQ(sorted_points(search.nearest(point.position).points), expected);
    });
    EXPECT_EQ(std::count(seen.begin(), seen.end(), true), ptrdiff_t(positions.size()));
}

std::vector<Vec3i> random_points(size_t n, uint64_t seed, const Vec3d& size, const Vec3i& corner = Vec3i::Zero()) {
    Random random(seed);
    std::vector<Vec3i> points(n);
    for (Vec3i& p : points)
        for (int axis = 0; axis < 3; ++axis) p[axis] = int32_t(corner[axis] + int64_t(random.uniform(0.0, size[axis])));
    return points;
}

constexpr double kMillimetre = 0.001;

TEST(NeighborSearch, AgreesWithSortingAllPoints) {
    const Vec3d cube = Vec3d::Constant(kMillimetre);
    for (const uint32_t k : {1u, 2u, 7u, 16u, 40u}) {
        expect_exact(random_points(500, 1, {20'000, 20'000, 20'000}), cube, k);
        expect_exact(random_points(500, 2, {30'000, 30'000, 50}), cube, k);   // a surface
        expect_exact(random_points(500, 3, {900'000, 20, 20}), cube, k);      // a line
        expect_exact(random_points(500, 4, {9, 9, 9}), cube, k);              // ties everywhere, two at a place
        expect_exact(random_points(500, 5, {40, 40, 1}), cube, k);
    }
    expect_exact(random_points(500, 6, {2'000, 900, 40'000}), {0.01, 0.01, 0.0005}, 16);
}

TEST(NeighborSearch, FarFromTheOriginAndAcrossTheWholeRange) {
    // 5 * 10^6 m at millimetres does not fit in quanta; at 3 mm it does, with nothing to spare.
    const std::vector<Vec3i> near = random_points(1000, 7, {5'000, 5'000, 300});
    std::vector<Vec3i> far = near;
    for (Vec3i& p : far) p += Vec3i::Constant(INT32_MAX - 6'000);
    expect_exact(far, Vec3d::Constant(0.003), 16);
    std::vector<Vec3i> wide = random_points(500, 8, {4e9, 4e9, 4e9}, Vec3i::Constant(INT32_MIN));
    wide.push_back(Vec3i::Constant(INT32_MAX));
    wide.push_back(Vec3i::Constant(INT32_MIN));
    expect_exact(wide, Vec3d::Constant(1.0), 16);
}

TEST(NeighborSearch, ClustersAndStrayPoints) {
    std::vector<Vec3i> points;
    for (int cluster = 0; cluster < 12; ++cluster) {
        const std::vector<Vec3i> more =
            random_points(size_t(1) << (cluster / 2 + 3), uint64_t(cluster), Vec3d::Constant(30.0 * (cluster + 1)),
                          Vec3i(cluster * 1'000'003, cluster % 3 * 77'777, -cluster * cluster * 10'001));
        points.insert(points.end(), more.begin(), more.end());
    }
    points.insert(points.end(), 300, Vec3i(500'000, 0, 0));  // more than a leaf at one place
    points.insert(points.end(), 33, Vec3i(500'001, 0, 0));
    expect_exact(points, Vec3d::Constant(kMillimetre), 16);
    expect_exact(points, Vec3d::Constant(kMillimetre), 50);
}

TEST(NeighborSearch, FewPoints) {
    for (size_t n = 1; n < 40; n += 3) expect_exact(random_points(n, n, {100, 100, 100}), Vec3d::Ones(), 16);
    const NeighborTree none({}, Vec3d::Ones());
    NeighborSearch search(none, 4);
    EXPECT_TRUE(search.nearest(Vec3i::Zero()).points.empty());
    for_each_neighborhood(none, 4, 2, [](const TreePoint&, const Neighborhood&) { FAIL(); });
}

TEST(NeighborSearch, KnownPointsAndBound) {
    const std::vector<Vec3i> all = random_points(900, 9, {3'000, 3'000, 100});
    const std::vector<Vec3i> known(all.begin(), all.begin() + 100), others(all.begin() + 100, all.end());
    const NeighborTree tree(numbered(others), Vec3d::Ones());
    NeighborSearch search(tree, 12);
    for (size_t i = 0; i < all.size(); i += 7) {
        const std::vector<Point> expected = sorted_neighbors(all, Vec3d::Ones(), all[i], 12);
        const Neighborhood found = search.nearest(all[i], known);
        EXPECT_EQ(sorted_points(found.points), expected);
        const double radius_squared = found.radius_squared;
        EXPECT_EQ(sorted_points(search.nearest(all[i], known, radius_squared).points), expected);  // the bound is included
        EXPECT_LT(search.nearest(all[i], known, std::nextafter(radius_squared, 0.0)).points.size(), 12u);
    }
}

// A quadratic search would take 10^12 steps here.
TEST(NeighborSearch, AMillionEqualPoints) {
    std::vector<Vec3i> points(1'000'000, Vec3i(7, 7, 7));
    points.push_back({8, 7, 7});
    const NeighborTree tree(numbered(points), Vec3d::Ones());
    size_t visits = 0, wrong = 0;
    for_each_neighborhood(tree, 16, 1, [&](const TreePoint& point, const Neighborhood& neighbors) {
        ++visits;
        if (neighbors.points.size() != 16u || neighbors.radius_squared != (point.index == 1'000'000 ? 1.0 : 0.0)) ++wrong;
    });
    EXPECT_EQ(visits, points.size());
    EXPECT_EQ(wrong, 0u);
}

TEST(NeighborSearch, ThreadsDoNotShow) {
    const std::vector<Vec3i> points = random_points(60'000, 10, {200, 200, 3});  // ties everywhere
    const auto sums = [&](int threads) {
        const NeighborTree tree(numbered(points), Vec3d::Ones());
        std::vector<std::pair<double, uint64_t>> result(points.size());
        for_each_neighborhood(tree, 10, threads, [&](const TreePoint& point, const Neighborhood& neighbors) {
            uint64_t sum = 0;
            for (const Vec3i& p : neighbors.points) sum += mix_bits(uint64_t(p.x()) << 40 ^ uint64_t(p.y()) << 20 ^ uint64_t(p.z()));
            result[point.index] = {neighbors.radius_squared, sum};
        });
        return result;
    };
    const auto expected = sums(1);
    EXPECT_EQ(sums(2), expected);
    EXPECT_EQ(sums(7), expected);
}

// FLANN as an independent judge, in its exact mode: the same distances, so the same sets but for ties. Its floats hold
// these coordinates exactly.
TEST(NeighborSearch, AgreesWithFlann) {
    constexpr size_t kNeighbors = 16;
    std::vector<Vec3i> points = random_points(20'000, 11, {40'000, 40'000, 30});
    const std::vector<Vec3i> volume = random_points(10'000, 12, {20'000, 20'000, 20'000});
    points.insert(points.end(), volume.begin(), volume.end());
    std::vector<double> coordinates;
    for (const Vec3i& p : points)
        for (int axis = 0; axis < 3; ++axis) coordinates.push_back(p[axis]);
    const flann::Matrix<double> data(coordinates.data(), points.size(), 3);
    flann::Index<flann::L2_3D<double>> index(data, flann::KDTreeSingleIndexParams());
    index.buildIndex();
    std::vector<size_t> found(points.size() * kNeighbors);
    std::vector<double> distances(found.size());
    flann::Matrix<size_t> indices(found.data(), points.size(), kNeighbors);
    flann::Matrix<double> squares(distances.data(), points.size(), kNeighbors);
    index.knnSearch(data, indices, squares, kNeighbors, flann::SearchParams(flann::FLANN_CHECKS_UNLIMITED));

    const NeighborTree tree(numbered(points), Vec3d::Ones());
    for_each_neighborhood(tree, kNeighbors, 1, [&](const TreePoint& point, const Neighborhood& neighbors) {
        std::vector<double> ours;
        for (const Vec3i& p : neighbors.points) ours.push_back(squared_distance(point.position, p, Vec3d::Ones()));
        std::sort(ours.begin(), ours.end());
        const std::vector<double> theirs(squares[point.index], squares[point.index] + kNeighbors);
        ASSERT_EQ(ours, theirs);
    });
}

}  // namespace
}  // namespace strata
