#include "core/voxel/voxel_dag.h"

#include <algorithm>
#include <limits>
#include <string>

#include "core/error.h"
#include "core/math/random.h"

namespace strata {

namespace {

constexpr uint64_t kMost = std::numeric_limits<uint64_t>::max();

// Sums and products of counts that a file may claim: they stay at the most there is.
uint64_t add_clamped(uint64_t a, uint64_t b) { return a > kMost - b ? kMost : a + b; }
uint64_t multiply_clamped(uint64_t a, uint64_t b) { return b != 0 && a > kMost / b ? kMost : a * b; }

// The different nodes of a level, found again by a hash of their contents.
class NodeSet {
public:
    explicit NodeSet(bool with_full) : with_full_(with_full) { slots_.assign(1024, kNone); }

    // The number of the node with these children, in the order of first occurrence.
    uint32_t add(uint64_t mask, uint64_t full, std::span<const uint32_t> children) {
        const uint64_t hash = hash_of(mask, full, children);
        size_t slot = hash & (slots_.size() - 1);
        for (; slots_[slot] != kNone; slot = (slot + 1) & (slots_.size() - 1)) {
            const uint32_t node = slots_[slot];
            if (masks_[node] == mask && full_of(node) == full &&
                std::equal(children.begin(), children.end(), children_.begin() + ptrdiff_t(first_[node])))
                return node;
        }
        const auto node = uint32_t(masks_.size());
        slots_[slot] = node;
        masks_.push_back(mask);
        if (with_full_) full_.push_back(full);
        first_.push_back(children_.size());
        children_.insert(children_.end(), children.begin(), children.end());
        if (masks_.size() * 2 > slots_.size()) grow();
        return node;
    }

    DagLevel take(bool last) {
        DagLevel level;
        if (!last) {
            if (children_.size() > std::numeric_limits<uint32_t>::max())
                throw Error(ErrorKind::limit, "more than 2^32 - 1 pointers in a level of shared subtrees");
            level.pointers = pack_numbers(children_);
            level.first_pointer.assign(first_.begin(), first_.end());
        }
        level.masks = std::move(masks_);
        level.full = std::move(full_);
        return level;
    }

private:
    static constexpr uint32_t kNone = ~uint32_t{0};

    static uint64_t hash_of(uint64_t mask, uint64_t full, std::span<const uint32_t> children) {
        uint64_t hash = mix_bits(mask ^ mix_bits(full));
        for (const uint32_t child : children) hash = mix_bits(hash ^ child);
        return hash;
    }
    uint64_t full_of(uint32_t node) const { return with_full_ ? full_[node] : 0; }
    void grow() {
        slots_.assign(slots_.size() * 2, kNone);
        for (uint32_t node = 0; node < masks_.size(); ++node) {
            const size_t end = node + 1 < first_.size() ? first_[node + 1] : children_.size();
            size_t slot =
                hash_of(masks_[node], full_of(node), std::span(children_).subspan(first_[node], end - first_[node])) & (slots_.size() - 1);
            while (slots_[slot] != kNone) slot = (slot + 1) & (slots_.size() - 1);
            slots_[slot] = node;
        }
    }

