#include "io/copc/copc_hierarchy_writer.h"

#include <gtest/gtest.h>

#include <map>

#include "io/byte_source.h"
#include "io/copc/copc_hierarchy.h"

namespace strata::copc {
namespace {

constexpr uint64_t kOffset = 10'000'000;  // chunks before it

// Every page that can be reached from the root, and how often each node has points.
struct Reached {
    std::map<NodeKey, Entry> nodes;
    size_t pages = 0;
};

void reach(const ByteSource& source, const NodeKey& root, uint64_t offset, uint64_t bytes, Reached& reached) {
    const Page page(source, root, offset, bytes);
    ++reached.pages;
    const auto visit = [&](const auto& self, const NodeKey& key) -> void {
        const Entry* const entry = page.find(key);
        if (entry == nullptr) return;
        if (entry->is_page) return reach(source, key, entry->offset, entry->bytes, reached);
        EXPECT_TRUE(reached.nodes.emplace(key, *entry).second);
        for (int octant = 0; octant < 8; ++octant) self(self, key.child(octant));
    };
    visit(visit, root);
}

Reached read_back(const HierarchyPages& pages) {
    std::vector<std::byte> file(kOffset);
    file.insert(file.end(), pages.bytes.begin(), pages.bytes.end());
    Reached reached;
    reach(*memory_source("set.copc.laz", std::move(file)), NodeKey(), pages.root_offset, pages.root_bytes, reached);
    return reached;
}

void add_tree(const NodeKey& key, uint32_t depth, std::vector<BuiltNode>& nodes) {
    nodes.push_back({key, uint32_t(nodes.size() + 1), 100 + 16 * nodes.size(), 16});
    if (key.level == depth) return;
    for (const int octant : {1, 4, 7}) add_tree(key.child(octant), depth, nodes);
}

TEST(CopcHierarchyWriter, EveryNodeIsOnOnePage) {
    std::vector<BuiltNode> nodes;
    add_tree(NodeKey(), 9, nodes);  // 3^0 + ... + 3^9 nodes
    ASSERT_EQ(nodes.size(), 29524u);
    const HierarchyPages pages = write_hierarchy(nodes, kOffset);
    EXPECT_EQ(pages.root_bytes, 32u * (1 + 3 + 9 + 27 + 81));  // four levels, and the names of 81 pages
    const Reached reached = read_back(pages);
    EXPECT_EQ(reached.pages, 1u + 81);  // those at level 8 would have 4 nodes
    ASSERT_EQ(reached.nodes.size(), nodes.size());
    for (const BuiltNode& node : nodes) {
        const Entry& entry = reached.nodes.at(node.key);
        EXPECT_EQ(entry.points, node.points);
        EXPECT_EQ(entry.offset, node.byte_offset);
        EXPECT_EQ(entry.bytes, node.byte_size);
    }
}

// A node without points stays where some below it have them, and says neither place nor size.
TEST(CopcHierarchyWriter, BranchesWithoutPointsAreLeftOut) {
    const NodeKey root, kept = root.child(3), leaf = kept.child(5), empty = root.child(6);
    const Reached reached = read_back(write_hierarchy({{leaf, 7, 500, 20}, {empty.child(1), 0, 520, 0}, {empty, 0, 520, 0}, {kept, 0, 520, 0}, {root, 9, 470, 30}}, kOffset));
    ASSERT_EQ(reached.nodes.size(), 3u);
    EXPECT_EQ(reached.nodes.at(kept).points, 0u);
    EXPECT_EQ(reached.nodes.at(kept).offset, 0u);
    EXPECT_EQ(reached.nodes.at(leaf).points, 7u);
}

TEST(CopcHierarchyWriter, ACloudWithoutPointsHasARoot) {
    const Reached reached = read_back(write_hierarchy({}, kOffset));
    ASSERT_EQ(reached.nodes.size(), 1u);
    EXPECT_EQ(reached.nodes.at(NodeKey()).points, 0u);
}

}  // namespace
}  // namespace strata::copc
