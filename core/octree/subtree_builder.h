#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "core/octree/node_sampling.h"
#include "core/octree/node_sink.h"
#include "core/octree/octree_frame.h"
#include "core/octree/record_sort.h"

namespace strata {

/// Most points of a leaf, unless they coincide.
inline constexpr uint64_t kMaxLeafPoints = 10'000;

/// A point (stored quanta) that a finished node keeps, so near to the faces of its chunk that others must know of it.
struct BorderPoint {
    Vec3i p_quanta;
    uint32_t level;  // of the node that keeps it
};

/// A finished chunk: all its nodes but the root, whose points may still move up.
struct Subtree {
    std::vector<BuiltNode> nodes;     // by level, then in octant order
    std::vector<std::byte> bytes;     // their stored form
    NodeKey root;
    std::vector<std::byte> root_records;  // what the root keeps, sorted
    std::vector<BorderPoint> border;      // nearer to the chunk's faces than the spacing of their level
    uint64_t points = 0;              // in `nodes`; the root's not counted
};

/// Builds one chunk after the other, keeping its buffers. One per thread.
/// From the root down, each inner node keeps a maximal subset of the points that no node above it keeps, at its spacing
/// from all that are kept so far: so the union of the levels down to any one is evenly spaced and leaves no gap.
class SubtreeBuilder {
public:
    SubtreeBuilder(const OctreeFrame& frame, size_t record_size, const NodeSink& sink);

    /// records  of all the points in the root's cube, in any order
    /// seeds    border points of adjacent chunks that were built before in everybody's order
    /// buffer   empty, with room that Subtree::bytes reuses
    Subtree build(const NodeKey& root, std::span<const std::byte> records, std::span<const BorderPoint> seeds,
                  std::vector<std::byte> buffer);

    /// Bytes that building a chunk of that many points takes, all told, with its records, at most.
    static uint64_t memory_needed(uint64_t points, size_t record_size);

private:
    struct Node {
        NodeKey key;
        uint32_t begin = 0, end = 0;       // points in its cube, by their place in the order
        std::vector<uint32_t> kept_above;  // of these, those that nodes above keep; ascending
        std::vector<uint32_t> kept;        // inner nodes: what it keeps itself; ascending
        std::vector<Vec3i> border;         // of all that is kept in its cube so far, what is near its faces
        bool leaf = false;
        bool at_face = false;              // of the chunk
    };
    using LeafBorders = std::map<NodeKey, std::vector<Vec3i>>;

    void prepare(Node& node, const NodeKey& root);
    void add_seeds_of_neighbours(const NodeKey& key, const NodeKey& root, const std::vector<Node>& level, const LeafBorders& leaf_borders);
    void sample(Node& node);
    void add_to_border(const Node& node, const NodeKey& root, Subtree& subtree);
    std::vector<Node> divide(const Node& node) const;
    std::span<const std::byte> gather(const Node& node);
    void encode(const Node& node, Subtree& subtree);
    const std::byte* record(uint32_t index) const { return records_.data() + size_t(order_[index]) * record_size_; }
    // Records come from all over the chunk: their lines are asked for some points ahead.
    static constexpr uint32_t kAhead = 16;
    void prefetch_record(uint32_t index) const {
        const std::byte* ahead = record(std::min<uint32_t>(index, uint32_t(order_.size()) - 1));
        __builtin_prefetch(ahead);
        __builtin_prefetch(ahead + record_size_ - 1);
    }
    Vec3i position(uint32_t index) const { return {quanta_[0][index], quanta_[1][index], quanta_[2][index]}; }
    void read_positions();

    const OctreeFrame& frame_;
    size_t record_size_;
    const NodeSink& sink_;
    NodeSampler sampler_;
    RecordSort sort_;
    std::span<const std::byte> records_;          // as they came
    std::span<const uint32_t> order_;             // [points] index of the record
    std::array<std::vector<int32_t>, 3> quanta_;  // [axis][points] positions, in order
    std::vector<uint8_t> kept_;                   // [points] 1: by some node
    std::vector<std::byte> node_records_;         // of the node that is being encoded
    std::vector<uint32_t> picked_;
};

}  // namespace strata
