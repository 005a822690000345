#include "core/voxel/ray_cast.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "core/math/random.h"
#include "tests/support/run_program.h"
#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

using Cell = std::array<uint32_t, 3>;

// ---- The twin: every voxel that the ray comes through, by merging the crossings of all planes. ----

struct Visit {
    Cell voxel;
    double t;
    int axis;  // of the crossing; -1: the ray starts here
};

double crossing_t(const VoxelRay& ray, int axis, double plane) { return (plane - ray.origin[axis]) * (1.0 / ray.direction[axis]); }

std::vector<Visit> visits_of(uint32_t side, const VoxelRay& ray, double start_t, double most_t) {
    struct Crossing {
        double t;
        int axis;
    };
    std::vector<Crossing> crossings;
    std::array<int64_t, 3> voxel;
    for (int a = 0; a < 3; ++a) {
        if (ray.direction[a] == 0.0) {
            voxel[size_t(a)] = ray.origin[a] >= 0.0 && ray.origin[a] < side ? int64_t(std::floor(ray.origin[a])) : -1;
            continue;
        }
        const bool up = ray.direction[a] > 0.0;
        voxel[size_t(a)] = up ? -1 : int64_t(side);
        const size_t before = crossings.size();
        for (uint32_t i = 0; i <= side; ++i) crossings.push_back({crossing_t(ray, a, up ? i : side - i), a});
        std::inplace_merge(crossings.begin(), crossings.begin() + ptrdiff_t(before), crossings.end(),
                           [](const Crossing& p, const Crossing& q) { return p.t != q.t ? p.t < q.t : p.axis < q.axis; });
    }
    std::vector<Visit> visits;
    if (!(start_t <= most_t)) return visits;
    const auto visit = [&](double t, int axis) {
        for (const int64_t c : voxel)
            if (c < 0 || c >= side) return;
        visits.push_back({{uint32_t(voxel[0]), uint32_t(voxel[1]), uint32_t(voxel[2])}, t, axis});
    };
    bool started = false;
    for (const Crossing& crossing : crossings) {
        if (!started && crossing.t > start_t) {
            visit(start_t, -1);
            started = true;
        }
        if (crossing.t > most_t) break;
        voxel[size_t(crossing.axis)] += ray.direction[crossing.axis] > 0.0 ? 1 : -1;
        if (started) visit(crossing.t, crossing.axis);
    }
    return visits;
}

/// What stops the ray first, of `pyramid`: [shift] cells of side 2^shift, every voxel of one alike.
std::optional<VoxelHit> first_stop(const std::vector<VoxelCube>& pyramid, const VoxelRay& ray, const RayLimits& limits) {
    const int depths = 2 * pyramid[0].levels;
    const int most_depth = std::clamp(limits.depth, 1, depths);
    std::vector<double> entered(size_t(depths) + 1);
    std::vector<Cell> within(size_t(depths) + 1, Cell{~0u, ~0u, ~0u});
    for (const Visit& visit : visits_of(pyramid[0].side(), ray, limits.least_t, limits.most_t)) {
        const auto [x, y, z] = visit.voxel;
        for (int depth = 1; depth <= depths; ++depth) {
            const int shift = depths - depth;
            const Cell cell = {x >> shift, y >> shift, z >> shift};
            const bool fresh = within[size_t(depth)] != cell;
            if (fresh) {
                within[size_t(depth)] = cell;
                entered[size_t(depth)] = visit.t;
            }
            if (!pyramid[size_t(shift)].at(x, y, z)) {
                for (int below = depth + 1; below <= depths; ++below) within[size_t(below)] = {~0u, ~0u, ~0u};
                break;
            }
            if (!fresh) continue;  // did not stop the ray when it came in
            if (depth < most_depth && !(double(1u << shift) <= limits.spread * visit.t + limits.footprint)) continue;
            VoxelHit hit{.t = visit.t, .cell = cell, .depth = depth};
            int axis = visit.axis;
            if (axis < 0)
                for (int a = 0; a < 3; ++a) {
                    if (ray.direction[a] == 0.0) continue;
                    const double plane = double((cell[size_t(a)] + (ray.direction[a] > 0.0 ? 0 : 1)) << shift);
                    if (crossing_t(ray, a, plane) == visit.t) axis = a;
                }
            hit.face = axis < 0 ? CellFace::inside : CellFace(2 * axis + (ray.direction[axis] > 0.0 ? 0 : 1));
            return hit;
        }
    }
    return std::nullopt;
}

