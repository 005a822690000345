#include "core/octree/subtree_builder.h"

#include <algorithm>
#include <cstring>

#include "core/octree/record_layout.h"
#include "core/octree/record_sort.h"

namespace strata {
namespace {

bool inside(const NodeKey& key, const NodeKey& ancestor) {
    const uint32_t up = key.level - ancestor.level;
    return key.x >> up == ancestor.x && key.y >> up == ancestor.y && key.z >> up == ancestor.z;
}

bool touches_faces_of(const NodeKey& key, const NodeKey& ancestor) {
    const uint32_t up = key.level - ancestor.level;
    const auto at_end = [&](uint32_t cell) {
        const uint32_t within = cell & ((1u << up) - 1);
        return within == 0 || within == (1u << up) - 1;
    };
    return at_end(key.x) || at_end(key.y) || at_end(key.z);
}

}  // namespace

void add_seeds_of_neighbours(NodeSampler& sampler, const NodeKey& node, const BorderOf& border_of) {
    for_each_neighbour(node, [&](const NodeKey& key) {
        for (const Vec3i& p_quanta : border_of(key)) sampler.add_seed(p_quanta);
    });
}

SubtreeBuilder::SubtreeBuilder(const OctreeFrame& frame, size_t record_size, const NodeSink& sink)
    : frame_(frame), record_size_(record_size), sink_(sink), sampler_(frame) {}

uint64_t SubtreeBuilder::memory_needed(uint64_t points, size_t record_size) {
    // Records twice while sorting, once more encoded; two codes, two coded indices of a bucket; candidates and lists.
    constexpr uint64_t kSamplerBytes = 12'000'000;
    return kSamplerBytes + points * (3 * record_size + 2 * 8 + 16 + 1 + 12 + 16 + 3 * 4);
}

uint32_t SubtreeBuilder::digit(uint32_t index, uint32_t depth) const {
    if (depth < kCodeLevels) return uint32_t(codes_[index] >> 3 * (kCodeLevels - 1 - depth) & 7);
    const uint64_t deeper = code_below(frame_, root_level_ + kCodeLevels, record(index));
    return uint32_t(deeper >> 3 * (2 * kCodeLevels - 1 - depth) & 7);
}

bool SubtreeBuilder::coincide(uint32_t begin, uint32_t end) const {
    return std::memcmp(record(begin), record(end - 1), 12) == 0;  // the first and last in cell order
}

void SubtreeBuilder::divide(const NodeKey& root) {
    levels_.clear();
    levels_.push_back({Node{.key = root, .begin = 0, .end = uint32_t(codes_.size())}});
    for (uint32_t depth = 0; !levels_[depth].empty(); ++depth) {
        std::vector<Node> below;
        for (Node& node : levels_[depth]) {
            node.leaf = node.end - node.begin <= kMaxLeafPoints || node.key.level == kMaxLevel || coincide(node.begin, node.end);
            if (node.leaf) continue;
            for (uint32_t begin = node.begin; begin < node.end;) {
                const uint32_t octant = digit(begin, depth);
                uint32_t low = begin + 1, high = node.end;  // the first record of another octant
                while (low < high) {
                    const uint32_t middle = low + (high - low) / 2;
                    if (digit(middle, depth) == octant)
                        low = middle + 1;
                    else
                        high = middle;
                }
                node.children.push_back(uint32_t(below.size()));
                below.push_back({.key = node.key.child(int(octant)), .begin = begin, .end = low});
                begin = low;
            }
        }
        levels_.push_back(std::move(below));
    }
    levels_.pop_back();
}

void SubtreeBuilder::sample_node(uint32_t depth, size_t index, const NodeKey& root, const BorderOf& outside_border_of) {
    std::vector<Node>& level = levels_[depth];
    Node& node = level[index];
    candidate_records_.clear();
    for (const uint32_t child_index : node.children) {
        const Node& child = levels_[depth + 1][child_index];
        if (child.leaf)
            for (uint32_t i = child.begin; i < child.end; ++i) candidate_records_.push_back(i);
        else
            candidate_records_.insert(candidate_records_.end(), child.kept.begin(), child.kept.end());
    }
    candidates_.resize(candidate_records_.size());
    for (size_t i = 0; i < candidates_.size(); ++i) candidates_[i] = record_position(record(candidate_records_[i]));

    sampler_.start(node.key);
    add_seeds_of_neighbours(sampler_, node.key, [&](const NodeKey& key) -> std::span<const Vec3i> {
        if (!inside(key, root)) return outside_border_of(key);
        const auto found = std::lower_bound(level.begin(), level.end(), key,
                                            [](const Node& a, const NodeKey& b) { return octant_order(a.key, b); });
        return found != level.end() && found->key == key ? std::span<const Vec3i>(found->border) : std::span<const Vec3i>();
    });
    sampler_.sample(candidates_, picked_);
    node.kept.resize(picked_.size());
    for (size_t i = 0; i < picked_.size(); ++i) {
        node.kept[i] = candidate_records_[picked_[i]];
        keeper_depth_[node.kept[i]] = uint8_t(depth);
        if (sampler_.near_faces(candidates_[picked_[i]])) node.border.push_back(candidates_[picked_[i]]);
    }
}

void SubtreeBuilder::encode_node(uint32_t depth, const Node& node, Subtree& subtree) {
    scratch_.clear();
    const auto take = [&](uint32_t index) {
        if (keeper_depth_[index] == depth) scratch_.insert(scratch_.end(), record(index), record(index) + record_size_);
    };
    if (node.leaf)
        for (uint32_t i = node.begin; i < node.end; ++i) take(i);
    else
        for (const uint32_t i : node.kept) take(i);
    const uint32_t points = uint32_t(scratch_.size() / record_size_);
    if (points == 0 && node.leaf) return;  // all moved up: nothing is left to store
    const uint64_t offset = subtree.bytes.size();
    if (points > 0) sink_.encode(scratch_, points, subtree.bytes);
    subtree.nodes.push_back({node.key, points, offset, subtree.bytes.size() - offset});
    subtree.points += points;
}

Subtree SubtreeBuilder::build(const NodeKey& root, const BorderOf& outside_border_of) {
    root_level_ = root.level;
    sort_records(frame_, root.level, record_size_, records_, scratch_, codes_);
    divide(root);
    keeper_depth_.resize(codes_.size());
    for (size_t depth = 0; depth < levels_.size(); ++depth)
        for (const Node& node : levels_[depth])
            if (node.leaf) std::fill(keeper_depth_.begin() + node.begin, keeper_depth_.begin() + node.end, uint8_t(depth));
    for (uint32_t depth = uint32_t(levels_.size()); depth-- > 0;)
        for (size_t index = 0; index < levels_[depth].size(); ++index)
            if (!levels_[depth][index].leaf) sample_node(depth, index, root, outside_border_of);

    Subtree subtree{.root = root};
    Node& top = levels_[0][0];
    subtree.root_is_leaf = top.leaf;
    for (uint32_t depth = 1; depth < levels_.size(); ++depth)
        for (const Node& node : levels_[depth]) encode_node(depth, node, subtree);
    if (top.leaf) {
        subtree.root_records = records_;
    } else {
        for (const uint32_t i : top.kept)
            subtree.root_records.insert(subtree.root_records.end(), record(i), record(i) + record_size_);
    }
    for (std::vector<Node>& level : levels_)
        for (Node& node : level)
            if (!node.border.empty() && touches_faces_of(node.key, root)) subtree.borders[node.key] = std::move(node.border);
    return subtree;
}

}  // namespace strata
