#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/octree/node_sink.h"

namespace strata {

/// The content of hierarchy.bin and what metadata.json says of it.
struct PotreeHierarchyFile {
    std::vector<std::byte> bytes;
    uint64_t first_chunk_bytes = 0;
    uint32_t depth = 0;  // level of the deepest node
};

inline constexpr uint32_t kHierarchyStep = 4;  // levels from a chunk's root to the proxies in it

/// Nodes without points and without descendants are left out, except the root.
/// nodes  every node, in any order, byte offsets into octree.bin; every parent is among them
PotreeHierarchyFile write_potree_hierarchy(std::vector<BuiltNode> nodes);

}  // namespace strata
