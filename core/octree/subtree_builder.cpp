#include "core/octree/subtree_builder.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "core/octree/record_layout.h"

namespace strata {
namespace {

bool inside(const NodeKey& key, const NodeKey& ancestor) {
    const uint32_t up = key.level - ancestor.level;
    return key.x >> up == ancestor.x && key.y >> up == ancestor.y && key.z >> up == ancestor.z;
}

bool touches_faces_of(const NodeKey& key, const NodeKey& ancestor) {
    const uint32_t up = key.level - ancestor.level;
    const uint32_t last = uint32_t((uint64_t{1} << up) - 1);
    const auto at_end = [&](uint32_t cell) { return (cell & last) == 0 || (cell & last) == last; };
    return at_end(key.x) || at_end(key.y) || at_end(key.z);
}

}  // namespace

SubtreeBuilder::SubtreeBuilder(const OctreeFrame& frame, size_t record_size, const NodeSink& sink)
    : frame_(frame), record_size_(record_size), sink_(sink), sampler_(frame), sort_(frame) {}

uint64_t SubtreeBuilder::memory_needed(uint64_t points, size_t record_size) {
    // Records as they came and encoded, words twice and the order of the sort, positions, lists; then what the sampler holds.
    constexpr uint64_t kSamplerBytes = 12'000'000;
    return kSamplerBytes + points * (2 * record_size + 2 * 8 + 4 + 12 + 1 + 3 * 4 + NodeSampler::kBytesPerCandidate);
}

// Decides whether the node is a leaf, and notes the border that it has from above.
void SubtreeBuilder::prepare(Node& node, const NodeKey& root) {
    const uint64_t rest = node.end - node.begin - node.kept_above.size();
    const bool coincide = std::memcmp(record(node.begin), record(node.end - 1), 12) == 0;  // first and last in cell order
    node.leaf = rest <= kMaxLeafPoints || node.key.level == kMaxLevel || coincide;
    node.at_face = touches_faces_of(node.key, root);
    sampler_.start(node.key);
    for (const uint32_t i : node.kept_above)
        if (const Vec3i p_quanta = position(i); sampler_.near_faces(p_quanta)) node.border.push_back(p_quanta);
}

// What is kept so far around a node inside the chunk: by nodes of its level, or above leaves that end higher up.
void SubtreeBuilder::add_seeds_of_neighbours(const NodeKey& node, const NodeKey& root, const std::vector<Node>& level,
                                             const LeafBorders& leaf_borders) {
    const auto plant = [&](const std::vector<Vec3i>& border) {
        for (const Vec3i& p_quanta : border) sampler_.add_seed(p_quanta, node.level);
    };
    for_each_neighbour(node, [&](NodeKey key) {
        if (!inside(key, root)) return;
        const auto found =
            std::lower_bound(level.begin(), level.end(), key, [](const Node& a, const NodeKey& k) { return octant_order(a.key, k); });
        if (found != level.end() && found->key == key) return plant(found->border);
        while (key.level > root.level) {
            key = key.parent();
            if (const auto leaf = leaf_borders.find(key); leaf != leaf_borders.end()) return plant(leaf->second);
        }
    });
}

// The sampler has its seeds, among them the points that nodes above keep.
void SubtreeBuilder::sample(Node& node) {
    const auto candidates = [&](size_t axis) { return std::span<const int32_t>(quanta_[axis]).subspan(node.begin, node.end - node.begin); };
    sampler_.sample(candidates(0), candidates(1), candidates(2), picked_);
    for (const uint32_t pick : picked_) {
        const uint32_t i = node.begin + pick;
        kept_[i] = 1;
        node.kept.push_back(i);
        if (const Vec3i p_quanta = position(i); sampler_.near_faces(p_quanta)) node.border.push_back(p_quanta);
    }
}

void SubtreeBuilder::read_positions() {
    for (std::vector<int32_t>& axis : quanta_) axis.resize(order_.size());
    for (uint32_t i = 0; i < order_.size(); ++i) {
        prefetch_record(i + kAhead);
        const Vec3i p_quanta = record_position(record(i));
        for (int axis = 0; axis < 3; ++axis) quanta_[size_t(axis)][i] = p_quanta[axis];
    }
}

void SubtreeBuilder::add_to_border(const Node& node, const NodeKey& root, Subtree& subtree) {
    if (!node.at_face) return;
    const double side = frame_.node_side(root.level), spacing = frame_.spacing(node.key.level);
    const Vec3d low = Vec3d(root.x, root.y, root.z) * side;
    for (const uint32_t i : node.kept) {
        const Vec3i p_quanta = position(i);
        const Vec3d p = p_quanta.cast<double>().cwiseProduct(frame_.scale) - low;
        if ((p.array() < spacing).any() || (p.array() > side - spacing).any()) subtree.border.push_back({p_quanta, node.key.level});
    }
}

std::vector<SubtreeBuilder::Node> SubtreeBuilder::divide(const Node& node) const {
    std::vector<uint32_t> kept(node.kept_above.size() + node.kept.size());
    std::merge(node.kept_above.begin(), node.kept_above.end(), node.kept.begin(), node.kept.end(), kept.begin());
    const uint32_t bit = kMaxLevel - node.key.level - 1;
    const auto octant_of = [&](uint32_t index) {
        uint32_t octant = 0;
        for (int axis = 0; axis < 3; ++axis) octant = octant << 1 | (frame_.cell(axis, quanta_[size_t(axis)][index]) >> bit & 1);
        return octant;
    };
    std::vector<Node> children;
    auto kept_begin = kept.begin();
    for (uint32_t begin = node.begin; begin < node.end;) {
        const uint32_t octant = octant_of(begin);
        uint32_t low = begin + 1, high = node.end;  // the first record of another octant
        while (low < high) {
            const uint32_t middle = low + (high - low) / 2;
            if (octant_of(middle) == octant)
                low = middle + 1;
            else
                high = middle;
        }
        const auto kept_end = std::lower_bound(kept_begin, kept.end(), low);
        children.push_back({.key = node.key.child(int(octant)), .begin = begin, .end = low, .kept_above = {kept_begin, kept_end}});
        kept_begin = kept_end;
        begin = low;
    }
    return children;
}

// What the node stores: a leaf all that no node above keeps. Valid until the next call.
std::span<const std::byte> SubtreeBuilder::gather(const Node& node) {
    const size_t most = record_size_ * (node.leaf ? node.end - node.begin : node.kept.size());
    if (node_records_.size() < most) node_records_.resize(most);
    std::byte* to = node_records_.data();
    const auto take = [&](uint32_t index) {
        prefetch_record(index + kAhead);
        copy_record(to, record(index), record_size_);
        to += record_size_;
    };
    if (node.leaf) {
        for (uint32_t i = node.begin; i < node.end; ++i)
            if (!kept_[i]) take(i);
    } else {
        for (const uint32_t i : node.kept) take(i);
    }
    return {node_records_.data(), to};
}

void SubtreeBuilder::encode(const Node& node, Subtree& subtree) {
    const std::span<const std::byte> records = gather(node);
    const uint32_t points = uint32_t(records.size() / record_size_);
    if (points == 0 && node.leaf) return;  // all are kept above: nothing is left to store
    const uint64_t offset = subtree.bytes.size();
    if (points > 0) sink_.encode(records, points, subtree.bytes);
    subtree.nodes.push_back({node.key, points, offset, subtree.bytes.size() - offset});
    subtree.points += points;
}

Subtree SubtreeBuilder::build(const NodeKey& root, std::span<const std::byte> records, std::span<const BorderPoint> seeds,
                              std::vector<std::byte> buffer) {
    records_ = records;
    order_ = sort_(root.level, records, record_size_);
    read_positions();
    kept_.assign(order_.size(), 0);
    Subtree subtree{.root = root};
    subtree.bytes = std::move(buffer);
    subtree.bytes.reserve(records_.size());
    LeafBorders leaf_borders;
    std::vector<Node> level = {Node{.key = root, .begin = 0, .end = uint32_t(order_.size())}};
    for (uint32_t depth = 0; !level.empty(); ++depth) {
        for (Node& node : level) prepare(node, root);
        std::vector<Node> below;
        for (Node& node : level) {
            if (node.leaf) continue;
            sampler_.start(node.key);
            for (const uint32_t i : node.kept_above) sampler_.add_seed(position(i), node.key.level);
            add_seeds_of_neighbours(node.key, root, level, leaf_borders);
            if (node.at_face)
                for (const BorderPoint& seed : seeds) sampler_.add_seed(seed.p_quanta, seed.level);
            sample(node);
            add_to_border(node, root, subtree);
            std::vector<Node> children = divide(node);
            std::move(children.begin(), children.end(), std::back_inserter(below));
        }
        for (Node& node : level) {
            if (depth > 0) {
                encode(node, subtree);
            } else {
                const std::span<const std::byte> of_root = gather(node);
                subtree.root_records.assign(of_root.begin(), of_root.end());
            }
            if (node.leaf) leaf_borders[node.key] = std::move(node.border);
        }
        level = std::move(below);
    }
    return subtree;
}

}  // namespace strata
