#include "render/stream/local_shape.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "core/math/random.h"

namespace strata {
namespace {

const Vec3d kMillimeter = Vec3d::Constant(0.001);
constexpr SpacingLimits kNoLimits = {.least = 0.0f, .most = 1000.0f, .alone = 1000.0f};

ResidentNode node_of(size_t n, const std::function<Vec3d(size_t)>& position, const Vec3i& offset = Vec3i::Zero()) {
    ResidentNode node;
    node.min_quanta = Vec3i::Constant(INT32_MAX);
    node.max_quanta = Vec3i::Constant(INT32_MIN);
    for (size_t i = 0; i < n; ++i) {
        const Vec3i q = (1000.0 * position(i)).array().round().matrix().cast<int>() + offset;
        node.x.push_back(q.x());
        node.y.push_back(q.y());
        node.z.push_back(q.z());
        node.min_quanta = node.min_quanta.cwiseMin(q);
        node.max_quanta = node.max_quanta.cwiseMax(q);
    }
    return node;
}

const PointShape& shape_of(const ShapeGrid& grid, const ResidentNode& node, size_t i) { return grid.at(node.x[i], node.y[i], node.z[i]); }

// Points at random, 4000 on 8 x 8: one on 0.016 square units, and splats reach half as far again as their cells are wide.
TEST(LocalShape, ATiltedPlaneGivesItsSpacingAndItsNormal) {
    Random random(1);
    const Vec3d normal = Vec3d(0.3, -0.5, 1.0).normalized();
    const ResidentNode node = node_of(4000, [&](size_t) {
        const double x = random.uniform(0, 8), y = random.uniform(0, 8);
        return Vec3d(x, y, -0.3 * x + 0.5 * y + 0.005 * random.normal());
    });
    const double spacing = 1.5 * std::sqrt(8 * 8 / normal.z() / 4000);
    const ShapeGrid grid = measure_local_shape(node, {}, kMillimeter, kNoLimits);
    for (size_t i = 0; i < node.size(); ++i) {
        const PointShape& shape = shape_of(grid, node, i);
        ASSERT_GT(shape.spacing, 0.6 * spacing) << i;
        ASSERT_LT(shape.spacing, 2.0 * spacing) << i;
        ASSERT_TRUE(shape.flat());
        const double cosine = std::abs(normal.dot(Vec3d(shape.normal[0], shape.normal[1], shape.normal[2]).normalized()));
        ASSERT_GT(cosine, std::cos(3.0 * std::numbers::pi / 180)) << i;  // a byte is 0.5 degrees off; noise 0.15 over a cell, more over the slivers at edges
    }
}

// Twenty times as dense along the lines as across: what is covered by splats of that radius is the plane, not the lines.
TEST(LocalShape, GapsBetweenScanLinesCount) {
    for (const double gap : {0.15, 0.3, 0.45}) {
        Random random(2);
        const size_t lines = size_t(8 / gap);
        const ResidentNode node = node_of(9000, [&](size_t i) { return Vec3d(random.uniform(0, 8), gap * double(i % lines), 0.0); });
        const ShapeGrid grid = measure_local_shape(node, {}, kMillimeter, kNoLimits);
        for (size_t i = 0; i < node.size(); ++i) {
            ASSERT_GT(shape_of(grid, node, i).spacing, 0.5 * gap) << gap;
            ASSERT_LT(shape_of(grid, node, i).spacing, 3.0 * gap) << gap;
        }
    }
}

TEST(LocalShape, AWireStaysThinAndHasNoPlane) {
    Random random(3);
    const ResidentNode node = node_of(400, [&](size_t) {
        const double x = random.uniform(0, 8);
        return Vec3d(x, 0.4 * x, 0.02 * (x - 4) * (x - 4) + 0.002 * random.normal());
    });
    const ShapeGrid grid = measure_local_shape(node, {}, kMillimeter, kNoLimits);
    for (size_t i = 0; i < node.size(); ++i) {
        ASSERT_LT(shape_of(grid, node, i).spacing, 6 * 8.0 / 400) << i;
        ASSERT_FALSE(shape_of(grid, node, i).flat()) << i;
    }
}

// Sixteen times as dense on the left: spacing a quarter, away from the border, which two cells blur.
TEST(LocalShape, DensityIsLocal) {
    Random random(4);
    const ResidentNode node = node_of(17000, [&](size_t i) {
        return Vec3d(i % 17 == 0 ? random.uniform(4, 8) : random.uniform(0, 4), random.uniform(0, 8), 0.0);
    });
    const ShapeGrid grid = measure_local_shape(node, {}, kMillimeter, kNoLimits);
    for (size_t i = 0; i < node.size(); ++i) {
        const double x = 0.001 * node.x[i], expected = 1.5 * std::sqrt(8 * 4 / (x < 4 ? 16000.0 : 1000.0));
        if (std::abs(x - 4) < 2.1) continue;
        ASSERT_NEAR(shape_of(grid, node, i).spacing / expected, 1.0, 0.5) << x;
    }
}

TEST(LocalShape, PointsOfAncestorsFillTheGaps) {
    Random random(5);
    const auto anywhere = [&](size_t) { return Vec3d(random.uniform(0, 8), random.uniform(0, 8), 0.0); };
    const ResidentNode few = node_of(500, anywhere), many = node_of(7500, anywhere);
    const std::vector<const ResidentNode*> above = {&many};
    const ShapeGrid alone = measure_local_shape(few, {}, kMillimeter, kNoLimits), together = measure_local_shape(few, above, kMillimeter, kNoLimits);
    double ratio = 0;
    for (size_t i = 0; i < few.size(); ++i) ratio += shape_of(alone, few, i).spacing / shape_of(together, few, i).spacing / 500;
    EXPECT_NEAR(ratio, 4.0, 0.6);  // sixteen times as many
}

TEST(LocalShape, BushesHaveNoPlane) {
    Random random(6);
    const ResidentNode node = node_of(3000, [&](size_t) { return Vec3d(random.uniform(0, 4), random.uniform(0, 4), random.uniform(0, 4)); });
    const ShapeGrid grid = measure_local_shape(node, {}, kMillimeter, kNoLimits);
    size_t flat = 0;
    for (size_t i = 0; i < node.size(); ++i) flat += shape_of(grid, node, i).flat();
    EXPECT_LT(flat, 30u);  // a cell of eight points may be flat by chance
}

TEST(LocalShape, LimitsHold) {
    Random random(7);
    const ResidentNode node = node_of(4000, [&](size_t) { return Vec3d(random.uniform(0, 8), random.uniform(0, 8), 0.0); });
    for (const SpacingLimits limits : {SpacingLimits{0.5f, 1.0f, 1.0f}, SpacingLimits{0.0f, 0.05f, 0.05f}}) {
        const ShapeGrid grid = measure_local_shape(node, {}, kMillimeter, limits);
        for (size_t i = 0; i < node.size(); ++i) ASSERT_EQ(shape_of(grid, node, i).spacing, limits.least > 0 ? limits.least : limits.most);
    }
}

TEST(LocalShape, CoincidentPointsHaveNone) {
    EXPECT_TRUE(measure_local_shape(node_of(0, nullptr), {}, kMillimeter, kNoLimits).cells.empty());
    EXPECT_TRUE(measure_local_shape(node_of(1, [](size_t) { return Vec3d(1, 2, 3); }), {}, kMillimeter, kNoLimits).cells.empty());
    EXPECT_TRUE(measure_local_shape(node_of(1000, [](size_t) { return Vec3d(1, 2, 3); }), {}, kMillimeter, kNoLimits).cells.empty());
}

// The same points at both ends of what quanta reach.
TEST(LocalShape, PlaceDoesNotShow) {
    const auto place = [](const Vec3i& offset) {
        Random random(8);
        return node_of(2000, [&](size_t) { return Vec3d(random.uniform(0, 8), random.uniform(0, 8), random.uniform(0, 0.2)); }, offset);
    };
    const ResidentNode here = place(Vec3i::Zero());
    const ShapeGrid expected = measure_local_shape(here, {}, kMillimeter, kNoLimits);
    for (const int32_t offset : {INT32_MIN, INT32_MAX - 10000}) {
        const ResidentNode there = place(Vec3i::Constant(offset));
        const ShapeGrid grid = measure_local_shape(there, {}, kMillimeter, kNoLimits);
        for (size_t i = 0; i < here.size(); ++i) ASSERT_EQ(shape_of(grid, there, i), shape_of(expected, here, i));
    }
}

}  // namespace
}  // namespace strata
