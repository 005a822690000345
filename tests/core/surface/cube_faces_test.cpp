#include "core/surface/cube_faces.h"

#include <gtest/gtest.h>

#include "core/math/random.h"
#include "tests/support/cube_bricks.h"

namespace strata {
namespace {

constexpr int kSide = kCubeBrickSide;
constexpr std::array<std::array<int, 3>, 6> kSteps = {{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

/// Of each direction and cell of the brick the material of its face, 0: none.
using UnitFaces = std::vector<uint8_t>;

size_t face_index(int direction, int x, int y, int z) { return size_t(((direction * kSide + x) * kSide + y) * kSide + z); }

// The rule, word for word.
UnitFaces faces_by_rule(const DenseBrick& dense) {
    UnitFaces faces(size_t(6) * kSide * kSide * kSide);
    for (int direction = 0; direction < 6; ++direction)
        for (int x = 0; x < kSide; ++x)
            for (int y = 0; y < kSide; ++y)
                for (int z = 0; z < kSide; ++z) {
                    const auto& step = kSteps[size_t(direction)];
                    const uint8_t own = dense.at(x, y, z), neighbor = dense.at(x + step[0], y + step[1], z + step[2]);
                    const bool seen = neighbor == 0 || (neighbor >= dense.first_transparent && neighbor != own);
                    if (own != 0 && seen) faces[face_index(direction, x, y, z)] = own;
                }
    return faces;
}

// Empty if a face is in two rectangles.
UnitFaces faces_of(const CubeRectangles& rectangles, bool one_material) {
    UnitFaces faces(size_t(6) * kSide * kSide * kSide);
    for (int direction = 0; direction < 6; ++direction)
        for (const CubeRectangle& r : rectangles.of(CubeDirection(direction))) {
            std::array<int, 3> size = {1, 1, 1};
            size[direction < 4 ? 2 : 1] = int(r.width());
            size[direction < 2 ? 1 : 0] = int(r.height());
            for (int x = int(r.x()); x < int(r.x()) + size[0]; ++x)
                for (int y = int(r.y()); y < int(r.y()) + size[1]; ++y)
                    for (int z = int(r.z()); z < int(r.z()) + size[2]; ++z) {
                        if (x >= kSide || y >= kSide || z >= kSide) return {};
                        uint8_t& face = faces[face_index(direction, x, y, z)];
                        if (face != 0) return {};
                        face = one_material ? 1 : uint8_t(r.material);
                    }
        }
    return faces;
}

size_t count(const UnitFaces& faces) {
    return size_t(std::count_if(faces.begin(), faces.end(), [](uint8_t face) { return face != 0; }));
}

TEST(CubeFaces, TheIntegerBallHasItsKnownNumbers) {
    const DenseBrick dense = brick_where([](int x, int y, int z) { return uint8_t(in_integer_ball(x - 16, y - 16, z - 16, 16)); });
    EXPECT_EQ(std::count(dense.materials.begin(), dense.materials.end(), 1), 17074);
    CubeRectangles rectangles;
    CubeFaceFinder().find(*dense.brick(), rectangles);
    EXPECT_EQ(count(faces_of(rectangles, true)), 4770u);
    EXPECT_EQ(faces_of(rectangles, true), faces_by_rule(dense));
    EXPECT_LE(rectangles.size(), 2100u);
    EXPECT_GE(rectangles.size(), 2094u);  // no fewer can do
}

struct RandomSolid {
    double share;
    int materials, transparent;  // the last ones of them
    int grain;                   // cells of a cube of one material
};

class RandomSolids : public testing::TestWithParam<RandomSolid> {};

// A judge that knows no bits: the rule above, face by face.
TEST_P(RandomSolids, RectanglesAreTheFacesThatCanBeSeen) {
    const RandomSolid solid = GetParam();
    for (uint64_t seed = 1; seed <= 4; ++seed) {
        Random random(seed);
        DenseBrick dense = brick_where([&](int, int, int) {
            return random.uniform() < solid.share ? uint8_t(1 + std::min(solid.materials - 1, int(random.uniform() * solid.materials)))
                                                  : uint8_t(0);
        });
        if (solid.grain > 1) {
            const DenseBrick fine = dense;
            dense = brick_where([&](int x, int y, int z) {
                const auto snap = [&](int c) { return (c + 1) / solid.grain * solid.grain - 1; };
                return fine.at(snap(x), snap(y), snap(z));
            });
        }
        dense.first_transparent = uint8_t(1 + solid.materials - solid.transparent);
        const UnitFaces truth = faces_by_rule(dense);
        const std::unique_ptr<CubeBrick> brick = dense.brick();
        CubeRectangles first;
        for (const SimdLevel level : simd_levels()) {
            CubeFaceFinder finder(level);
            CubeRectangles rectangles;
            for (int again = 0; again < 2; ++again) finder.find(*brick, rectangles);  // nothing is left of the brick before
            ASSERT_EQ(faces_of(rectangles, brick->one_material), truth) << name_of(level) << ", seed " << seed;
            EXPECT_LE(rectangles.size(), count(truth));
            if (level == SimdLevel::baseline) first = rectangles;
            EXPECT_TRUE(std::equal(first.all.begin(), first.all.begin() + ptrdiff_t(first.size()), rectangles.all.begin()));
        }
        if (solid.materials == 1) {  // materials that are all the same make no difference
            brick->one_material = false;
            CubeRectangles rectangles;
            CubeFaceFinder().find(*brick, rectangles);
            EXPECT_EQ(faces_of(rectangles, false), truth);
            EXPECT_EQ(rectangles.size(), first.size());
        }
    }
}

INSTANTIATE_TEST_SUITE_P(CubeFaces, RandomSolids,
                         testing::Values(RandomSolid{0.0, 1, 0, 1}, RandomSolid{0.01, 1, 0, 1}, RandomSolid{0.3, 1, 0, 1},
                                         RandomSolid{0.5, 3, 0, 1}, RandomSolid{0.9, 1, 0, 1}, RandomSolid{0.97, 2, 0, 3},
                                         RandomSolid{1.0, 1, 0, 1}, RandomSolid{1.0, 2, 0, 7}, RandomSolid{0.5, 4, 2, 1},
                                         RandomSolid{0.8, 5, 3, 5}, RandomSolid{0.5, 1, 1, 1}, RandomSolid{1.0, 3, 3, 9}));

// A stone, beside it glass, then water, then water: faces across the borders, as the rule says.
TEST(CubeFaces, GlassAndWaterShowWhatLiesBehindThem) {
    constexpr uint8_t kStone = 1, kGlass = 2, kWater = 3;
    constexpr std::array<uint8_t, 4> kRow = {kStone, kGlass, kWater, kWater};
    for (int axis = 0; axis < 3; ++axis) {
        DenseBrick dense = brick_where([&](int x, int y, int z) {
            const std::array<int, 3> at = {x, y, z};
            const int along = at[size_t(axis)] - 61;  // the last cell is beyond the brick
            return at[size_t((axis + 1) % 3)] == 5 && at[size_t((axis + 2) % 3)] == 6 && along >= 0 && along < 4 ? kRow[size_t(along)]
                                                                                                                 : uint8_t(0);
        });
        dense.first_transparent = kGlass;
        CubeRectangles rectangles;
        CubeFaceFinder().find(*dense.brick(), rectangles);
        const auto materials = [&](int sign) {
            std::vector<int> found;
            for (const CubeRectangle& r : rectangles.of(CubeDirection(2 * axis + sign))) found.push_back(int(r.material));
            std::sort(found.begin(), found.end());
            return found;
        };
        // Forwards: stone to glass, glass to water; water to water none, and that of the cell beyond is the neighbor's to show.
        EXPECT_EQ(materials(0), (std::vector<int>{kStone, kGlass})) << axis;
        // Backwards: stone to nothing, water to glass; glass to stone none.
        EXPECT_EQ(materials(1), (std::vector<int>{kStone, kWater})) << axis;
    }
}

}  // namespace
}  // namespace strata
