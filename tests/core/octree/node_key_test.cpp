#include "core/octree/node_key.h"

#include <gtest/gtest.h>

namespace strata {
namespace {

TEST(NodeKey, ChildDigitHasXAsHighBit) {
    const NodeKey root;
    EXPECT_EQ(root.child(4), (NodeKey{1, 1, 0, 0}));
    EXPECT_EQ(root.child(2), (NodeKey{1, 0, 1, 0}));
    EXPECT_EQ(root.child(1), (NodeKey{1, 0, 0, 1}));
    EXPECT_EQ(node_name(root.child(4).child(3)), "r43");
    EXPECT_EQ(root.child(4).child(3).octant(), 3);
    EXPECT_EQ(root.child(4).child(3).parent(), root.child(4));
}

}  // namespace
}  // namespace strata
