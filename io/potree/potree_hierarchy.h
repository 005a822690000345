#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/octree/node_key.h"

namespace strata {

inline constexpr size_t kHierarchyRecordBytes = 22;
/// The least cell that int32 coordinates can tell apart: a cube of 2^32 quanta divided 32 times.
inline constexpr uint32_t kDeepestLevel = 32;

/// Only `proxy` tells: PotreeConverter calls inner nodes leaves, so that the child mask alone says who has children.
enum class PotreeNodeType : uint8_t { inner = 0, leaf = 1, proxy = 2 };

/// One record of hierarchy.bin. A proxy stands for a node whose real record begins another chunk.
struct HierarchyRecord {
    PotreeNodeType type = PotreeNodeType::leaf;
    uint8_t child_mask = 0;  // bit i: child of octant i exists
    uint32_t points = 0;
    uint64_t byte_offset = 0;  // in octree.bin; of a proxy: in hierarchy.bin
    uint64_t byte_size = 0;
};

/// throws  Error{malformed} for an unknown type
HierarchyRecord parse_hierarchy_record(std::span<const std::byte, kHierarchyRecordBytes> bytes);

/// A record in its place in the tree.
struct ChunkNode {
    NodeKey key;
    HierarchyRecord record = {};
    uint32_t first_child = 0;  // index in the chunk; children are consecutive
    uint32_t child_count = 0;  // 0 for proxies
};

/// Parses one chunk: a root and what lies below it, breadth-first, children in the order of their octants.
/// root     key of the chunk's first record
/// returns  the nodes in the order of the file, never more than bytes.size() / 22
/// throws   Error{malformed} naming the node, when records and child masks do not match, a node with
///          points has no bytes, or levels exceed kDeepestLevel
std::vector<ChunkNode> parse_hierarchy_chunk(std::span<const std::byte> bytes, const NodeKey& root);

}  // namespace strata