std::vector<VoxelCube> pyramid_of(const VoxelCube& voxels) {
    std::vector<VoxelCube> pyramid = {voxels};
    for (int shift = 1; shift < 2 * voxels.levels; ++shift) pyramid.push_back(coarsened(pyramid.back(), shift));
    return pyramid;
}

// ---- A second one, as printed: J. Amanatides, A. Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987. ----

/// Calls visit(voxel, t) until it returns false.
template <class Visitor>
void walk_as_printed(uint32_t side, const VoxelRay& ray, Visitor&& visit) {
    double t = 0.0, t_out = kInfinity;
    for (int a = 0; a < 3; ++a) {
        if (ray.direction[a] == 0.0) {
            if (!(ray.origin[a] >= 0.0 && ray.origin[a] < side)) return;
            continue;
        }
        const double t0 = (0.0 - ray.origin[a]) / ray.direction[a], t1 = (side - ray.origin[a]) / ray.direction[a];
        t = std::max(t, std::min(t0, t1));
        t_out = std::min(t_out, std::max(t0, t1));
    }
    if (!(t < t_out)) return;
    std::array<int64_t, 3> voxel, step;
    std::array<double, 3> next_t, delta_t;
    for (int i = 0; i < 3; ++i) {
        const size_t a = size_t(i);
        voxel[a] = std::clamp<int64_t>(int64_t(std::floor(ray.origin[i] + t * ray.direction[i])), 0, side - 1);
        step[a] = ray.direction[i] > 0.0 ? 1 : -1;
        delta_t[a] = ray.direction[i] == 0.0 ? kInfinity : 1.0 / std::abs(ray.direction[i]);
        next_t[a] = ray.direction[i] == 0.0 ? kInfinity : (double(voxel[a] + (step[a] > 0)) - ray.origin[i]) / ray.direction[i];
    }
    while (visit(Cell{uint32_t(voxel[0]), uint32_t(voxel[1]), uint32_t(voxel[2])}, t)) {
        const size_t a = next_t[0] < next_t[1] ? (next_t[0] < next_t[2] ? 0 : 2) : (next_t[1] < next_t[2] ? 1 : 2);
        t = next_t[a];
        next_t[a] += delta_t[a];
        voxel[a] += step[a];
        if (voxel[a] < 0 || voxel[a] >= side) return;
    }
}

/// The part of the ray inside a voxel that was made larger by `margin` on each side; empty: first > second.
std::pair<long double, long double> chord(const VoxelRay& ray, const Cell& voxel, long double margin) {
    long double in = 0.0L, out = kInfinity;
    for (int a = 0; a < 3; ++a) {
        const long double low = voxel[size_t(a)] - margin, high = voxel[size_t(a)] + 1.0L + margin;
        const long double origin = ray.origin[a], direction = ray.direction[a];
        if (direction == 0.0L) {
            if (origin < low || origin > high) return {1.0L, 0.0L};
            continue;
        }
        in = std::max(in, std::min((low - origin) / direction, (high - origin) / direction));
        out = std::min(out, std::max((low - origin) / direction, (high - origin) / direction));
    }
    return {in, out};
}

constexpr long double kEdge = 0x1p-13L;  // voxels

/// Whether `hit` may stand for what the printed walk finds: the same voxel, or else one that the ray touches within 2^-13, no later
/// than any that it passes through the inside of.
::testing::AssertionResult is_candidate(const VoxelCube& voxels, const VoxelRay& ray, const std::optional<VoxelHit>& hit, int& differing) {
    std::optional<Cell> printed;
    walk_as_printed(voxels.side(), ray, [&](const Cell& v, double) {
        if (voxels.at(v[0], v[1], v[2])) printed = v;
        return !printed;
    });
    if (printed.has_value() == hit.has_value() && (!hit || *printed == hit->cell)) return ::testing::AssertionSuccess();
    ++differing;
    const long double slack = kEdge / (long double)(ray.direction.cwiseAbs().maxCoeff());
    if (hit) {
        const auto [in, out] = chord(ray, hit->cell, kEdge);
        if (in > out) return ::testing::AssertionFailure() << "the ray does not touch the voxel";
        if (hit->t < in - slack || hit->t > out + slack) return ::testing::AssertionFailure() << "touches the voxel at another t";
    }
    ::testing::AssertionResult result = ::testing::AssertionSuccess();
    walk_as_printed(voxels.side(), ray, [&](const Cell& v, double t) {
        if (hit && t > hit->t + slack) return false;
        if (!voxels.at(v[0], v[1], v[2])) return true;
        const auto [in, out] = chord(ray, v, -kEdge);
        if (in < out && (!hit || in < hit->t - slack)) result = ::testing::AssertionFailure() << "passes through an earlier voxel";
        return bool(result);
    });
    return result;
}

