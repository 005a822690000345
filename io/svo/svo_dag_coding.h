#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace strata::svo {

// How a DAG is stored: it is read whole, so that its arrays need not keep a fixed width.

/// Masks without the bytes of them that are 0: of each a byte that says which of its eight are not, then those. Few leaves of a surface have all.
std::vector<uint8_t> encode_masks(std::span<const uint64_t> masks);

/// The inverse.
/// throws  Error{malformed}: the bytes end within a mask, or one that should not be is 0
std::vector<uint64_t> decode_masks(std::span<const uint8_t> bytes, const std::string& place);

/// The pointers of a DAG's level as a file has them: as nodes come in the order in which they first occur, a bit tells that of a node that did
/// not occur before, and others take only as many bits as there are nodes that did.
/// pointers  each is at most one more than the largest before it; the first is 0
std::vector<uint8_t> encode_pointers(std::span<const uint32_t> pointers);

/// The inverse.
/// place   for messages
/// throws  Error{malformed}: not `count` pointers, or bits left over
std::vector<uint32_t> decode_pointers(std::span<const uint8_t> bytes, uint64_t count, const std::string& place);

}  // namespace strata::svo
