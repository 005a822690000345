#include "render/stream/point_cut.h"

#include <gtest/gtest.h>

#include "tests/support/point_frame.h"

namespace strata {
namespace {

// Every column of what is left is that of the point it is said to be.
TEST(PointCut, PointsKeepAllThatTheyHave) {
    ResidentNode node = test::random_nodes()[0];
    const Quantization& quantization = test::kMillimeters;
    const std::vector<ClipBox> boxes = {{.box = {.min = quantization.offset + Vec3d(-1, 2, -1), .max = quantization.offset + Vec3d(1, 4, 2)}}};
    for (const bool filtered : {false, true}) {
        if (filtered)
            for (size_t i = 0; i < node.size(); ++i) node.passes.push_back(i % 2);
        const CutNode cut = cut_node(node, ClipRegion(boxes, quantization));
        ASSERT_GT(cut.indices.size(), 100u);
        ASSERT_LT(cut.indices.size(), node.size() / 2);
        ASSERT_EQ(cut.points.normals.size(), cut.indices.size());
        for (size_t i = 0; i < cut.indices.size(); ++i) {
            const uint32_t index = cut.indices[i];
            EXPECT_EQ(cut.points.x[i], node.x[index]);
            EXPECT_EQ(cut.points.colors[i], node.colors[index]);
            EXPECT_EQ(cut.points.shapes[i], node.shapes[index]);
            EXPECT_EQ(cut.points.normals[i], node.normals[index]);
            EXPECT_TRUE(!filtered || index % 2 == 1);
        }
    }
}

}  // namespace
}  // namespace strata