// ---- Rays of every kind. ----

constexpr int kRayKinds = 9;

VoxelRay random_ray(Random& random, int kind, double side) {
    const auto place = [&](double low, double high) {
        return Vec3d(random.uniform(low, high), random.uniform(low, high), random.uniform(low, high));
    };
    const auto direction = [&] { return Vec3d(random.normal(), random.normal(), random.normal()); };
    const auto lattice = [&](double low, double high, double unit) -> Vec3d { return (place(low, high) / unit).array().floor() * unit; };
    const auto whole = [&](int n) { return int(random.uniform() * n); };
    VoxelRay ray;
    switch (kind) {
        case 0: return {place(-side, 2 * side), direction()};
        case 1: return {place(0, side), direction()};
        case 2: {  // parallel to an axis, on faces and off them
            const int axis = whole(3);
            ray = {whole(2) ? lattice(-2, side + 2, 0.5) : place(-2, side + 2),
                   Vec3d(whole(2) ? 0.0 : -0.0, whole(2) ? 0.0 : -0.0, whole(2) ? 0.0 : -0.0)};
            ray.direction[axis] = whole(2) ? 1.0 : -1.0;
            return ray;
        }
        case 3: {  // through corners
            ray.origin = lattice(-4, side + 4, 1.0);
            do ray.direction = lattice(0, side, 1.0) - ray.origin;
            while (ray.direction.isZero(0.0));
            ray.direction *= random.uniform(0.01, 3.0);
            return ray;
        }
        case 4: {  // diagonals
            ray.origin = lattice(-4, side + 4, whole(2) ? 1.0 : 0.5);
            do ray.direction = Vec3d(whole(3) - 1, whole(3) - 1, whole(3) - 1);
            while (ray.direction.isZero(0.0));
            return ray;
        }
        case 5: {  // through an edge: a point on one of its axes aims at another
            Vec3d from = place(-side, 2 * side), to = place(0, side);
            const int axis = whole(3);
            for (int a = 0; a < 3; ++a)
                if (a != axis) to[a] = std::floor(to[a]);
            return {from, to - from};
        }
        case 6: {  // from 1e9 voxels away
            const Vec3d from = direction().normalized() * 1e9;
            const Vec3d to = place(0, side);
            ray = {from, to - from};
            if (whole(4) == 0) {
                const int axis = whole(3);
                ray.origin = to;
                ray.origin[axis] = whole(2) ? 1e9 : -1e9;
                ray.direction = Vec3d::Zero();
                ray.direction[axis] = ray.origin[axis] < 0.0 ? 1.0 : -1.0;
            }
            return ray;
        }
        case 7: {  // along a face, nearly
            ray = {place(0, side), direction()};
            const int axis = whole(3);
            ray.origin[axis] = std::floor(ray.origin[axis]);
            if (whole(2)) ray.origin[axis] = std::nextafter(ray.origin[axis], whole(2) ? kInfinity : -kInfinity);
            ray.direction[axis] *= std::ldexp(1.0, -10 * whole(12));
            return ray;
        }
        default: {  // from a face, an edge or a corner of a voxel
            ray = {place(0, side), direction()};
            for (int a = 0; a < 3; ++a)
                if (whole(2)) ray.origin[a] = std::floor(ray.origin[a]);
            return ray;
        }
    }
}

std::string described(const VoxelRay& ray) {
    char text[400];
    std::snprintf(text, sizeof text, "origin %a %a %a, direction %a %a %a", ray.origin.x(), ray.origin.y(), ray.origin.z(),
                  ray.direction.x(), ray.direction.y(), ray.direction.z());
    return text;
}

