#include "core/surface/normal_orientation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <tuple>

#include "core/error.h"
#include "core/math/random.h"

namespace strata {
namespace {

// Cells of points with normals, as they come: of any side.
class Cells {
public:
    void add(const Vec3d& place, const Vec3d& normal) {
        const std::array<int32_t, 3> at = {int32_t(place.z()), int32_t(place.y()), int32_t(place.x())};  // in the order of cells
        if (cells_.contains(at)) return;
        const bool turned = random_.uniform() < 0.5;
        NormalOrientation::Cell cell = {.at = {at[2], at[1], at[0]}, .place = (place - Vec3d(at[2], at[1], at[0])).cast<float>(), .normal = (turned ? Vec3d(-normal) : normal).cast<float>()};
        cells_[at] = {cell, turned};
    }
    // How many cells end up with the side that they were added with.
    size_t right(uint64_t* components = nullptr) const {
        NormalOrientation orientation;
        std::vector<NormalOrientation::Cell> cells;
        for (const auto& [at, cell] : cells_) cells.push_back(cell.first);
        orientation.add(cells);
        orientation.solve(uint64_t{1} << 30);
        if (components != nullptr) *components = orientation.components();
        size_t count = 0;
        for (const auto& [at, cell] : cells_) count += orientation.is_turned(cell.first.at) == cell.second;
        return count;
    }
    size_t size() const { return cells_.size(); }

private:
    Random random_{4};
    std::map<std::array<int32_t, 3>, std::pair<NormalOrientation::Cell, bool>> cells_;
};

Vec3d random_direction(Random& random) { return Vec3d(random.normal(), random.normal(), random.normal()).normalized(); }

TEST(NormalOrientation, ASphereLooksOutwards) {
    Random random(1);
    Cells cells;
    for (int i = 0; i < 20'000; ++i) {
        const Vec3d n = random_direction(random);
        cells.add(Vec3d(50.0, 60.0, 70.0) + 20.0 * n, n);
    }
    uint64_t components = 0;
    EXPECT_EQ(cells.right(&components), cells.size());
    EXPECT_EQ(components, 1u);
}

// A box, of edges that normals turn at by a right angle; and one that is as thin as two cells.
TEST(NormalOrientation, CornersAndPlates) {
    for (const double thickness : {20.0, 2.4}) {
        Cells cells;
        const Vec3d low(30.3, 30.3, 30.3), high = low + Vec3d(25.0, 25.0, thickness);
        for (int axis = 0; axis < 3; ++axis)
            for (const double side : {-1.0, 1.0})
                for (double a = 0.25; a < 25.0; a += 0.5)
                    for (double b = 0.25; b < (axis == 2 ? 25.0 : thickness); b += 0.5) {
                        Vec3d p = low + (axis == 2 ? Vec3d(a, b, 0.0) : axis == 1 ? Vec3d(a, 0.0, b) : Vec3d(0.0, a, b));
                        if (side > 0.0) p[axis] = high[axis];
                        cells.add(p, side * Vec3d::Unit(axis));
                    }
        EXPECT_EQ(cells.right(), cells.size()) << thickness;
    }
}

// Ground and a roof that hangs above it: each looks up; a wall takes the side of the ground that it stands on.
TEST(NormalOrientation, PartsOneByOne) {
    Cells cells;
    for (double x = 0.5; x < 60.0; ++x)
        for (double y = 0.5; y < 60.0; ++y) {
            cells.add({x, y, 20.5 + 2.0 * std::sin(0.2 * x)}, Vec3d(-0.4 * std::cos(0.2 * x), 0.0, 1.0).normalized());
            if (x > 20.0 && x < 40.0) cells.add({x, y, 40.5}, Vec3d::UnitZ());
        }
    uint64_t components = 0;
    EXPECT_EQ(cells.right(&components), cells.size());
    EXPECT_EQ(components, 2u);
}

// A noisy sheet, of cells one behind the other with normals that are off by 30 degrees: many single edges are wrong (a tree of the surest turns
// four fifths of the cells), and all that lie between two parts decide together.
TEST(NormalOrientation, MostEdgesDecide) {
    Random random(2);
    Cells cells;
    for (int i = 0; i < 20'000; ++i) {
        const Vec3d n = random_direction(random);
        cells.add(Vec3d(50.0, 60.0, 70.0) + (20.0 + 0.3 * random.normal()) * n, (n + 0.4 * Vec3d(random.normal(), random.normal(), random.normal())).normalized());
    }
    EXPECT_GE(cells.right(), cells.size() * 97 / 100);
}

// A court whose walls are larger than its ground, and end above in an eave that looks down: the ground looks up all the same.
TEST(NormalOrientation, WallsHaveNoSay) {
    Cells cells;
    for (double x = 0.5; x < 30.0; ++x)
        for (double y = 0.5; y < 30.0; ++y) cells.add({x + 20.0, y + 20.0, 20.5}, Vec3d::UnitZ());
    for (double z = 1.5; z < 80.0; ++z)
        for (double a = 0.5; a < 30.0; ++a) {
            cells.add({20.5, a + 20.0, 20.0 + z}, Vec3d::UnitX());
            cells.add({49.5, a + 20.0, 20.0 + z}, -Vec3d::UnitX());
        }
    for (double a = 0.5; a < 30.0; ++a)
        for (double b = 0.5; b < 4.0; ++b) cells.add({20.5 + b, a + 20.0, 100.5}, -Vec3d::UnitZ());
    EXPECT_EQ(cells.right(), cells.size());
}

// Two meadows, and between them nothing but scattered points that touch neither: both look up.
TEST(NormalOrientation, GroundLooksUpWhateverLiesBetween) {
    for (const uint64_t seed : {1u, 2u, 3u, 4u, 5u, 6u}) {
        Random random(seed);
        Cells cells;
        for (const double x0 : {0.0, 30.0})
            for (double x = 0.5; x < 20.0; ++x)
                for (double y = 0.5; y < 20.0; ++y) cells.add({x0 + x, y, 20.5}, Vec3d::UnitZ());
        const size_t ground = cells.size();
        for (double x = 21.5; x < 29.0; x += 2.0) cells.add({x, 9.5, 20.0 + random.uniform(0.1, 0.9)}, random_direction(random));
        EXPECT_GE(cells.right(), ground);
    }
}

TEST(NormalOrientation, NothingIsNothing) {
    NormalOrientation orientation;
    orientation.add({});
    orientation.solve(uint64_t{1} << 30);
    EXPECT_EQ(orientation.components(), 0u);
    EXPECT_FALSE(orientation.is_turned({1, 2, 3}));
}

// Cells all about have 13 edges each, of 16 bytes: they are counted before memory is taken.
TEST(NormalOrientation, CountsItsEdges) {
    Random random(8);
    std::vector<NormalOrientation::Cell> cells;
    for (int32_t k = 0; k < 20; ++k)
        for (int32_t j = 0; j < 20; ++j)
            for (int32_t i = 0; i < 20; ++i) cells.push_back({.at = {i, j, k}, .place = Vec3f(0.5f, 0.5f, 0.5f), .normal = random_direction(random).cast<float>()});
    // Of a cube of n^3 cells each of 26 neighbors' directions has n^2 (n - 1), n (n - 1)^2 or (n - 1)^3 pairs, and an edge has two.
    const uint64_t edges = 3 * 20 * 20 * 19 + 6 * 20 * 19 * 19 + 4 * 19 * 19 * 19;
    NormalOrientation little, enough;
    little.add(cells);
    enough.add(cells);
    EXPECT_THROW(little.solve(16 * edges), Error);
    enough.solve(16 * edges + enough.memory_bytes() + 9 * cells.size());
    EXPECT_EQ(enough.components(), 1u);
    EXPECT_LE(enough.memory_bytes(), 17 * cells.size()) << "what is left";
}

}  // namespace
}  // namespace strata
