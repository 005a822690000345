#include "core/surface/grid_at_vertices.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/surface/contour.h"
#include "tests/support/field_source.h"
#include "tests/support/surface_in_memory.h"

namespace strata {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
constexpr std::array<uint32_t, 3> kSize = {40, 33, 50};

GridPlacement leaning() {
    GridPlacement placement;
    placement.origin = {1000.5, -2000.25, 300};
    placement.axes << 0.5, 0.125, 0, 0, 0.75, 0.0625, -0.25, 0, 1.5;
    return placement;
}

// Waves in every direction: a surface that crosses every slice, with parts that come and go.
double waves(int i, int j, int k) { return std::sin(0.37 * i) + std::cos(0.29 * j) + std::sin(0.41 * k + 0.1 * i); }

double linear(const Vec3d& p) { return 3.0 * p.x() - 2.0 * p.y() + 0.5 * p.z() + 7.0; }

float index_value(const GridPlacement& placement, int i, int j, int k) { return float(linear(placement.world_from_index(Vec3d(i, j, k)))); }

SurfaceInMemory contoured(const ContourSettings& settings, ValuesAtVertices& values, const GridPlacement& placement) {
    SurfaceInMemory found;
    SurfaceWithValues with(found);
    with.add_values("linear", values);
    test::FunctionSlices slices(kSize, waves, placement);
    contour_slices(slices, settings, with);
    with.finish();
    EXPECT_FALSE(found.refers_ahead);
    EXPECT_EQ(found.scalars.at(0).size(), found.positions.size());
    return found;
}

// Rounding of a place to float moves it by 2^-24 of its size, of which a slope makes a change of the value; then values are floats themselves.
double allowed(const GridPlacement& placement, const Vec3d& p) {
    return 3.75 * 0x1p-22 * (p - placement.origin).cwiseAbs().sum() + 0x1p-22 * std::abs(linear(p)) + 0x1p-23 * 10000;
}

// A trilinear interpolant is exact for what is linear, streamed beside the field or in memory, whatever the memory and the threads.
TEST(GridAtVertices, ALinearFieldIsFoundAgain) {
    const GridPlacement placement = leaning();
    const auto value = [&](int i, int j, int k) { return double(index_value(placement, i, j, k)); };
    std::vector<float> first;
    for (const uint64_t memory : {uint64_t{60'000}, uint64_t{1} << 18, uint64_t{1} << 30})
        for (const int threads : {1, 4}) {
            test::FunctionSlices source(kSize, value, placement);
            SlicesAtVertices streamed(source, threads);
            const SurfaceInMemory found = contoured({.isovalues = {0.2}, .threads = threads, .memory_bytes = memory}, streamed, placement);
            ASSERT_GT(found.positions.size(), 10'000u);
            ASSERT_EQ(found.scalars.size(), 1u);
            for (size_t v = 0; v < found.positions.size(); ++v) ASSERT_NEAR(found.scalars[0][v], linear(found.positions[v]), allowed(placement, found.positions[v])) << v;
            if (first.empty()) first = found.scalars[0];
            EXPECT_EQ(found.scalars[0], first) << memory << ' ' << threads;
        }
    // In memory they are the same numbers.
    test::FunctionSlices source(kSize, value, placement);
    GridAtVertices held(source, uint64_t{1} << 30, 2);
    EXPECT_EQ(contoured({.isovalues = {0.2}}, held, placement).scalars[0], first);
    // On another grid around it, with larger steps and turned.
    GridPlacement other;
    other.origin = placement.origin + Vec3d(-20, -20, -20);
    other.axes << 0, 2.5, 0, 0, 0, 3.5, 3, 0, 0;
    test::FunctionSlices elsewhere({60, 40, 30}, [&](int i, int j, int k) { return double(index_value(other, i, j, k)); }, other);
    GridAtVertices around(elsewhere, uint64_t{1} << 30);
    const SurfaceInMemory found = contoured({.isovalues = {0.2}}, around, placement);
    for (size_t v = 0; v < found.positions.size(); ++v) ASSERT_NEAR(found.scalars[0][v], linear(found.positions[v]), allowed(placement, found.positions[v])) << v;
}

// A vertex lies on an edge between two samples and is made of these alone: of the same field it has the isovalue, and unknown samples beside it do not matter.
TEST(GridAtVertices, VerticesAskOnlyForTheSamplesOfTheirEdge) {
    for (const GridPlacement& placement : {GridPlacement{}, leaning()}) {
        test::FunctionSlices same(kSize, waves, placement);
        SlicesAtVertices values(same);
        const SurfaceInMemory found = contoured({.isovalues = {0.2}}, values, placement);
        size_t inner = 0;
        for (const float value : found.scalars[0]) inner += std::abs(value - 0.2f) > 2e-3f;  // vertices within cells; those moved from samples by 2^-10 of an edge change by 0.001
        EXPECT_LT(inner, found.scalars[0].size() / 500);
        // What is outside is unknown: each vertex has one sample inside and one outside, so none is known; and with all known but those
        // farther than an edge from the inside, all are.
        const auto known_near = [](int i, int j, int k) {
            for (int n = 0; n < 7; ++n) {
                const int step = n % 2 ? 1 : -1, axis = n / 2;
                if (waves(i + (axis == 0) * step, j + (axis == 1) * step, k + (axis == 2) * step) >= 0.2) return 1.0;
            }
            return waves(i, j, k) >= 0.2 ? 1.0 : double(kUnknown);
        };
        test::FunctionSlices near(kSize, known_near, placement);
        SlicesAtVertices near_values(near);
        const SurfaceInMemory near_found = contoured({.isovalues = {0.2}}, near_values, placement);
        const auto& ones = near_found.scalars[0];
        EXPECT_LT(size_t(std::count_if(ones.begin(), ones.end(), [](float v) { return v != 1.0f; })), ones.size() / 500);
        test::FunctionSlices inside(kSize, [](int i, int j, int k) { return waves(i, j, k) >= 0.2 ? 1.0 : double(kUnknown); }, placement);
        SlicesAtVertices inside_values(inside);
        const SurfaceInMemory none = contoured({.isovalues = {0.2}}, inside_values, placement);
        for (const float value : none.scalars[0]) ASSERT_TRUE(std::isnan(value));
    }
}

// Half a step beyond the outermost samples, where a closed surface ends, values go on; farther out nothing is known.
TEST(GridAtVertices, ReachHalfAStepBeyondTheGrid) {
    const auto value = [](int i, int j, int k) { return 1.0 + i + 10.0 * j + 100.0 * k; };
    const std::vector<Vec3f> places = {{0, 0, 0}, {-0.5f, 0, 0}, {-0.51f, 0, 0}, {2, 3, 4}, {2.5f, 3.5f, 4.5f}, {2, 3, 4.6f}, {1e30f, 0, 0}, {0.25f, 1.5f, 4}};
    const std::vector<float> expected = {1, 1, kUnknown, 433, 433, kUnknown, kUnknown, 416.25f};
    for (const bool streamed : {false, true}) {
        test::FunctionSlices source({3, 4, 5}, value);
        std::unique_ptr<ValuesAtVertices> values;
        if (streamed) values = std::make_unique<SlicesAtVertices>(source);
        else values = std::make_unique<GridAtVertices>(source, 240);
        std::vector<float> found(places.size());
        values->look_up(Vec3d::Zero(), places, found);
        for (size_t i = 0; i < places.size(); ++i)
            if (std::isnan(expected[i])) EXPECT_TRUE(std::isnan(found[i])) << i;
            else EXPECT_EQ(found[i], expected[i]) << i;
    }
    test::FunctionSlices source({3, 4, 5}, value);
    EXPECT_THROW(GridAtVertices(source, 239), Error);
    // The closed surface of a field that is inside everywhere has all its vertices there.
    test::FunctionSlices full(kSize, [](int, int, int) { return 5.0; }), attribute(kSize, [](int, int, int) { return 2.5; });
    SlicesAtVertices values(attribute);
    SurfaceInMemory found;
    SurfaceWithValues with(found);
    with.add_values("a", values);
    contour_slices(full, {.isovalues = {1.0}, .close = true}, with);
    ASSERT_GT(found.scalars.at(0).size(), 1000u);
    for (const float v : found.scalars[0]) EXPECT_EQ(v, 2.5f);
}

TEST(GridAtVertices, GridsAreTheSameWhereTheirSamplesAre) {
    const auto zero = [](int, int, int) { return 0.0; };
    const test::FunctionSlices a(kSize, zero, leaning());
    GridPlacement moved = leaning(), stretched = leaning();
    moved.origin.x() += 0.001;
    stretched.axes *= 1.00001;  // 0.0005 steps at the far end
    EXPECT_TRUE(is_same_grid(a, test::FunctionSlices(kSize, zero, leaning())));
    EXPECT_FALSE(is_same_grid(a, test::FunctionSlices({40, 33, 51}, zero, leaning())));
    EXPECT_FALSE(is_same_grid(a, test::FunctionSlices(kSize, zero, moved)));
    EXPECT_FALSE(is_same_grid(a, test::FunctionSlices(kSize, zero, stretched)));
}

}  // namespace
}  // namespace strata