std::string described(const std::optional<VoxelHit>& hit) {
    if (!hit) return "nothing";
    char text[200];
    std::snprintf(text, sizeof text, "depth %d cell %u %u %u t %.17g face %d", hit->depth, hit->cell[0], hit->cell[1], hit->cell[2], hit->t,
                  int(hit->face));
    return text;
}

::testing::AssertionResult same_place(const std::optional<VoxelHit>& a, const std::optional<VoxelHit>& b) {
    if (a.has_value() == b.has_value() && (!a || (a->cell == b->cell && a->depth == b->depth && a->t == b->t && a->face == b->face)))
        return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << described(a) << ", not " << described(b);
}

/// Rays in all: STRATA_RAYS, or as many as take a few seconds.
int ray_count() {
    const char* text = std::getenv("STRATA_RAYS");
    return text ? std::atoi(text) : test::built_with_sanitizer() ? 250'000 : 1'000'000;
}

VoxelTree tree_of_one(int levels, uint32_t x, uint32_t y, uint32_t z) {
    VoxelCube voxels(levels);
    voxels.set(x, y, z);
    return tree_of(voxels);
}

TEST(RayCast, TwinsVisitWhatIsDrawnByHand) {
    // From (-1, 0.25) with slope 1/2 in the plane z = 2.5: x = 0 at y = 0.75, then y = 1 at x = 0.5, x = 1, x = 2, y = 2 at x = 2.5, x = 3,
    // x = 4.
    const VoxelRay ray{{-1.0, 0.25, 2.5}, {2.0, 1.0, 0.0}};
    const std::vector<Cell> cells = {{0, 0, 2}, {0, 1, 2}, {1, 1, 2}, {2, 1, 2}, {2, 2, 2}, {3, 2, 2}};
    const std::vector<double> ts = {0.5, 0.75, 1.0, 1.5, 1.75, 2.0};
    std::vector<Cell> visited, printed;
    std::vector<double> visited_t, printed_t;
    for (const Visit& visit : visits_of(4, ray, 0.0, kInfinity)) {
        visited.push_back(visit.voxel);
        visited_t.push_back(visit.t);
    }
    walk_as_printed(4, ray, [&](const Cell& voxel, double t) {
        printed.push_back(voxel);
        printed_t.push_back(t);
        return true;
    });
    EXPECT_EQ(visited, cells);
    EXPECT_EQ(visited_t, ts);
    EXPECT_EQ(printed, cells);
    EXPECT_EQ(printed_t, ts);
    // Down, from inside: z = 3.5 falls to 3, 2, 1, 0.
    const VoxelRay down{{1.5, 1.5, 3.5}, {0.0, 0.0, -0.25}};
    visited.clear();
    for (const Visit& visit : visits_of(4, down, 0.0, kInfinity)) visited.push_back(visit.voxel);
    EXPECT_EQ(visited, (std::vector<Cell>{{1, 1, 3}, {1, 1, 2}, {1, 1, 1}, {1, 1, 0}}));
    // What is touched: at x = 1 the ray is at y = 1.25, so it passes by the box of (0, 2) made larger by m where 1.25 + m / 2 < 2 - m: m <
    // 1/2.
    const auto touches = [&](const Cell& voxel, long double margin) {
        return chord(ray, voxel, margin).first <= chord(ray, voxel, margin).second;
    };
    EXPECT_TRUE(touches({2, 1, 2}, 0));
    EXPECT_TRUE(touches({2, 1, 2}, -0.1L));
    EXPECT_FALSE(touches({0, 2, 2}, 0.49L));
    EXPECT_TRUE(touches({0, 2, 2}, 0.51L));
}

TEST(RayCast, HitsOneVoxelFromEachSide) {
    const VoxelTree tree = tree_of_one(3, 37, 10, 22);
    const Vec3d middle(37.5, 10.5, 22.5);
    for (int axis = 0; axis < 3; ++axis)
        for (const double sign : {1.0, -1.0}) {
            VoxelRay ray{middle, Vec3d::Zero()};
            ray.origin[axis] -= sign * 1000.0;
            ray.direction[axis] = sign * 2.0;
            const auto hit = cast_ray(tree, ray);
            ASSERT_TRUE(hit);
            EXPECT_EQ(hit->cell, (Cell{37, 10, 22}));
            EXPECT_EQ(hit->depth, 6);
            EXPECT_EQ(hit->t, 999.5 / 2);
            EXPECT_EQ(hit->face, CellFace(2 * axis + (sign < 0)));
            EXPECT_EQ(hit->level, 2);
            EXPECT_EQ(hit->node, 0u);
            EXPECT_EQ(hit->bit, mask_bit(37, 10, 22));
            ray.direction = -ray.direction;
            EXPECT_FALSE(cast_ray(tree, ray));
            EXPECT_FALSE(is_occluded(tree, ray));
        }
}

