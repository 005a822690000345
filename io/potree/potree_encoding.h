#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/cloud/attribute.h"

namespace strata {

/// Appends the BROTLI form of a node: structure of arrays, positions and rgb as Morton codes, points in the order of
/// their codes, one Brotli stream.
/// records     [n] int32 x, y, z >= 0, then the attributes, packed
/// quality     of the Brotli encoder, 0 ... 11
/// throws      Error{limit} when the encoder fails (it runs out of memory)
void append_brotli_node(std::span<const std::byte> records, size_t points, const std::vector<Attribute>& attributes, int quality,
                        std::vector<std::byte>& out);

}  // namespace strata
