#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "core/voxel/voxel_tree.h"

namespace strata {

/// Numbers of a fixed width of 0 to 32 bits, one after the other from the lowest bit of the first byte on; 8 bytes of 0 follow, so that
/// each can be read as part of a word.
struct PackedNumbers {
    int width = 0;
    std::vector<uint8_t> bytes;

    static uint64_t size_bytes(uint64_t count, int width) { return (count * uint64_t(width) + 7) / 8 + 8; }
    uint32_t operator[](uint64_t i) const {
        const uint64_t bit = i * uint64_t(width);
        uint64_t word;
        std::memcpy(&word, bytes.data() + (bit >> 3), sizeof word);
        return uint32_t(word >> (bit & 7) & ((uint64_t{1} << width) - 1));
    }
    bool operator==(const PackedNumbers&) const = default;
};

PackedNumbers pack_numbers(std::span<const uint32_t> numbers);

/// One level of different nodes, in the order in which they first occur in a tree. A pointer for each cell of mask & ~full, by rank, says
/// which node of the next level it is.
struct DagLevel {
    std::vector<uint64_t> masks;          // [nodes], as in VoxelLevel
    std::vector<uint64_t> full;           // [nodes] or empty
    PackedNumbers pointers;               // of all nodes, one after the other; of the last level none
    std::vector<uint32_t> first_pointer;  // [nodes] follows from the masks; empty for the last level

    uint64_t full_mask(size_t node) const { return full.empty() ? 0 : full[node]; }
    /// Of a bit of mask & ~full.
    uint32_t child(size_t node, int bit) const {
        return pointers[first_pointer[node] + uint32_t(std::popcount(masks[node] & ~full_mask(node) & ((uint64_t{1} << bit) - 1)))];
    }
    bool operator==(const DagLevel&) const = default;
};

/// A sparse voxel octree whose identical subtrees are one: only what is occupied, no attributes. Pointers lead from a level to the
/// next, so there are no cycles. Rays find the same cells as in the tree.
/// source  V. Kämpe, E. Sintorn, U. Assarsson, "High Resolution Sparse Voxel DAGs", SIGGRAPH 2013
struct VoxelDag {
    VoxelFrame frame;
    std::vector<DagLevel> levels;  // from the root, which is one node

    bool empty() const { return levels.empty() || levels[0].masks.empty(); }
};

/// The DAG of a tree's occupancy.
/// cost  O(nodes) time; beside tree and DAG 4 bytes a node of two neighboring levels, and 4 bytes a pointer and 8 to 16 a node of one
///       level of the DAG
VoxelDag dag_of(const VoxelTree& tree);

/// Fills first_pointer of every level from its masks, and holds what was read from elsewhere to what a DAG is.
/// throws  Error{malformed}: not one root, more levels than the frame has, a mask of 0, full cells that are not in the mask, an array
///         that has another length than the masks ask for, or a pointer beyond the next level
void index_dag(VoxelDag& dag);

/// What sharing gained, of one level.
struct DagLevelCounts {
    uint64_t nodes = 0;       // different ones
    uint64_t tree_nodes = 0;  // of the tree; at most 2^64 - 1, as all these counts
    uint64_t bytes = 0;       // of the DAG's arrays without first_pointer
};

std::vector<DagLevelCounts> count_dag(const VoxelDag& dag);

/// Voxels; full cells count all that they hold.
uint64_t count_voxels(const VoxelDag& dag);

/// The tree whose DAG this is, without attributes.
/// throws  Error{limit}: it would have more than `most_nodes` nodes
VoxelTree expand(const VoxelDag& dag, uint64_t most_nodes);

}  // namespace strata
