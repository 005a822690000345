#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/octree/node_sink.h"

namespace strata::copc {

/// The pages of a hierarchy, one behind the other.
struct HierarchyPages {
    std::vector<std::byte> bytes;
    uint64_t root_offset = 0, root_bytes = 0;  // of the root's page, in the file
};

/// A page holds four levels, and below them what is too little for a page of its own. The root's comes first, the others by level.
/// nodes   in any order, each with all that are above it; byte_offset counts from the file's begin. Branches without points are left out
/// offset  of the first page, in the file
/// source  COPC Specification 1.0, "hierarchy VLR"
HierarchyPages write_hierarchy(std::vector<BuiltNode> nodes, uint64_t offset);

}  // namespace strata::copc
