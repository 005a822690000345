#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "core/voxel/voxel_block.h"
#include "core/voxel/voxel_frame.h"

namespace strata {

/// What voxels, or the cells of a coarser depth, are beside occupied: an entry a cell, in Morton order. Empty: unknown.
struct CellAttributes {
    std::vector<uint32_t> counts;
    std::vector<VoxelColor> colors;
    std::vector<VoxelNormal> normals;
    std::vector<std::array<uint8_t, 3>> opacities;  // along x, y, z; 255: opaque
};

/// One level of a sparse voxel octree, two depths at once: an entry a node, in Morton order, breadth-first.
/// A node of level l is a mask of 4^3 cells at depth 2 l + 2 of the octree; its bytes, those not 0, are cells at depth 2 l + 1.
struct VoxelLevel {
    std::vector<uint64_t> masks;        // [nodes]
    std::vector<uint64_t> full;         // [nodes] cells wholly occupied, which have no node below; empty: there are none
    std::vector<uint32_t> first_child;  // [nodes] the node of the next level that is the child of the lowest bit of mask & ~full; empty for the last level

    uint64_t full_mask(size_t node) const { return full.empty() ? 0 : full[node]; }
    /// Of a bit of mask & ~full.
    uint32_t child(size_t node, int bit) const {
        return first_child[node] + uint32_t(std::popcount(masks[node] & ~full_mask(node) & ((uint64_t{1} << bit) - 1)));
    }
};

/// Sparse voxel octree in memory: occupancy by masks with rank addressing, attributes beside. Levels from the root, which is one
/// node; the last level's cells are voxels. Every depth is a valid, coarser model. May hold fewer levels than its frame has: then
/// the cells of the last one are coarser, and `full` cells are whole at any depth.
struct VoxelTree {
    VoxelFrame frame;
    std::vector<VoxelLevel> levels;          // at most frame.levels
    std::vector<CellAttributes> attributes;  // [1 + 2 levels] by depth, [0] unused; or empty
    // Number of cells before each node's own, by level, at depth 2 l + 1 and 2 l + 2: where its attributes begin. Only with attributes.
    std::vector<std::vector<uint32_t>> cells_before_odd, cells_before_even;

    bool empty() const { return levels.empty() || levels[0].masks.empty(); }
    int depth() const { return 2 * int(levels.size()); }  // of the finest cells here
};

/// Bit k is set where byte k of the mask is not 0.
constexpr uint32_t bytes_present(uint64_t mask) {
    mask |= mask >> 4;
    mask |= mask >> 2;
    mask |= mask >> 1;
    mask &= 0x0101010101010101;
    return uint32_t(mask * 0x0102040810204080 >> 56);
}

/// Index among the cells of depth 2 level + 2, or + 1 for `odd`, of the cell at a bit of a node's mask.
inline uint32_t cell_index(const VoxelTree& tree, int level, uint32_t node, int bit, bool odd) {
    const uint64_t mask = tree.levels[size_t(level)].masks[node];
    if (odd) return tree.cells_before_odd[size_t(level)][node] + uint32_t(std::popcount(bytes_present(mask) & ((1u << (bit >> 3)) - 1)));
    return tree.cells_before_even[size_t(level)][node] + uint32_t(std::popcount(mask & ((uint64_t{1} << bit) - 1)));
}

/// Fills first_child of every level from its masks, and cells_before where there are attributes.
/// throws  Error{malformed}: a mask of 0, full cells that are not in the mask, a level with another number of nodes than the one
///         above has children, or more than 2^32 - 1 cells
void index_tree(VoxelTree& tree);

/// throws  Error{malformed}: attributes are neither empty nor one a cell, of a depth at which there are cells
void check_attributes(const VoxelTree& tree);

/// Voxels of the tree's last level; full cells count all that they hold.
uint64_t count_voxels(const VoxelTree& tree);

/// Whether a voxel is occupied, for tests and single questions.
/// x, y, z  below frame.side()
bool is_occupied(const VoxelTree& tree, uint32_t x, uint32_t y, uint32_t z);

}  // namespace strata
