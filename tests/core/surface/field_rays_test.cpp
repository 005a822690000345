#include "core/surface/field_rays.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "core/math/random.h"
#include "core/surface/trilinear_root.h"
#include "tests/support/field_source.h"

namespace strata {
namespace {

using test::FunctionBricks;
using test::FunctionSlices;

constexpr uint64_t kAmple = uint64_t{1} << 30;

FieldBricks dense(std::array<uint32_t, 3> size, FunctionSlices::Value value, GridPlacement placement = {}) {
    FunctionSlices source(size, std::move(value), placement);
    return FieldBricks::of_slices(source, kAmple, 2);
}

Vec3d random_direction(Random& random) { return Vec3d(random.normal(), random.normal(), random.normal()).normalized(); }

// The interpolant by its definition; NaN where a corner is missing.
double interpolated(const FieldBricks& field, const Vec3d& p) {
    const int32_t i = int32_t(std::floor(p[0])), j = int32_t(std::floor(p[1])), k = int32_t(std::floor(p[2]));
    const Vec3d part(p[0] - i, p[1] - j, p[2] - k);
    double sum = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        const int x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
        sum += (x ? part[0] : 1 - part[0]) * (y ? part[1] : 1 - part[1]) * (z ? part[2] : 1 - part[2]) *
               double(field.sample(i + x, j + y, k + z));
    }
    return sum;
}

TEST(TrilinearRoot, TheCubicIsTheInterpolant) {
    Random random(1);
    for (int round = 0; round < 2000; ++round) {
        std::array<double, 8> corners;
        for (double& value : corners) value = random.normal();
        const Vec3d from(random.uniform(), random.uniform(), random.uniform()), to(random.uniform(), random.uniform(), random.uniform());
        const double s = random.uniform();
        const Vec3d p = from + s * (to - from);
        double sum = 0.0;
        for (int n = 0; n < 8; ++n)
            sum += (n & 1 ? p[0] : 1 - p[0]) * (n & 2 ? p[1] : 1 - p[1]) * (n & 4 ? p[2] : 1 - p[2]) * corners[size_t(n)];
        EXPECT_NEAR(trilinear_on_line(corners, from, to - from)(s), sum, 1e-14);
    }
}

// Cubics with chosen roots: none of two close ones is missed, and the first is found.
TEST(TrilinearRoot, FindsTheFirstOfChosenRoots) {
    Random random(2);
    size_t close_pairs = 0;
    for (int round = 0; round < 200'000; ++round) {
        double roots[3];
        for (double& root : roots) root = random.uniform(-0.5, 1.5);
        if (round % 2 == 0) roots[1] = roots[0] + std::exp2(random.uniform(-18, -2));
        std::sort(roots, roots + 3);
        const double scale = (round & 4 ? 1.0 : -1.0) * std::exp2(random.uniform(-20, 20));
        const LineCubic cubic = {{-scale * roots[0] * roots[1] * roots[2],
                                  scale * (roots[0] * roots[1] + roots[1] * roots[2] + roots[2] * roots[0]),
                                  -scale * (roots[0] + roots[1] + roots[2]), scale}};
        const auto first = std::find_if(roots, roots + 3, [](double root) { return root > 0.0; });
        const std::optional<double> found = first_crossing(cubic);
        if (first == roots + 3 || *first > 1.0) {
            EXPECT_FALSE(found && *found < 1.0 - 1e-6) << round;
            continue;
        }
        if (*first < 1e-9 || *first > 1.0 - 1e-9) continue;
        close_pairs += first + 1 < roots + 3 && first[1] - first[0] < 1e-4;
        ASSERT_TRUE(found) << round << ": " << roots[0] << ' ' << roots[1] << ' ' << roots[2];
        // Roots that are d apart are known to a rounding over d.
        double gap = 1.0;
        for (const double root : roots)
            if (&root != first) gap = std::min(gap, std::abs(root - *first));
        EXPECT_NEAR(*found, *first, 1e-11 + 1e-14 / gap) << round;
    }
    EXPECT_GT(close_pairs, 1000u);
}

TEST(TrilinearRoot, DoubleRootsAndConstants) {
    EXPECT_NEAR(first_crossing({{-0.25, 1.0, -1.0, 0.0}}).value(), 0.5, 1e-7);    // -(s - 1/2)^2 touches zero from outside
    EXPECT_FALSE(first_crossing({{0.25, -1.0, 1.0, 0.0}}));                       // (s - 1/2)^2 does from inside, and zero is inside
    EXPECT_NEAR(first_crossing({{-0.125, 0.75, -1.5, 1.0}}).value(), 0.5, 1e-4);  // (s - 1/2)^3
    EXPECT_FALSE(first_crossing({{0.0, 0.0, 0.0, 0.0}}));
    EXPECT_FALSE(first_crossing({{-1.0, 0.0, 0.0, 0.0}}));
    EXPECT_NEAR(first_crossing({{-1.0, 1.0, 0.0, 0.0}}).value(), 1.0, 1e-11);  // comes to zero at the end
}

// On an exact distance to a sphere the interpolant's surface lies within h^2 / (8 R) of it, times 2 for two curvatures and the diagonal.
TEST(FieldRays, ASphereIsWhereItIs) {
    const Vec3d middle(20.3, 21.7, 19.1);
    const double radius = 15.2;
    for (const ContourInside inside : {ContourInside::below, ContourInside::above}) {
        const double sign = inside == ContourInside::below ? 1.0 : -1.0;
        const FieldBricks field =
            dense({42, 45, 39}, [&](int i, int j, int k) { return sign * ((Vec3d(i, j, k) - middle).norm() - radius); });
        const FieldSurface surface(field, {0.0, inside}, 2);
        const FieldNormals normals(surface);
        Random random(3);
        for (int round = 0; round < 20'000; ++round) {
            const Vec3d direction = random_direction(random),
                        aside = random_direction(random).cross(direction).normalized() * random.uniform(0, 14.5);
            const FieldRay ray = {middle + aside - 60 * direction, direction};
            const double half = std::sqrt(radius * radius - aside.squaredNorm());
            const auto hit = cast_ray(surface, ray);
            ASSERT_TRUE(hit) << round;
            EXPECT_FALSE(hit->from_inside);
            const Vec3d place = ray.origin + hit->t * ray.direction;
            EXPECT_NEAR((place - middle).norm(), radius, 3.0 / (8.0 * radius)) << round;
            EXPECT_NEAR(hit->t, 60 - half, 3.0 / (8.0 * radius) * radius / half + 1e-9);
            const Vec3f normal = normals.outward(ray, *hit);
            EXPECT_GT(normal.cast<double>().dot((place - middle).normalized()), std::cos(0.01));
            // From the middle it is left.
            const auto out = cast_ray(surface, {middle, direction});
            ASSERT_TRUE(out);
            EXPECT_TRUE(out->from_inside);
            EXPECT_NEAR(out->t, radius, 3.0 / (8.0 * radius));
        }
    }
}

// Random fields against small steps along the ray: nothing is found earlier, nothing later.
TEST(FieldRays, AgreeWithSmallSteps) {
    Random random(4);
    size_t hits = 0;
    for (int round = 0; round < 60; ++round) {
        std::vector<float> values(12 * 11 * 13);
        for (float& value : values) value = float(random.normal());
        if (round % 3 == 0)
            for (float& value : values) value = std::round(value);  // many equal to the isovalue
        if (round % 3 == 1)
            for (float& value : values)
                if (random.uniform() < 0.02) value = std::nanf("");
        const FieldBricks field = dense({12, 11, 13}, [&](int i, int j, int k) { return double(values[size_t((k * 11 + j) * 12 + i)]); });
        const IsoLevel level = {round % 2 == 0 ? 0.0 : 0.7, round % 4 < 2 ? ContourInside::above : ContourInside::below};
        const FieldSurface surface(field, level);
        for (int n = 0; n < 80; ++n) {
            FieldRay ray = {Vec3d(random.uniform(-3, 15), random.uniform(-3, 14), random.uniform(-3, 16)), random_direction(random)};
            if (n % 10 == 0) ray.direction = Vec3d::Unit(n / 10 % 3);
            if (n % 20 == 0) ray.origin = Vec3d(std::floor(ray.origin[0]), std::floor(ray.origin[1]), std::floor(ray.origin[2]) + 0.5);
            const auto hit = cast_ray(surface, ray);
            const double sign = level.inside == ContourInside::above ? 1.0 : -1.0;
            const auto value = [&](double t) { return sign * (interpolated(field, ray.origin + t * ray.direction) - level.isovalue); };
            const double end = hit ? hit->t - 1e-7 : 20.0;
            double before = std::nan("");
            for (double t = 0.0; t < end; t += 2e-3) {
                const double here = value(t);
                if (!std::isnan(before) && !std::isnan(here) && std::abs(before) > 1e-9 && std::abs(here) > 1e-9)
                    ASSERT_EQ(before > 0.0, here > 0.0) << round << ' ' << n << " at " << t;
                before = here;
            }
            if (!hit) continue;
            ++hits;
            const Vec3d place = ray.origin + hit->t * ray.direction;
            const double found = value(hit->t);
            // On a face that is the grid's last the interpolant asks a sample beyond.
            const bool on_last_face = std::abs(place[0] - 11) < 1e-6 || std::abs(place[1] - 10) < 1e-6 || std::abs(place[2] - 12) < 1e-6;
            if (!(on_last_face && std::isnan(found))) EXPECT_NEAR(found, 0.0, 1e-6) << round << ' ' << n;
        }
    }
    EXPECT_GT(hits, 1000u);
}

// Between what is inside and what is outside some slices are missing, wherever they lie to bricks: there is no surface.
TEST(FieldRays, MissingSlicesHaveNoSurface) {
    for (int first = 1; first < 22; ++first)
        for (int count = 1; count <= 9; ++count) {
            const FieldBricks field = dense({9, 9, 40}, [&](int, int, int k) {
                return k < first ? 1.0 : k < first + count ? std::nan("") : 0.0;
            });
            for (const double sign : {-1.0, 1.0})
                EXPECT_FALSE(cast_ray({field, {0.5}}, {Vec3d(4.3, 3.6, 20 - 30 * sign), Vec3d(0, 0, sign)}))
                    << first << ' ' << count << ' ' << sign;
        }
}

// A plane through samples, seen along diagonals through edges and corners of cells: no ray slips through.
TEST(FieldRays, NoRaySlipsThroughEdges) {
    const FieldBricks field = dense({34, 34, 34}, [](int i, int j, int k) { return double(i + j + k - 48); });
    const FieldSurface surface(field, {});
    for (int a = 0; a < 33; ++a)
        for (int b = 0; b < 33; ++b)
            for (const Vec3d& direction : {Vec3d(1, 1, 1), Vec3d(1, 1, 0), Vec3d(0, 0, 1), Vec3d(1, 2, 1)}) {
                const FieldRay ray = {Vec3d(a, b, 5) - 50.0 * direction, direction};
                const double t = (48 - ray.origin.sum()) / direction.sum();
                const Vec3d place = ray.origin + t * direction;
                if (place.minCoeff() < 1 || place.maxCoeff() > 32) continue;
                const auto hit = cast_ray(surface, ray);
                ASSERT_TRUE(hit) << ray.origin.transpose() << " along " << direction.transpose();
                EXPECT_NEAR(hit->t, t, 1e-9);
            }
}

// Bricks around the surface are enough, wherever they lie.
TEST(FieldRays, SparseFieldsAreDenseOnes) {
    const Vec3d middle(-3.5, 12.25, 30.5);
    const auto distance = [&](int i, int j, int k) { return std::clamp((Vec3d(i, j, k) - middle).norm() - 17.0, -3.0, 3.0); };
    const auto near = [&](int i, int j, int k) {
        bool near = false;
        for (int n = 0; n < 27; ++n) near = near || std::abs(distance(8 * i + n % 3 * 4, 8 * j + n / 3 % 3 * 4, 8 * k + n / 9 * 4)) < 3.0;
        return double(near);
    };
    const std::array<int32_t, 3> first = {-4, -2, 0}, last = {4, 5, 8};
    FunctionBricks sparse_source(first, last, 3.0f, distance, near);
    sparse_source.set_absent(distance);
    const FieldBricks sparse = FieldBricks::of_bricks(sparse_source, kAmple, 2);
    GridPlacement placement;
    placement.origin = Vec3d(-32, -16, 0);
    const FieldBricks whole = dense(
        {64, 56, 64}, [&](int i, int j, int k) { return distance(i - 32, j - 16, k); }, placement);
    EXPECT_LT(sparse.size_bytes(), whole.size_bytes() * 3 / 4);
    const FieldSurface sparse_surface(sparse, {0.0, ContourInside::below}), whole_surface(whole, {0.0, ContourInside::below});
    Random random(5);
    size_t hits = 0;
    for (int round = 0; round < 5000; ++round) {
        const Vec3d from = middle + 40 * random_direction(random), direction = random_direction(random);
        const auto a = cast_ray(sparse_surface, {from - sparse.placement().origin, direction});
        const auto b = cast_ray(whole_surface, {from - whole.placement().origin, direction});
        ASSERT_EQ(a.has_value(), b.has_value()) << round;
        if (!a) continue;
        EXPECT_NEAR(a->t, b->t, 1e-9);
        ++hits;
    }
    EXPECT_GT(hits, 200u);
    FunctionBricks none(first, first, 3.0f, distance, near);
    EXPECT_TRUE(FieldBricks::of_bricks(none, kAmple, 2).empty());
    EXPECT_FALSE(cast_ray({FieldBricks(), {}}, {}));
}

// A surface at the background's value next to a brick: the cells between belong to no brick.
TEST(FieldRays, TheBackgroundBoundsBricks) {
    FunctionBricks source(
        {0, 0, 0}, {1, 1, 1}, 0.0f, [](int, int, int) { return 1.0; }, [](int, int, int) { return 1.0; });
    const FieldBricks field = FieldBricks::of_bricks(source, kAmple, 2);
    const Vec3d shift = -field.placement().origin;
    EXPECT_TRUE(std::isnan(field.sample(-1, 3, 3)));
    for (int axis = 0; axis < 3; ++axis)
        for (const double sign : {-1.0, 1.0}) {
            const FieldRay ray = {Vec3d(3.5, 3.5, 3.5) + shift - 20 * sign * Vec3d::Unit(axis), sign * Vec3d::Unit(axis)};
            const auto hit = cast_ray({field, {0.25}}, ray);
            ASSERT_TRUE(hit) << axis << sign;
            EXPECT_NEAR(hit->t, 20 - 3.5 - 0.75, 1e-6);  // a quarter from 0 at -1 to 1 at 0
        }
}

TEST(FieldRays, EmptyAndDegenerateFields) {
    EXPECT_FALSE(cast_ray({dense({0, 4, 4}, [](int, int, int) { return 1.0; }), {}}, {}));
    EXPECT_FALSE(cast_ray({dense({1, 9, 9}, [](int, int j, int) { return j - 3.5; }), {}}, {Vec3d(0, 0, 3.2), Vec3d::UnitY()}));
    EXPECT_FALSE(cast_ray({dense({9, 9, 9}, [](int, int, int) { return std::nan(""); }), {}}, {Vec3d(3, 3, -5), Vec3d::UnitZ()}));
    EXPECT_FALSE(cast_ray({dense({9, 9, 9}, [](int, int, int) { return 5.0; }), {}}, {Vec3d(3, 3, -5), Vec3d::UnitZ()}));
    // Values that floats and squares of them can just hold.
    for (const double scale : {1e38, 1e-38, 1e-44}) {
        const FieldBricks field = dense({9, 9, 9}, [&](int, int, int k) { return scale * (k - 4); });
        const auto hit = cast_ray({field, {}}, {Vec3d(3.3, 3.4, -5), Vec3d::UnitZ()});
        ASSERT_TRUE(hit) << scale;
        EXPECT_NEAR(hit->t, 9.0, 1e-6);
    }
    FunctionSlices large({64, 64, 64}, [](int, int, int) { return 0.0; });
    EXPECT_THROW(FieldBricks::of_slices(large, 1 << 20, 2), Error);
}

}  // namespace
}  // namespace strata