    bool with_full_;
    std::vector<uint64_t> masks_, full_;
    std::vector<size_t> first_;  // of children_
    std::vector<uint32_t> children_, slots_;
};

[[noreturn]] void refuse(size_t level, const std::string& what) {
    throw Error(ErrorKind::malformed, "shared subtrees: level " + std::to_string(level) + ": " + what);
}

// By level and node, from the last level up.
std::vector<uint64_t> voxels_below(const VoxelDag& dag, size_t level, const std::vector<uint64_t>& of_children) {
    const DagLevel& nodes = dag.levels[level];
    const uint64_t voxels_of_cell = uint64_t{1} << 6 * (dag.frame.levels - 1 - int(level));
    std::vector<uint64_t> voxels(nodes.masks.size());
    for (size_t node = 0; node < voxels.size(); ++node) {
        const bool last = level + 1 == dag.levels.size();
        const uint64_t whole = last ? nodes.masks[node] : nodes.full_mask(node);
        voxels[node] = multiply_clamped(uint64_t(std::popcount(whole)), voxels_of_cell);
        const int pointers = last ? 0 : std::popcount(nodes.masks[node] & ~whole);
        for (int i = 0; i < pointers; ++i)
            voxels[node] = add_clamped(voxels[node], of_children[nodes.pointers[nodes.first_pointer[node] + uint32_t(i)]]);
    }
    return voxels;
}

}  // namespace

PackedNumbers pack_numbers(std::span<const uint32_t> numbers) {
    PackedNumbers packed;
    uint32_t any = 0;
    for (const uint32_t number : numbers) any |= number;
    packed.width = int(std::bit_width(any));
    packed.bytes.resize(PackedNumbers::size_bytes(numbers.size(), packed.width));
    uint64_t bit = 0;
    for (const uint32_t number : numbers) {
        uint64_t word;
        std::memcpy(&word, packed.bytes.data() + (bit >> 3), sizeof word);
        word |= uint64_t(number) << (bit & 7);
        std::memcpy(packed.bytes.data() + (bit >> 3), &word, sizeof word);
        bit += uint64_t(packed.width);
    }
    return packed;
}

VoxelDag dag_of(const VoxelTree& tree) {
    VoxelDag dag;
    dag.frame = tree.frame;
    if (tree.empty()) return dag;
    dag.levels.resize(tree.levels.size());
    std::vector<uint32_t> number_below, number;  // of a tree's node among the different ones
    std::vector<uint32_t> children;
    for (size_t l = tree.levels.size(); l-- > 0;) {
        const VoxelLevel& level = tree.levels[l];
        const bool last = l + 1 == tree.levels.size();
        const bool any_full = std::any_of(level.full.begin(), level.full.end(), [](uint64_t full) { return full != 0; });
        NodeSet set(any_full);
        number.resize(level.masks.size());
        size_t next_child = 0;
        for (size_t node = 0; node < number.size(); ++node) {
            const uint64_t full = level.full_mask(node);
            children.clear();
            if (!last) {
                const auto count = size_t(std::popcount(level.masks[node] & ~full));
                children.assign(number_below.begin() + ptrdiff_t(next_child), number_below.begin() + ptrdiff_t(next_child + count));
                next_child += count;
            }
            number[node] = set.add(level.masks[node], full, children);
        }
        dag.levels[l] = set.take(last);
        std::swap(number, number_below);
    }
    return dag;
}

void index_dag(VoxelDag& dag) {
    if (dag.frame.levels < 1 || dag.frame.levels > kMostVoxelLevels)
        throw Error(ErrorKind::malformed, "shared subtrees: 1 to 10 levels expected, the frame has " + std::to_string(dag.frame.levels));
    if (dag.levels.size() > size_t(dag.frame.levels))
        throw Error(ErrorKind::malformed, "shared subtrees: at most " + std::to_string(dag.frame.levels) + " levels expected, found " +
                                              std::to_string(dag.levels.size()));
    for (size_t l = 0; l < dag.levels.size(); ++l) {
        DagLevel& level = dag.levels[l];
        const size_t nodes = level.masks.size();
        if (l == 0 && nodes != 1) refuse(l, "one root expected, found " + std::to_string(nodes));
        if (nodes > std::numeric_limits<uint32_t>::max()) refuse(l, "at most 2^32 - 1 nodes expected, found " + std::to_string(nodes));
        if (!level.full.empty() && level.full.size() != nodes)
            refuse(l, std::to_string(nodes) + " masks of full cells expected, found " + std::to_string(level.full.size()));
        const bool last = l + 1 == dag.levels.size();
        level.first_pointer.clear();
        if (!last) level.first_pointer.reserve(nodes);
        uint64_t pointers = 0;
        for (size_t node = 0; node < nodes; ++node) {
            const uint64_t mask = level.masks[node], full = level.full_mask(node);
            if (mask == 0) refuse(l, "node " + std::to_string(node) + " is empty");
            if ((full & ~mask) != 0) refuse(l, "node " + std::to_string(node) + " has full cells that are not occupied");
            if (last) continue;
            level.first_pointer.push_back(uint32_t(pointers));
            pointers += uint64_t(std::popcount(mask & ~full));
            if (pointers > std::numeric_limits<uint32_t>::max()) refuse(l, "more than 2^32 - 1 pointers");
        }
        if (last) {
            if (!level.pointers.bytes.empty()) refuse(l, "the last level has pointers");
            continue;
        }
        const int width = level.pointers.width;
        if (width < 0 || width > 32) refuse(l, "pointers of 0 to 32 bits expected, not " + std::to_string(width));
        const uint64_t expected = PackedNumbers::size_bytes(pointers, width);
        if (level.pointers.bytes.size() != expected)
            refuse(l, std::to_string(expected) + " bytes of pointers expected, found " + std::to_string(level.pointers.bytes.size()));
        const uint64_t below = dag.levels[l + 1].masks.size();
        for (uint64_t i = 0; i < pointers; ++i)
            if (level.pointers[i] >= below)
                refuse(l, "pointer " + std::to_string(i) + " leads to node " + std::to_string(level.pointers[i]) + " of " +
                              std::to_string(below));
    }
}

std::vector<DagLevelCounts> count_dag(const VoxelDag& dag) {
    std::vector<DagLevelCounts> counts(dag.levels.size());
    std::vector<uint64_t> times = {1}, times_below;  // that a node occurs in the tree
    for (size_t l = 0; l < dag.levels.size(); ++l) {
        const DagLevel& level = dag.levels[l];
        counts[l].nodes = level.masks.size();
        counts[l].bytes = 8 * (level.masks.size() + level.full.size()) + level.pointers.bytes.size();
        for (const uint64_t n : times) counts[l].tree_nodes = add_clamped(counts[l].tree_nodes, n);
        if (l + 1 == dag.levels.size()) break;
        times_below.assign(dag.levels[l + 1].masks.size(), 0);
        for (size_t node = 0; node < level.masks.size(); ++node) {
            const int pointers = std::popcount(level.masks[node] & ~level.full_mask(node));
            for (int i = 0; i < pointers; ++i) {
                uint64_t& below = times_below[level.pointers[level.first_pointer[node] + uint32_t(i)]];
                below = add_clamped(below, times[node]);
            }
        }
        std::swap(times, times_below);
    }
    return counts;
}

uint64_t count_voxels(const VoxelDag& dag) {
    if (dag.empty()) return 0;
    std::vector<uint64_t> voxels;
    for (size_t l = dag.levels.size(); l-- > 0;) voxels = voxels_below(dag, l, voxels);
    return voxels[0];
}

VoxelTree expand(const VoxelDag& dag, uint64_t most_nodes) {
    uint64_t nodes = 0;
    for (const DagLevelCounts& counts : count_dag(dag)) nodes = add_clamped(nodes, counts.tree_nodes);
    if (nodes > most_nodes)
        throw Error(ErrorKind::limit,
                    "the tree of these shared subtrees has " + std::to_string(nodes) + " nodes, more than " + std::to_string(most_nodes));
    VoxelTree tree;
    tree.frame = dag.frame;
    if (dag.empty()) return tree;
    std::vector<uint32_t> numbers = {0}, numbers_below;
    for (size_t l = 0; l < dag.levels.size(); ++l) {
        const DagLevel& shared = dag.levels[l];
        VoxelLevel level;
        level.masks.reserve(numbers.size());
        numbers_below.clear();
        for (const uint32_t node : numbers) {
            level.masks.push_back(shared.masks[node]);
            if (!shared.full.empty()) level.full.push_back(shared.full[node]);
            if (l + 1 == dag.levels.size()) continue;
            const int pointers = std::popcount(shared.masks[node] & ~shared.full_mask(node));
            for (int i = 0; i < pointers; ++i) numbers_below.push_back(shared.pointers[shared.first_pointer[node] + uint32_t(i)]);
        }
        tree.levels.push_back(std::move(level));
        std::swap(numbers, numbers_below);
    }
    index_tree(tree);
    return tree;
}

}  // namespace strata