TEST(RayCast, StartsInACellOrOnItsFace) {
    const VoxelTree tree = tree_of_one(2, 5, 5, 5);
    const auto face_of = [&](const VoxelRay& ray) -> int {
        const auto hit = cast_ray(tree, ray);
        if (!hit) return -1;
        EXPECT_EQ(hit->t, 0.0);
        return int(hit->face);
    };
    EXPECT_EQ(face_of({{5.5, 5.5, 5.5}, {1, 0, 0}}), int(CellFace::inside));
    EXPECT_EQ(face_of({{5.0, 5.5, 5.5}, {1, 0, 0}}), int(CellFace::min_x));
    EXPECT_EQ(face_of({{6.0, 5.5, 5.5}, {-1, 0, 0}}), int(CellFace::max_x));
    EXPECT_EQ(face_of({{5.0, 5.5, 5.5}, {-1, 0, 0}}), -1);  // looks away: it would shadow itself
    EXPECT_EQ(face_of({{6.0, 5.5, 5.5}, {1, 0, 0}}), -1);
    EXPECT_EQ(face_of({{5.0, 5.5, 5.5}, {0, 1, 0}}), int(CellFace::inside));  // along a face: it belongs to the cell above it
    EXPECT_EQ(face_of({{6.0, 5.5, 5.5}, {0, 1, 0}}), -1);
    EXPECT_EQ(face_of({{5.0, 5.0, 5.0}, {1, 1, 1}}), int(CellFace::min_z));
    EXPECT_EQ(face_of({{6.0, 6.0, 6.0}, {-1, -1, -1}}), int(CellFace::max_z));
}

TEST(RayCast, PassesNoWallWhoseCellsShareFaces) {
    // A diagonal wall x = y in a 6-connected staircase: a ray along the other diagonal meets its edges.
    const VoxelTree tree = tree_of(cube_where(2, [](uint32_t x, uint32_t y, uint32_t) { return x + y == 14 || x + y == 15; }));
    for (int i = 0; i < 16; ++i) {
        EXPECT_TRUE(cast_ray(tree, {{double(i) - 16, double(i) - 16, 0.5}, {1, 1, 0}})) << i;
        EXPECT_TRUE(cast_ray(tree, {{32.0 - i, 32.0 - i, 0.5}, {-1, -1, 0}})) << i;
    }
}

TEST(RayCast, KnowsItsLimits) {
    const VoxelTree tree = tree_of(cube_where(2, [](uint32_t x, uint32_t, uint32_t) { return x == 3 || x == 9; }));
    const VoxelRay ray{{-1.0, 4.5, 4.5}, {1, 0, 0}};
    EXPECT_EQ(cast_ray(tree, ray)->t, 4.0);
    EXPECT_EQ(cast_ray(tree, ray, {.least_t = 4.5})->t, 4.5);
    EXPECT_EQ(cast_ray(tree, ray, {.least_t = 5.0})->t, 10.0);
    EXPECT_TRUE(is_occluded(tree, ray, {.most_t = 4.0}));
    EXPECT_FALSE(is_occluded(tree, ray, {.most_t = 3.99}));
    EXPECT_FALSE(cast_ray(tree, ray, {.least_t = 5.0, .most_t = 9.5}));
    EXPECT_FALSE(cast_ray(tree, ray, {.least_t = 50.0}));
    EXPECT_FALSE(cast_ray(tree, ray, {.least_t = kInfinity}));
    EXPECT_FALSE(cast_ray(tree, ray, {.most_t = kNaN}));
    EXPECT_EQ(cast_ray(tree, ray, {.depth = 3})->t, 3.0);  // cells of side 2
    EXPECT_EQ(cast_ray(tree, ray, {.depth = 2})->t, 1.0);
    EXPECT_EQ(cast_ray(tree, ray, {.depth = 1})->cell, (Cell{0, 0, 0}));
    EXPECT_EQ(cast_ray(tree, ray, {.depth = 0})->depth, 1);
}

