#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <vector>

#include "core/octree/node_sampling.h"
#include "core/octree/node_sink.h"
#include "core/octree/octree_frame.h"

namespace strata {

/// Most points of a leaf, unless they coincide.
inline constexpr uint64_t kMaxLeafPoints = 10'000;

/// Positions (stored quanta) that finished nodes keep near their faces; what neighbours plant as seeds.
using NodeBorders = std::map<NodeKey, std::vector<Vec3i>>;

/// The border of a node outside the subtree, if it was sampled before by everybody's order; else empty.
using BorderOf = std::function<std::span<const Vec3i>(const NodeKey&)>;

/// Plants the borders of the neighbours of a node.
void add_seeds_of_neighbours(NodeSampler& sampler, const NodeKey& node, const BorderOf& border_of);

/// A finished chunk: all its nodes but the root, whose points may still move up.
struct Subtree {
    std::vector<BuiltNode> nodes;     // by level, then in octant order
    std::vector<std::byte> bytes;     // their stored form
    NodeKey root;
    bool root_is_leaf = false;
    std::vector<std::byte> root_records;  // what the root keeps, sorted
    NodeBorders borders;              // of inner nodes that touch the subtree's faces
    uint64_t points = 0;              // in `nodes`; the root's not counted
};

/// Builds one chunk after the other, keeping its buffers. One per thread.
class SubtreeBuilder {
public:
    SubtreeBuilder(const OctreeFrame& frame, size_t record_size, const NodeSink& sink);

    /// Where the next chunk's records go: resize, fill, then build.
    std::vector<std::byte>& records() { return records_; }

    Subtree build(const NodeKey& root, const BorderOf& outside_border_of);

    /// Bytes that building a chunk of that many points takes, all told, at most.
    static uint64_t memory_needed(uint64_t points, size_t record_size);

private:
    struct Node {
        NodeKey key;
        uint32_t begin = 0, end = 0;        // records
        std::vector<uint32_t> children;     // indices into the next level
        std::vector<uint32_t> kept;         // inner nodes: what they keep, ascending
        std::vector<Vec3i> border;
        bool leaf = false;
    };

    void divide(const NodeKey& root);
    void sample_node(uint32_t depth, size_t index, const NodeKey& root, const BorderOf& outside_border_of);
    void encode_node(uint32_t depth, const Node& node, Subtree& subtree);
    bool coincide(uint32_t begin, uint32_t end) const;
    uint32_t digit(uint32_t record, uint32_t depth) const;
    const std::byte* record(uint32_t index) const { return records_.data() + size_t(index) * record_size_; }

    const OctreeFrame& frame_;
    size_t record_size_;
    const NodeSink& sink_;
    NodeSampler sampler_;
    uint32_t root_level_ = 0;
    std::vector<std::byte> records_, scratch_;
    std::vector<uint64_t> codes_;
    std::vector<std::vector<Node>> levels_;  // [depth below the root], each in octant order
    std::vector<uint8_t> keeper_depth_;      // [records] depth of the highest node that keeps the point
    std::vector<Vec3i> candidates_;
    std::vector<uint32_t> candidate_records_, picked_;
};

}  // namespace strata
