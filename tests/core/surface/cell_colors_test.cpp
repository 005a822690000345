#include "core/surface/cell_colors.h"

#include <gtest/gtest.h>

#include <functional>

#include "core/voxel/voxel_tree_builder.h"

namespace strata {
namespace {

/// Of cells in a frame, those that `color` gives a color other than black.
VoxelTree tree_of(int levels, const std::function<VoxelColor(uint32_t, uint32_t, uint32_t)>& color) {
    const VoxelFrame frame{.origin = {5, 6, 7}, .voxel_size = 0.25, .levels = levels};
    VoxelTreeInMemory memory(frame, {.color = true});
    VoxelTreeBuilder builder(frame, {.color = true}, memory);
    VoxelBatch batch;
    const uint64_t blocks = uint64_t{1} << 3 * (frame.depth() - 2);
    for (uint64_t code = 0; code < blocks; ++code) {
        VoxelBlock block{.code = code};
        const auto [x, y, z] = coordinates_of_code(code);
        for (uint32_t bit = 0; bit < 64; ++bit) {
            const auto [cx, cy, cz] = coordinates_of_code(bit);
            const VoxelColor c = color(4 * x + cx, 4 * y + cy, 4 * z + cz);
            if (c == VoxelColor{}) continue;
            block.mask |= uint64_t{1} << bit;
            batch.colors.push_back(c);
        }
        if (block.mask != 0) batch.blocks.push_back(block);
    }
    builder.add(batch);
    builder.finish();
    return memory.take();
}

// A block of two colors: below the plane between them one, above the other, and in between as the distance says; what is empty has no part in it.
TEST(CellColors, ATreeOfTwoColors) {
    const VoxelColor red = {200, 10, 20}, blue = {20, 30, 220};
    const auto color = [&](uint32_t x, uint32_t y, uint32_t z) { return x < 3 || x > 12 || y < 3 || y > 12 || z < 3 || z > 12 ? VoxelColor{} : x < 8 ? red : blue; };
    const VoxelTree tree = tree_of(2, color);
    for (const int depth : {tree.depth(), tree.depth() - 1}) {
        ASSERT_TRUE(CellColorsAtVertices::has_colors(tree, depth));
        const double cell = 0.25 * (1 << (tree.depth() - depth));
        for (const int threads : {1, 3}) {
            CellColorsAtVertices colors(tree, depth, threads);
            std::vector<Vec3f> places;
            std::vector<std::array<uint8_t, 4>> expected;
            const int side = 16 >> (tree.depth() - depth), middle = side / 2;
            const auto add = [&](double x, double y, double z, std::array<uint8_t, 4> c) {  // cells
                places.push_back((Vec3d(x, y, z) * cell).cast<float>());
                expected.push_back(c);
            };
            const double top = side - 3 * side / 16.0;  // where the block ends
            add(middle - 1.5, middle, top, {200, 10, 20, 255});
            add(middle + 1.5, middle, top, {20, 30, 220, 255});
            add(middle, middle, middle, {110, 20, 120, 255});
            add(middle + 0.25, middle + 0.5, middle + 0.5, {65, 25, 170, 255});  // a quarter of red
            add(0.5, 0.5, 0.5, {128, 128, 128, 255});
            add(-50, 0, 0, {128, 128, 128, 255});
            std::vector<std::array<uint8_t, 4>> found(places.size());
            colors.look_up(tree.frame.origin, places, found);
            EXPECT_EQ(found, expected) << depth;
        }
    }
    EXPECT_FALSE(CellColorsAtVertices::has_colors(tree, tree.depth() + 1));
}

}  // namespace
}  // namespace strata