TEST(RayCast, NothingIsHitByWhatIsNoRay) {
    const VoxelTree tree = tree_of(cube_where(1, [](uint32_t, uint32_t, uint32_t) { return true; }));
    EXPECT_TRUE(cast_ray(tree, {{1.5, 1.5, 1.5}, {1, 0, 0}}));
    for (const Vec3d& direction :
         {Vec3d(0, 0, 0), Vec3d(-0.0, 0, 0), Vec3d(kNaN, 1, 0), Vec3d(1, kNaN, 0), Vec3d(kInfinity, 0, 0), Vec3d(0, 1, -kInfinity)})
        EXPECT_FALSE(cast_ray(tree, {{1.5, 1.5, 1.5}, direction}));
    for (const double bad : {kNaN, kInfinity, -kInfinity})
        for (int a = 0; a < 3; ++a) {
            VoxelRay ray{{1.5, 1.5, 1.5}, {1, 1, 1}};
            ray.origin[a] = bad;
            EXPECT_FALSE(cast_ray(tree, ray));
        }
    EXPECT_FALSE(cast_ray(VoxelTree{}, {{0.5, 0.5, 0.5}, {1, 0, 0}}));
    for (const double far : {1e15, 1e18, 1e100, 1e300, 1.7e308})  // too far to tell voxels apart, but it ends
        for (const Vec3d& d : {Vec3d(-1, 0, 0), Vec3d(-1, -1e-3, 1e-9), Vec3d(-1, -1, -1)}) cast_ray(tree, {{far, far / 2, 1.5}, d});
}

TEST(RayCast, FindsWhatAllPlaneCrossingsFind) {
    const std::vector<VoxelCube> models = {random_cube(3, 0.003, 1), random_boxes(3, 12, 2), random_cube(2, 0.05, 3),
                                           random_cube(1, 0.1, 4),
                                           cube_where(3, [](uint32_t x, uint32_t y, uint32_t z) { return (x + y + z) % 32 == 0; })};
    const int rays = ray_count() / int(models.size()) / kRayKinds;
    int hits = 0, cast = 0, differing = 0;
    for (const VoxelCube& voxels : models) {
        const VoxelTree tree = tree_of(voxels), with_full = tree_of(voxels, true);
        const std::vector<VoxelCube> pyramid = {voxels};
        Random random(5);
        for (int kind = 0; kind < kRayKinds; ++kind)
            for (int i = 0; i < rays; ++i) {
                const VoxelRay ray = random_ray(random, kind, voxels.side());
                std::optional<VoxelHit> expected;
                for (const Visit& visit : visits_of(voxels.side(), ray, 0.0, kInfinity))
                    if (voxels.at(visit.voxel[0], visit.voxel[1], visit.voxel[2])) {
                        expected = VoxelHit{.t = visit.t, .cell = visit.voxel, .depth = 2 * voxels.levels};
                        int axis = visit.axis;
                        for (int a = 0; a < 3 && visit.axis < 0; ++a)
                            if (ray.direction[a] != 0.0 &&
                                crossing_t(ray, a, visit.voxel[size_t(a)] + (ray.direction[a] > 0.0 ? 0 : 1)) == 0.0)
                                axis = a;
                        expected->face = axis < 0 ? CellFace::inside : CellFace(2 * axis + (ray.direction[axis] > 0.0 ? 0 : 1));
                        break;
                    }
                const auto hit = cast_ray(tree, ray);
                ASSERT_TRUE(same_place(hit, expected)) << "kind " << kind << ", " << described(ray);
                ASSERT_TRUE(same_place(cast_ray(with_full, ray), expected)) << "full cells, kind " << kind << ", " << described(ray);
                ASSERT_TRUE(is_candidate(voxels, ray, hit, differing)) << "kind " << kind << ", " << described(ray);
                hits += hit.has_value();
                ++cast;
            }
    }
    EXPECT_GT(hits, cast / 4);
    EXPECT_LT(hits, cast - cast / 4);
    std::printf("%d rays, %d hits; %d pass an edge where the printed walk takes another of its voxels\n", cast, hits, differing);
}

