#include "core/surface/point_layers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/math/random.h"
#include "tests/support/scanned_points.h"
#include "tests/support/store_in_memory.h"

namespace strata {
namespace {

constexpr double kStep = 0.1, kBrick = 0.8;

PointForm whole_form() {
    PointForm form;
    form.colors = form.normals = true;
    form.scalars = {{.name = "number", .attribute = 1}, {.name = "kind", .attribute = 2, .is_class = true}};
    return form;
}

std::vector<ScannedPoint> random_points(size_t count, uint64_t seed) {
    Random random(seed);
    std::vector<ScannedPoint> points(count);
    for (ScannedPoint& p : points) {
        p.place = 4.0 * Vec3d(random.uniform(), random.uniform(), random.uniform());
        p.normal = Vec3d(random.normal(), random.normal(), random.normal()).normalized().cast<float>();
        p.color = {uint16_t(random.uniform(0, 256)), uint16_t(random.uniform(0, 256)), uint16_t(random.uniform(0, 256))};
        p.number = float(random.uniform());
        p.kind = uint8_t(random.uniform(0, 4));
    }
    return points;
}

// Each point is in a layer or outside, and one brick at each end of each axis has none: whatever the bounds say.
TEST(PointLayers, EveryPointIsInsideOrOutside) {
    const ScannedPoints points(random_points(5000, 1));
    for (int axis = 0; axis < 3; ++axis)
        for (const bool upper : {false, true})
            for (const double bricks : {0.0, 0.5, 0.9, 1.1, 1.5, 2.0, 3.0}) {
                Box3d bounds = points.info().bounds;
                (upper ? bounds.max : bounds.min)[axis] += (upper ? -bricks : bricks) * kBrick;
                const PointGrid grid = PointGrid::around(bounds, kStep, 2.0);
                ScratchBlocks scratch(nullptr);
                PointLayers layers(grid, {}, 1 << 20, scratch);
                const uint64_t outside = layers.distribute(points, 2, {});
                EXPECT_EQ(layers.outside(), outside);
                if (bricks == 0.0) EXPECT_EQ(outside, 0u);
                if (bricks >= 3.0) EXPECT_GT(outside, 0u);
                uint64_t inside = 0;
                for (size_t layer = 0; layer < layers.size(); ++layer) {
                    const uint64_t count = layers.points(layer);
                    if (layer == 0 || layer + 1 == layers.size()) EXPECT_EQ(count, 0u) << axis << upper << bricks;
                    const PointLayer taken = layers.take(layer, false, 1 << 20);
                    EXPECT_EQ(taken.points(), count);
                    inside += count;
                    for (const auto& corner : taken.corners)
                        for (size_t a = 0; a < 2; ++a) {
                            EXPECT_GE(corner[a], kFieldBrickSide);
                            EXPECT_LT(corner[a] / kFieldBrickSide, int64_t(grid.bricks[a]) - 1);
                        }
                }
                EXPECT_EQ(inside + outside, 5000u);
            }
}

TEST(PointLayers, MoreSourcesAddUp) {
    const ScannedPoints points(random_points(1000, 2));
    Box3d bounds = points.info().bounds;
    bounds.max.z() = 2.0;
    ScratchBlocks scratch(nullptr);
    PointForm form;
    form.normals = true;
    PointLayers layers(PointGrid::around(bounds, kStep, 2.0), form, 1 << 20, scratch);
    const uint64_t once = layers.distribute(points, 1, {});
    const NormalCount normals = layers.normals();
    EXPECT_GT(once, 100u);
    EXPECT_GT(normals.up, 100u);
    layers.distribute(points, 2, {});
    EXPECT_EQ(layers.outside(), 2 * once);
    EXPECT_EQ(layers.normals().points, 2 * normals.points);
    EXPECT_EQ(layers.normals().up, 2 * normals.up);
}

TEST(PointLayers, NoBounds) {
    EXPECT_THROW(PointGrid::around(Box3d(), kStep, 2.0), Error);
    Box3d never;
    never.min.setConstant(std::numeric_limits<double>::quiet_NaN());
    never.max = never.min;
    EXPECT_THROW(PointGrid::around(never, kStep, 2.0), Error);
}

// Three points in one cell of half a step, by hand; a fourth is in the cell beside it.
TEST(PointLayers, PointsOfACellBecomeOne) {
    const float unknown = std::numeric_limits<float>::quiet_NaN();
    const ScannedPoints points({{.place = {1.01, 1.01, 1.02}, .normal = {1, 0, 0}, .color = {10, 0, 255}, .number = 1.0f, .kind = 5},
                                {.place = {1.02, 1.01, 1.02}, .normal = {0, 1, 0}, .color = {20, 0, 255}, .number = 4.0f, .kind = 3},
                                {.place = {1.03, 1.04, 1.02}, .normal = {0, 0, 0}, .color = {31, 0, 255}, .number = unknown, .kind = 5},
                                {.place = {1.07, 1.01, 1.02}, .normal = {0, 0, -1}, .color = {1, 2, 3}, .number = unknown, .kind = 9},
                                {.place = {2.01, 1.01, 1.02}, .normal = {0, 0, 1}, .kind = 7},
                                {.place = {2.02, 1.01, 1.02}, .normal = {0, 0, -1}, .kind = 2}});
    ScratchBlocks scratch(nullptr);
    PointLayers layers(PointGrid::around(points.info().bounds, kStep, 2.0), whole_form(), 1 << 20, scratch);
    layers.distribute(points, 1, {});
    EXPECT_EQ(layers.normals().points, 5u);
    EXPECT_EQ(layers.normals().up, 3u);
    const Vec3d origin = layers.grid().placement.origin;
    size_t layer = 0;
    while (layers.points(layer) == 0) ++layer;
    ASSERT_EQ(layers.points(layer), 6u);
    std::vector<std::array<int32_t, 3>> places;
    const PointLayer taken = layers.take(layer, true, 1 << 20, &places);
    EXPECT_EQ(places.size(), 6u);
    ASSERT_EQ(taken.points(), 3u);
    ASSERT_EQ(taken.begins.size(), taken.corners.size() + 1);
    const auto place = [&](uint32_t p) {
        size_t b = 0;
        while (taken.begins[b + 1] <= p) ++b;
        EXPECT_EQ(taken.find(taken.corners[b]), b);
        return Vec3d(origin + kStep * (Vec3d(taken.corners[b][0], taken.corners[b][1], double(layer) * kFieldBrickSide) + taken.places[p].cast<double>()));
    };
    EXPECT_LT((place(0) - Vec3d(1.02, 1.02, 1.02)).norm(), 1e-6);
    EXPECT_LT((place(1) - Vec3d(1.07, 1.01, 1.02)).norm(), 1e-6);
    EXPECT_EQ(taken.colors[0], (std::array<uint16_t, 3>{20, 0, 255}));  // 61 / 3
    EXPECT_EQ(taken.colors[1], (std::array<uint16_t, 3>{1, 2, 3}));
    EXPECT_LT((taken.normals[0] - Vec3f(1, 1, 0).normalized()).norm(), 1e-6f);
    EXPECT_EQ(taken.normals[1], Vec3f(0, 0, -1));
    EXPECT_EQ(taken.normals[2], Vec3f(0, 0, 0)) << "they cancel";
    EXPECT_EQ(taken.scalars[0], 2.5f);
    EXPECT_EQ(taken.scalars[1], 5.0f);
    EXPECT_TRUE(std::isnan(taken.scalars[2]));
    EXPECT_EQ(taken.scalars[3], 9.0f);
    EXPECT_EQ(taken.scalars[5], 2.0f) << "the least of equally frequent ones";
}

// Records that go to the scratch store come back as those that stay in memory do, and in the same order whoever read them; added to others they are the same.
TEST(PointLayers, SpilledPointsAreTheSame) {
    const ScannedPoints points(random_points(30'000, 3));
    const PointGrid grid = PointGrid::around(points.info().bounds, kStep, 2.0);
    test::StoreInMemory store;
    ScratchBlocks none(nullptr), some(&store);
    PointLayers kept(grid, whole_form(), 1 << 20, none), spilled(grid, whole_form(), 1000, some), again(grid, whole_form(), 1000, none);
    kept.distribute(points, 1, {});
    spilled.distribute(points, 4, {});
    EXPECT_GT(store.written(), 1'000'000u);
    const auto expect_equal = [](const PointLayer& a, const PointLayer& b) {
        EXPECT_EQ(a.corners, b.corners);
        EXPECT_EQ(a.begins, b.begins);
        EXPECT_EQ(a.places, b.places);
        EXPECT_EQ(a.normals, b.normals);
        EXPECT_EQ(a.colors, b.colors);
        EXPECT_EQ(a.scalars, b.scalars);
    };
    for (size_t layer = 0; layer < kept.size(); ++layer) {
        const PointLayer a = kept.take(layer, true, 1 << 24), b = spilled.take(layer, true, 1 << 24);
        expect_equal(a, b);
        again.add(layer, a);
        expect_equal(a, again.take(layer, false, 1 << 24));
    }
}

// What is taken is counted before: records twice, 16 bytes an entry of their order, 12 a place.
TEST(PointLayers, TakesNoMoreThanAllowed) {
    const ScannedPoints points(std::vector<ScannedPoint>(100, {.place = {1.0, 1.0, 1.0}}));
    for (const bool places : {false, true}) {
        const uint64_t needed = 100 * (2 * PointForm().record_bytes() + 16 + (places ? 12 : 0));
        ScratchBlocks scratch(nullptr);
        PointLayers layers(PointGrid::around(points.info().bounds, kStep, 2.0), {}, 1 << 20, scratch);
        layers.distribute(points, 1, {});
        size_t layer = 0;
        while (layers.points(layer) == 0) ++layer;
        std::vector<std::array<int32_t, 3>> all;
        EXPECT_THROW(layers.take(layer, false, needed - 1, places ? &all : nullptr), Error);
        EXPECT_EQ(layers.take(layer, false, needed, places ? &all : nullptr).points(), 100u);
        EXPECT_EQ(all.size(), places ? 100u : 0u);
    }
    ScratchBlocks scratch(nullptr);
    PointLayers layers(PointGrid::around(points.info().bounds, kStep, 2.0), {}, 1 << 20, scratch);
    layers.distribute(points, 1, {});
    size_t layer = 0;
    while (layers.points(layer) == 0) ++layer;
    std::vector<std::array<int32_t, 3>> all;
    EXPECT_THROW(layers.take_places(layer, 1199, all), Error);
    layers.take_places(layer, 1200, all);
    EXPECT_EQ(all.size(), 100u);
}

}  // namespace
}  // namespace strata
