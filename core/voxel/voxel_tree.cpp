#include "core/voxel/voxel_tree.h"

#include <limits>
#include <string>

#include "core/error.h"

namespace strata {
namespace {

constexpr uint64_t kMostCells = std::numeric_limits<uint32_t>::max();

[[noreturn]] void fail(size_t level, const std::string& what) {
    throw Error(ErrorKind::malformed, "level " + std::to_string(level) + " of the voxel tree: " + what);
}

// Fills first_child. returns the number of children
uint64_t index_level(size_t number, bool last, VoxelLevel& level) {
    const size_t nodes = level.masks.size();
    if (!level.full.empty() && level.full.size() != nodes)
        fail(number, std::to_string(nodes) + " masks and " + std::to_string(level.full.size()) + " masks of full cells");
    level.first_child.assign(last ? 0 : nodes, 0);
    uint64_t children = 0;
    for (size_t node = 0; node < nodes; ++node) {
        const uint64_t mask = level.masks[node], full = level.full_mask(node);
        if (mask == 0) fail(number, "node " + std::to_string(node) + " has no cells");
        if ((full & ~mask) != 0) fail(number, "node " + std::to_string(node) + " has full cells that are not occupied");
        if (last) continue;
        level.first_child[node] = uint32_t(children);
        children += uint64_t(std::popcount(mask & ~full));
        if (children > kMostCells) fail(number, "more than 2^32 - 1 nodes below");
    }
    return children;
}

void index_cells(const VoxelLevel& level, size_t number, std::vector<uint32_t>& before_odd, std::vector<uint32_t>& before_even) {
    before_odd.resize(level.masks.size());
    before_even.resize(level.masks.size());
    uint64_t odd = 0, even = 0;
    for (size_t node = 0; node < level.masks.size(); ++node) {
        before_odd[node] = uint32_t(odd);
        before_even[node] = uint32_t(even);
        odd += uint64_t(std::popcount(bytes_present(level.masks[node])));
        even += uint64_t(std::popcount(level.masks[node]));
        if (even > kMostCells) fail(number, "more than 2^32 - 1 cells with attributes");
    }
}

}  // namespace

void index_tree(VoxelTree& tree) {
    uint64_t expected = tree.empty() ? 0 : 1;
    for (size_t number = 0; number < tree.levels.size(); ++number) {
        VoxelLevel& level = tree.levels[number];
        if (level.masks.size() != expected)
            fail(number, std::to_string(expected) + " nodes are expected, " + std::to_string(level.masks.size()) + " are there");
        expected = index_level(number, number + 1 == tree.levels.size(), level);
    }
    tree.cells_before_odd.clear();
    tree.cells_before_even.clear();
    if (tree.attributes.empty()) return;
    tree.cells_before_odd.resize(tree.levels.size());
    tree.cells_before_even.resize(tree.levels.size());
    for (size_t number = 0; number < tree.levels.size(); ++number)
        index_cells(tree.levels[number], number, tree.cells_before_odd[number], tree.cells_before_even[number]);
}

void check_attributes(const VoxelTree& tree) {
    for (size_t depth = 1; depth < tree.attributes.size(); ++depth) {
        const size_t number = (depth - 1) / 2;
        uint64_t cells = 0;
        for (const uint64_t mask : tree.levels[number].masks) cells += uint64_t(std::popcount(depth % 2 == 1 ? uint64_t{bytes_present(mask)} : mask));
        const auto check = [&](size_t entries, const char* what) {
            if (entries != 0 && entries != cells)
                fail(number, std::to_string(cells) + " cells at depth " + std::to_string(depth) + ", but " + std::to_string(entries) + " " + what);
        };
        const CellAttributes& attributes = tree.attributes[depth];
        check(attributes.counts.size(), "counts");
        check(attributes.colors.size(), "colors");
        check(attributes.normals.size(), "normals");
        check(attributes.opacities.size(), "opacities");
    }
}

uint64_t count_voxels(const VoxelTree& tree) {
    uint64_t voxels = 0;
    for (size_t number = 0; number < tree.levels.size(); ++number) {
        const VoxelLevel& level = tree.levels[number];
        const size_t below = tree.levels.size() - 1 - number;
        uint64_t cells = 0;
        for (const uint64_t mask : below == 0 ? level.masks : level.full) cells += uint64_t(std::popcount(mask));
        voxels += cells << 6 * below;
    }
    return voxels;
}

bool is_occupied(const VoxelTree& tree, uint32_t x, uint32_t y, uint32_t z) {
    if (tree.empty()) return false;
    uint32_t node = 0;
    for (size_t number = 0; number < tree.levels.size(); ++number) {
        const int shift = 2 * (tree.frame.levels - 1 - int(number));
        const int bit = mask_bit(x >> shift, y >> shift, z >> shift);
        const VoxelLevel& level = tree.levels[number];
        if ((level.masks[node] >> bit & 1) == 0) return false;
        if (number + 1 == tree.levels.size() || (level.full_mask(node) >> bit & 1) != 0) return true;
        node = level.child(node, bit);
    }
    return false;
}

}  // namespace strata