TEST(RayCast, StopsAtCellsOfADepthOrAPixel) {
    const std::vector<VoxelCube> models = {random_cube(2, 0.01, 6), random_boxes(3, 10, 7), random_cube(3, 0.0005, 8)};
    int depths_seen = 0;
    for (const VoxelCube& voxels : models) {
        const std::vector<VoxelCube> pyramid = pyramid_of(voxels);
        const VoxelTree tree = tree_of(voxels), with_full = tree_of(voxels, true);
        Random random(9);
        for (int i = 0; i < 30'000; ++i) {
            const VoxelRay ray = random_ray(random, i % kRayKinds, voxels.side());
            const double length = voxels.side() / ray.direction.norm();
            RayLimits limits{.depth = 1 + int(random.uniform() * 7)};
            if (i & 1) limits.least_t = random.uniform() * length;
            if (i & 2) limits.most_t = random.uniform() * 2 * length;
            if (i & 4) limits.spread = random.uniform() * 8 / length;
            if (i & 8) limits.footprint = random.uniform() * 6;
            const auto expected = first_stop(pyramid, ray, limits);
            if (expected) depths_seen |= 1 << expected->depth;
            ASSERT_TRUE(same_place(cast_ray(tree, ray, limits), expected))
                << i << ", " << described(ray) << ", depth " << limits.depth << " t " << limits.least_t << " to " << limits.most_t
                << " spread " << limits.spread << " footprint " << limits.footprint;
            ASSERT_TRUE(same_place(cast_ray(with_full, ray, limits), expected)) << "full cells, " << i << ", " << described(ray);
            ASSERT_EQ(is_occluded(tree, ray, limits), expected.has_value());
        }
    }
    EXPECT_EQ(depths_seen, 0b1111110);
}

TEST(RayCast, PlaceOfAttributesIsThatOfTheCell) {
    const VoxelCube voxels = random_cube(3, 0.01, 10);
    const VoxelTree tree = tree_of(voxels);
    Random random(11);
    for (int i = 0; i < 20'000; ++i) {
        const VoxelRay ray = random_ray(random, i % kRayKinds, voxels.side());
        const RayLimits limits{.depth = 1 + i % 6};
        const auto hit = cast_ray(tree, ray, limits);
        if (!hit) continue;
        ASSERT_EQ(hit->depth, limits.depth);
        ASSERT_EQ(hit->level, (hit->depth - 1) / 2);
        // From the root down to the cell by its coordinates.
        uint32_t node = 0;
        for (int level = 0; level < hit->level; ++level) {
            const int shift = hit->depth - 2 * level - 2;
            node = tree.levels[size_t(level)].child(node, mask_bit(hit->cell[0] >> shift, hit->cell[1] >> shift, hit->cell[2] >> shift));
        }
        ASSERT_EQ(hit->node, node);
        if (hit->depth % 2 == 0) ASSERT_EQ(hit->bit, mask_bit(hit->cell[0], hit->cell[1], hit->cell[2]));
        else ASSERT_EQ(hit->bit >> 3, int(octant_code(hit->cell[0] & 1, hit->cell[1] & 1, hit->cell[2] & 1)));
    }
}

TEST(RayCast, TreesOfFewerLevelsAreCoarser) {
    const VoxelCube voxels = random_boxes(3, 10, 12);
    VoxelTree whole = tree_of(voxels), cut = whole;
    cut.levels.pop_back();
    cut.levels.back().first_child.clear();
    Random random(13);
    for (int i = 0; i < 50'000; ++i) {
        const VoxelRay ray = random_ray(random, i % kRayKinds, voxels.side());
        auto expected = cast_ray(whole, ray, {.depth = 4});
        ASSERT_TRUE(same_place(cast_ray(cut, ray), expected)) << described(ray);
        ASSERT_TRUE(same_place(cast_ray(cut, ray, {.depth = 3}), cast_ray(whole, ray, {.depth = 3}))) << described(ray);
    }
}

TEST(RayCast, AnyLengthOfDirectionIsTheSameRay) {
    const VoxelCube voxels = random_boxes(3, 10, 14);
    const VoxelTree tree = tree_of(voxels);
    Random random(15);
    for (int i = 0; i < 50'000; ++i) {
        VoxelRay ray = random_ray(random, i % 2, voxels.side());
        ray.direction /= ray.direction.cwiseAbs().maxCoeff();
        const auto expected = cast_ray(tree, ray);
        for (const int exponent : {-900, -120, -60, 60, 120, 900, 1022}) {
            VoxelRay other = ray;
            for (int a = 0; a < 3; ++a) other.direction[a] = std::scalbn(ray.direction[a], exponent);
            const auto hit = cast_ray(tree, other, {.least_t = 0.0, .most_t = kInfinity});
            ASSERT_EQ(hit.has_value(), expected.has_value());
            if (!hit) continue;
            ASSERT_EQ(hit->cell, expected->cell);
            ASSERT_EQ(hit->face, expected->face);
            ASSERT_EQ(hit->t, std::scalbn(expected->t, -exponent));
        }
    }
}

