#include "core/voxel/voxel_dag.h"

#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <string>

#include "core/error.h"
#include "core/math/random.h"
#include "core/voxel/ray_cast.h"
#include "tests/support/voxel_cube.h"

namespace strata {
namespace {

std::vector<VoxelCube> models() {
    return {random_cube(1, 0.2, 1),
            random_cube(3, 0.001, 2),
            random_cube(2, 0.5, 3),
            random_boxes(3, 10, 4),
            cube_where(3, [](uint32_t x, uint32_t y, uint32_t z) { return x % 16 == 3 && y % 8 < 5 && z % 4 != 0; }),
            cube_where(3, [](uint32_t, uint32_t, uint32_t) { return true; }),
            cube_where(4, [](uint32_t x, uint32_t y, uint32_t z) { return (x & y) == 0 && (y & z) == 0 && (x & z) == 0; })};
}

uint64_t count_nodes(const VoxelTree& tree) {
    uint64_t nodes = 0;
    for (const VoxelLevel& level : tree.levels) nodes += level.masks.size();
    return nodes;
}

std::string message_of(const VoxelDag& dag) {
    VoxelDag copy = dag;
    try {
        index_dag(copy);
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::malformed);
        return error.what();
    }
    return "";
}

TEST(PackedNumbers, ReadsWhatWasPacked) {
    Random random(1);
    for (int width = 0; width <= 32; ++width)
        for (const size_t count : {0, 1, 2, 7, 8, 9, 1000}) {
            std::vector<uint32_t> numbers(count);
            for (uint32_t& number : numbers) number = uint32_t(random.bits() & ((uint64_t{1} << width) - 1));
            if (count > 0 && width > 0) numbers[count / 2] |= uint32_t{1} << (width - 1);
            const PackedNumbers packed = pack_numbers(numbers);
            EXPECT_EQ(packed.width, count > 0 ? width : 0);
            EXPECT_EQ(packed.bytes.size(), PackedNumbers::size_bytes(count, packed.width));
            for (size_t i = 0; i < count; ++i) ASSERT_EQ(packed[i], numbers[i]) << width << " bits, " << i;
        }
}

TEST(VoxelDag, SharesEqualSubtrees) {
    // Two kinds of 4^3 blocks among four: a b / b a along x.
    VoxelCube cube(2);
    for (const uint32_t block : {0u, 3u}) cube.set(4 * block, 1, 2);
    for (const uint32_t block : {1u, 2u}) cube.set(4 * block + 3, 2, 2);
    const VoxelDag dag = dag_of(tree_of(cube));
    ASSERT_EQ(dag.levels.size(), 2u);
    ASSERT_EQ(dag.levels[0].masks.size(), 1u);
    EXPECT_EQ(dag.levels[1].masks, (std::vector<uint64_t>{uint64_t{1} << mask_bit(0, 1, 2), uint64_t{1} << mask_bit(3, 2, 2)}));
    EXPECT_EQ(dag.levels[0].pointers.width, 1);
    std::vector<uint32_t> pointers;
    for (uint32_t i = 0; i < 4; ++i) pointers.push_back(dag.levels[0].pointers[i]);
    EXPECT_EQ(pointers, (std::vector<uint32_t>{0, 1, 1, 0}));
    const std::vector<DagLevelCounts> counts = count_dag(dag);
    EXPECT_EQ(counts[1].nodes, 2u);
    EXPECT_EQ(counts[1].tree_nodes, 4u);
    EXPECT_EQ(counts[0].tree_nodes, 1u);
    EXPECT_EQ(count_voxels(dag), 4u);
}

TEST(VoxelDag, ExpandsToTheTreeItWasMadeOf) {
    for (const VoxelCube& cube : models())
        for (const bool with_full : {false, true}) {
            const VoxelTree tree = tree_of(cube, with_full);
            const VoxelDag dag = dag_of(tree);
            EXPECT_EQ(count_voxels(dag), cube.count());
            uint64_t tree_nodes = 0, nodes = 0;
            for (const DagLevelCounts& counts : count_dag(dag)) {
                tree_nodes += counts.tree_nodes;
                nodes += counts.nodes;
            }
            EXPECT_EQ(tree_nodes, count_nodes(tree));
            EXPECT_LE(nodes, tree_nodes);
            const VoxelTree back = expand(dag, tree_nodes);
            EXPECT_EQ(back.frame, tree.frame);
            ASSERT_EQ(back.levels.size(), tree.levels.size());
            for (size_t l = 0; l < tree.levels.size(); ++l) {
                EXPECT_EQ(back.levels[l].masks, tree.levels[l].masks);
                for (size_t node = 0; node < tree.levels[l].masks.size(); ++node)
                    ASSERT_EQ(back.levels[l].full_mask(node), tree.levels[l].full_mask(node));
            }
            EXPECT_THROW(expand(dag, tree_nodes - 1), Error);
        }
}

TEST(VoxelDag, HoldsEachNodeOnceInOrderOfOccurrence) {
    for (const VoxelCube& cube : models()) {
        const VoxelDag dag = dag_of(tree_of(cube, true));
        for (size_t l = 0; l < dag.levels.size(); ++l) {
            const DagLevel& level = dag.levels[l];
            std::set<std::vector<uint64_t>> seen;
            uint32_t next = 0;
            for (size_t node = 0; node < level.masks.size(); ++node) {
                std::vector<uint64_t> content = {level.masks[node], level.full_mask(node)};
                for (int bit = 0; bit < 64; ++bit)
                    if (l + 1 < dag.levels.size() && ((level.masks[node] & ~level.full_mask(node)) >> bit & 1)) {
                        const uint32_t child = level.child(node, bit);
                        ASSERT_LE(child, next);
                        next = std::max(next, child + 1);
                        content.push_back(child);
                    }
                EXPECT_TRUE(seen.insert(content).second);
            }
            if (l + 1 < dag.levels.size()) EXPECT_EQ(next, dag.levels[l + 1].masks.size());
        }
    }
}

TEST(VoxelDag, RaysFindWhatTheyFindInTheTree) {
    Random random(5);
    size_t hit_count = 0;
    for (const VoxelCube& cube : models())
        for (const bool with_full : {false, true}) {
            const VoxelTree tree = tree_of(cube, with_full);
            const VoxelDag dag = dag_of(tree);
            const double side = cube.side();
            for (int i = 0; i < 300; ++i) {
                const auto place = [&](double low, double high) {
                    return Vec3d(random.uniform(low, high), random.uniform(low, high), random.uniform(low, high));
                };
                VoxelTile tile{.first = {place(-side, 2 * side), Vec3d::Zero()}, .width = 9, .height = 8};
                tile.first.direction = place(0, side) - tile.first.origin;
                tile.direction_per_x = place(-1, 1);
                tile.direction_per_y = place(-1, 1);
                RayLimits limits{.depth = i % 4 ? 20 : 1 + i % 6};
                if (i % 3 == 0) limits.spread = 2;
                std::vector<VoxelHit> hits(72), expected(72);
                cast_tile(tree, tile, limits, expected);
                cast_tile(dag, tile, limits, hits);
                for (int k = 0; k < 72; ++k) {
                    const VoxelHit& hit = hits[size_t(k)];
                    const VoxelHit& other = expected[size_t(k)];
                    ASSERT_EQ(hit.depth, other.depth);
                    ASSERT_EQ(hit.cell, other.cell);
                    ASSERT_EQ(hit.t, other.t);
                    ASSERT_EQ(hit.face, other.face);
                    const VoxelRay ray = tile.ray(k % 9, k / 9);
                    ASSERT_EQ(is_occluded(dag, ray, limits), hit.depth > 0);
                    ASSERT_EQ(cast_ray(dag, ray, limits).value_or(VoxelHit{}), hit);
                    hit_count += hit.depth > 0;
                }
            }
        }
    EXPECT_GT(hit_count, 10'000u);
}

// A million voxels an axis, all occupied but one corner of each 4^3 block, in one node a level.
VoxelDag huge_dag() {
    VoxelDag dag;
    dag.frame.levels = kMostVoxelLevels;
    dag.levels.resize(kMostVoxelLevels);
    for (int l = 0; l < kMostVoxelLevels; ++l) {
        DagLevel& level = dag.levels[size_t(l)];
        level.masks = {kFullMask << 1};
        if (l + 1 < kMostVoxelLevels) level.pointers = pack_numbers(std::vector<uint32_t>(63, 0));
    }
    return dag;
}

TEST(VoxelDag, MayStandForMoreThanFitsAnywhere) {
    VoxelDag dag = huge_dag();
    index_dag(dag);
    uint64_t voxels = 1;
    for (int l = 0; l < kMostVoxelLevels; ++l) voxels *= 63;  // below 2^60
    EXPECT_EQ(count_voxels(dag), voxels);
    EXPECT_EQ(count_dag(dag).back().tree_nodes, voxels / 63);
    try {
        expand(dag, 1'000'000);
        ADD_FAILURE() << "expanded";
    } catch (const Error& error) {
        EXPECT_EQ(error.kind, ErrorKind::limit);
    }
    // The first digit of y and z is 1, the others are 0 and so are corners where that of x is 0: 0111111111 to the base 4 comes first.
    const auto hit = cast_ray(dag, {{-10.0, 262144.5, 262144.5}, {1, 0, 0}});
    ASSERT_TRUE(hit);
    EXPECT_EQ(hit->cell, (std::array<uint32_t, 3>{87381, 262144, 262144}));
    EXPECT_EQ(hit->t, 87391.0);
}

TEST(VoxelDag, RefusesWhatIsNone) {
    VoxelDag good = dag_of(tree_of(random_cube(3, 0.01, 6), true));
    good.levels[1].full.assign(good.levels[1].masks.size(), 0);
    EXPECT_EQ(message_of(good), "");
    const auto refused = [&](const std::string& expected, const std::function<void(VoxelDag&)>& change) {
        VoxelDag bad = good;
        change(bad);
        EXPECT_NE(message_of(bad).find(expected), std::string::npos) << message_of(bad);
    };
    refused("level 0: one root expected, found 2", [](VoxelDag& dag) { dag.levels[0].masks.push_back(1); });
    refused("level 1: node 3 is empty", [](VoxelDag& dag) { dag.levels[1].masks[3] = 0; });
    refused("level 1: pointer 0 leads to node 0 of 0", [](VoxelDag& dag) { dag.levels[2].masks.clear(); });
    refused("level 1: node 0 has full cells that are not occupied", [](VoxelDag& dag) { dag.levels[1].full[0] = ~dag.levels[1].masks[0]; });
    refused("masks of full cells expected, found 1", [](VoxelDag& dag) { dag.levels[1].full.resize(1); });
    refused("bytes of pointers expected", [](VoxelDag& dag) { dag.levels[1].pointers.bytes.pop_back(); });
    refused("pointers of 0 to 32 bits expected, not 33", [](VoxelDag& dag) { dag.levels[1].pointers.width = 33; });
    refused("pointers of 0 to 32 bits expected, not -1", [](VoxelDag& dag) { dag.levels[1].pointers.width = -1; });
    refused("level 1: pointer 0 leads to node",
            [](VoxelDag& dag) { dag.levels[1].pointers.bytes.assign(dag.levels[1].pointers.bytes.size(), 255); });
    refused("level 2: the last level has pointers", [](VoxelDag& dag) { dag.levels[2].pointers.bytes.resize(8); });
    refused("at most 2 levels expected, found 3", [](VoxelDag& dag) { dag.frame.levels = 2; });
    refused("1 to 10 levels expected, the frame has 11", [](VoxelDag& dag) { dag.frame.levels = 11; });
    refused("1 to 10 levels expected, the frame has 0", [](VoxelDag& dag) { dag.frame.levels = 0; });
}

TEST(VoxelDag, OfNothingIsNothing) {
    VoxelTree tree;
    VoxelDag dag = dag_of(tree);
    index_dag(dag);
    EXPECT_TRUE(dag.empty());
    EXPECT_EQ(count_voxels(dag), 0u);
    EXPECT_TRUE(expand(dag, 0).empty());
    EXPECT_FALSE(cast_ray(dag, {{0.5, 0.5, 0.5}, {1, 0, 0}}));
}

}  // namespace
}  // namespace strata
