#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/octree/octree_frame.h"

namespace strata {

/// Finds the one order of records that depends on their content alone: by cell down to level 31, then by bytes.
/// The records themselves stay where they are. Keeps its buffers; one per thread.
class RecordSort {
public:
    explicit RecordSort(const OctreeFrame& frame) : frame_(frame) {}

    /// records  [n * record_size], all in the cube of a node of `level`
    /// returns  [n] indices of records in their order; valid until the next call
    /// cost     O(n) for scanned data: one pass over all, then radix sorts that stay in the cache; 20 bytes a point
    std::span<const uint32_t> operator()(uint32_t level, std::span<const std::byte> records, size_t record_size);

private:
    uint64_t pack(uint32_t level, std::span<const std::byte> records, size_t record_size);
    void radix_sort(std::span<uint64_t> words, std::span<uint64_t> other);

    OctreeFrame frame_;
    std::vector<uint64_t> words_, other_;  // the highest bits that differ of a cell's code, then the record's index
    std::vector<uint32_t> order_;
};

}  // namespace strata
