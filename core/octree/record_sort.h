#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/octree/octree_frame.h"

namespace strata {

/// Levels that one 64-bit code covers below a node.
inline constexpr uint32_t kCodeLevels = 21;

/// The octant digits of a point from `level` downwards: the digit of level + 1 is the highest of kCodeLevels triples.
uint64_t code_below(const OctreeFrame& frame, uint32_t level, const std::byte* record);

/// Brings records into the one order that depends on their content alone: by cell down to level 31, then by bytes.
/// records  [n * record_size]; replaced by the sorted ones. scratch: resized to the same, its content is lost
/// codes    receives code_below(level) of each sorted record
/// level    of the node that holds all the points
/// cost     O(n) for scanned data: one pass over all, then in-cache radix sorts; 16 bytes a point beside the arguments
void sort_records(const OctreeFrame& frame, uint32_t level, size_t record_size, std::vector<std::byte>& records,
                  std::vector<std::byte>& scratch, std::vector<uint64_t>& codes);

}  // namespace strata
