#include "core/surface/vertex_values.h"

#include <gtest/gtest.h>

#include "core/surface/grid_at_vertices.h"
#include "core/surface/scalar_ranges.h"
#include "tests/support/field_source.h"
#include "tests/support/surface_in_memory.h"

namespace strata {
namespace {

// A large piece goes on in parts; its faces come with the last.
TEST(SurfaceWithValues, LargePiecesGoOnInParts) {
    const size_t count = (size_t{1} << 17) + 3;
    std::vector<Vec3f> positions;
    for (size_t i = 0; i < count; ++i) positions.emplace_back(float(i % 100), float(i / 100 % 100), 0.5f);
    const std::vector<std::array<uint32_t, 3>> triangles = {{0, 1, uint32_t(count - 1)}};
    test::FunctionSlices source({100, 100, 2}, [](int i, int j, int k) { return i + 1000.0 * j + 0.5 * k; });
    SlicesAtVertices values(source);
    SurfaceInMemory found;
    ScalarRanges ranges(found, {"a"});
    SurfaceWithValues with(ranges);
    with.add_values("a", values);
    with.add({.positions = positions, .triangles = triangles});
    EXPECT_EQ(found.positions.size(), count);
    EXPECT_FALSE(found.refers_ahead);
    ASSERT_EQ(found.scalars.at(0).size(), count);
    EXPECT_EQ(found.triangles.size(), 1u);
    for (size_t i = 0; i < count; ++i) ASSERT_EQ(found.scalars[0][i], positions[i].x() + 1000.0f * positions[i].y() + 0.25f);
    EXPECT_EQ(ranges.ranges()[0].least, 0.25f);
    EXPECT_EQ(ranges.ranges()[0].greatest, 99'099.25f);
    EXPECT_EQ(ranges.ranges()[0].unknown, 0u);
    // An empty piece with faces of earlier vertices is still one.
    with.add({.triangles = triangles});
    EXPECT_EQ(found.triangles.size(), 2u);
}

}  // namespace
}  // namespace strata