TEST(RayCast, DenormalDirections) {
    const VoxelTree tree = tree_of_one(2, 5, 6, 7);
    for (const double tiny : {0.0, -0.0, 5e-324, -5e-324, 1e-310, -1e-310, 1e-300}) {
        const auto hit = cast_ray(tree, {{-3.0, 6.5, 7.5}, {1.0, tiny, -tiny}});
        ASSERT_TRUE(hit);
        EXPECT_EQ(hit->t, 8.0);
        EXPECT_FALSE(cast_ray(tree, {{-3.0, 7.5, 7.5}, {1.0, tiny, tiny}}));
    }
    const auto hit = cast_ray(tree, {{4.0, 5.0, 6.0}, {5e-324, 5e-324, 5e-324}});  // all of the least there is: a diagonal
    ASSERT_TRUE(hit);
    EXPECT_EQ(hit->cell, (Cell{5, 6, 7}));
}

TEST(RayCast, SpansAndTilesFindWhatSingleRaysFind) {
    const std::vector<VoxelCube> models = {random_boxes(3, 8, 16), random_cube(3, 0.001, 17), VoxelCube(2)};
    Random random(18);
    size_t hit_count = 0;
    for (const VoxelCube& voxels : models)
        for (const bool with_full : {false, true}) {
            const VoxelTree tree = tree_of(voxels, with_full);
            for (int i = 0; i < 600; ++i) {
                VoxelTile tile{.first = random_ray(random, i % kRayKinds, voxels.side()),
                               .width = 1 + int(random.uniform() * 17),
                               .height = 1 + int(random.uniform() * 17)};
                const auto change = [&](double size) {
                    return Vec3d(random.normal() * size, random.normal() * size, random.normal() * size);
                };
                const double size = std::ldexp(1.0, -int(random.uniform() * 12));
                if (i % 3 != 1) {  // perspective
                    tile.direction_per_x = change(size * tile.first.direction.norm() / 8);
                    tile.direction_per_y = change(size * tile.first.direction.norm() / 8);
                }
                if (i % 3 != 0) {  // orthographic, or both
                    tile.origin_per_x = change(size);
                    tile.origin_per_y = change(size);
                    if (i % 2) tile.origin_per_x = Vec3d(1, 0, 0), tile.origin_per_y = Vec3d(0, 0, -1);
                }
                RayLimits limits;
                const double length = voxels.side() / tile.first.direction.norm();
                if (i & 8) limits.depth = 1 + int(random.uniform() * 6);
                if (i & 16) limits.spread = random.uniform() * 4 / length;
                if (i & 32) limits.least_t = random.uniform() * length;
                if (i & 64) limits.most_t = random.uniform() * 2 * length;
                if (i & 128) limits.footprint = random.uniform() * 4;
                std::vector<VoxelHit> hits(size_t(tile.width) * size_t(tile.height), VoxelHit{.t = 7, .depth = 3}), of_span = hits;
                std::vector<VoxelRay> rays;
                for (int y = 0; y < tile.height; ++y)
                    for (int x = 0; x < tile.width; ++x) rays.push_back(tile.ray(x, y));
                const SimdLevel level = simd_levels()[size_t(i) % simd_levels().size()];
                cast_tile(tree, tile, limits, hits, level);
                cast_rays(tree, rays, limits, of_span, level);
                for (size_t k = 0; k < rays.size(); ++k) {
                    const VoxelHit expected = cast_ray(tree, rays[k], limits, SimdLevel::baseline).value_or(VoxelHit{});
                    ASSERT_EQ(hits[k], expected) << "tile " << i << " ray " << k << ", " << described(rays[k]);
                    ASSERT_EQ(of_span[k], expected) << "span " << i << " ray " << k << ", " << described(rays[k]);
                    hit_count += expected.depth > 0;
                }
            }
        }
    EXPECT_GT(hit_count, 10'000u);
}

}  // namespace
}  // namespace strata
