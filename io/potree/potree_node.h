#pragma once

#include <cstdint>
#include <span>

#include "core/cloud/point_batch.h"
#include "io/potree/potree_metadata.h"

namespace strata {

inline constexpr uint64_t kMostNodeBytes = uint64_t{1} << 29;  // decoded; 10^7 coincident points fit

/// Decodes the points of one node.
/// stored  the node's range of octree.bin, whole
/// points  as the hierarchy states; checked against the bytes, and believed only as far as bytes come
/// wanted  indices into metadata.attributes
/// throws  Error{malformed, limit} without naming file or node
void decode_potree_node(const PotreeMetadata& metadata, std::span<const std::byte> stored, uint64_t points,
                        std::span<const int> wanted, PointBatch& out);

}  // namespace strata
