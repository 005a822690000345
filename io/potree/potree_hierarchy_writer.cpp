#include "io/potree/potree_hierarchy_writer.h"

#include <algorithm>
#include <cstring>
#include <deque>

namespace strata {
namespace {

constexpr size_t kRecordBytes = 22;
enum RecordType : uint8_t { kInner = 0, kLeaf = 1, kProxy = 2 };

struct TreeNode {
    BuiltNode node;
    int32_t children[8] = {-1, -1, -1, -1, -1, -1, -1, -1};
    bool present = true;

    uint8_t child_mask() const {
        unsigned mask = 0;
        for (int octant = 0; octant < 8; ++octant)
            if (children[octant] >= 0) mask |= 1u << octant;
        return uint8_t(mask);
    }
};

// Level by level, octant by octant within a level; empty branches pruned.
std::vector<TreeNode> make_tree(std::vector<BuiltNode>& nodes) {
    std::sort(nodes.begin(), nodes.end(), [](const BuiltNode& a, const BuiltNode& b) {
        return a.key.level != b.key.level ? a.key.level < b.key.level : octant_order(a.key, b.key);
    });
    std::vector<TreeNode> tree;
    tree.reserve(nodes.size());
    for (const BuiltNode& node : nodes) tree.push_back({node});
    // Children of a level come in the order of their parents, so one pass from below links and prunes.
    size_t parent = tree.size();
    for (size_t i = tree.size(); i-- > 1;) {
        TreeNode& child = tree[i];
        child.present = child.node.points > 0 || child.child_mask() != 0;
        if (!child.present) continue;
        const NodeKey key = child.node.key.parent();
        parent = std::min(parent, i);
        while (tree[parent].node.key != key) --parent;
        tree[parent].children[child.node.key.octant()] = int32_t(i);
    }
    return tree;
}

template <typename T>
void put(std::vector<std::byte>& out, T value) {
    const size_t at = out.size();
    out.resize(at + sizeof value);
    std::memcpy(out.data() + at, &value, sizeof value);
}

void put_record(std::vector<std::byte>& out, RecordType type, const TreeNode& node, uint64_t offset, uint64_t size) {
    put(out, uint8_t(type));
    put(out, node.child_mask());
    put(out, node.node.points);
    put(out, offset);
    put(out, size);
}

// The nodes of a chunk: its root and the levels below it, breadth first.
std::vector<int32_t> nodes_of_chunk(const std::vector<TreeNode>& tree, int32_t root) {
    const uint32_t last_level = tree[size_t(root)].node.key.level + kHierarchyStep;
    std::vector<int32_t> found = {root};
    for (size_t i = 0; i < found.size(); ++i) {
        const TreeNode& node = tree[size_t(found[i])];
        if (node.node.key.level == last_level) continue;
        for (const int32_t child : node.children)
            if (child >= 0) found.push_back(child);
    }
    return found;
}

}  // namespace

PotreeHierarchyFile write_potree_hierarchy(std::vector<BuiltNode> nodes) {
    const std::vector<TreeNode> tree = make_tree(nodes);
    struct Chunk {
        std::vector<int32_t> nodes;
        uint64_t offset = 0;
    };
    // A node at the last level of a chunk that has children is a proxy there and the root of a chunk of its own.
    std::deque<Chunk> chunks;
    std::vector<int32_t> chunk_of_root(tree.size(), -1);
    const auto is_proxy = [&](const Chunk& chunk, int32_t node) {
        return tree[size_t(node)].node.key.level == tree[size_t(chunk.nodes[0])].node.key.level + kHierarchyStep &&
               tree[size_t(node)].child_mask() != 0;
    };
    chunks.push_back({nodes_of_chunk(tree, 0)});
    uint64_t end = 0;
    for (size_t c = 0; c < chunks.size(); ++c) {
        chunks[c].offset = end;
        end += chunks[c].nodes.size() * kRecordBytes;
        for (const int32_t node : std::vector<int32_t>(chunks[c].nodes)) {
            if (!is_proxy(chunks[c], node)) continue;
            chunk_of_root[size_t(node)] = int32_t(chunks.size());
            chunks.push_back({nodes_of_chunk(tree, node)});
        }
    }
    PotreeHierarchyFile file;
    file.first_chunk_bytes = chunks.front().nodes.size() * kRecordBytes;
    for (const TreeNode& node : tree)
        if (node.present) file.depth = std::max(file.depth, node.node.key.level);
    file.bytes.reserve(end);
    for (const Chunk& chunk : chunks)
        for (const int32_t index : chunk.nodes) {
            const TreeNode& node = tree[size_t(index)];
            if (is_proxy(chunk, index)) {
                const Chunk& below = chunks[size_t(chunk_of_root[size_t(index)])];
                put_record(file.bytes, kProxy, node, below.offset, below.nodes.size() * kRecordBytes);
            } else {
                put_record(file.bytes, node.child_mask() != 0 ? kInner : kLeaf, node, node.node.points > 0 ? node.node.byte_offset : 0,
                           node.node.byte_size);
            }
        }
    return file;
}

}  // namespace strata
