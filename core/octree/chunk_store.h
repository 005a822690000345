#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/octree/partition.h"
#include "core/octree/scratch_store.h"

namespace strata {

/// For a source that gives other points, or other counts, when it is read again.
Error changed_source();

/// The points sorted into chunks, each at its own range of one block of memory or of one scratch store. The counts are
/// exact, so nothing is wasted and nothing moves. Records of a chunk arrive in any order.
class ChunkStore {
public:
    /// scratch  nullptr: keep the records in memory
    ChunkStore(const Partition& partition, size_t record_size, ScratchStore* scratch);

    /// Adds records to a chunk. Thread-safe. throws Error{malformed} when there are more than were counted
    void add(uint32_t chunk, std::span<const std::byte> records);
    /// A whole chunk, to be changed at will: where it lies in memory, else read into `buffer`.
    /// throws Error{malformed} when there are fewer records than were counted
    std::span<std::byte> load(uint32_t chunk, std::vector<std::byte>& buffer);
    /// Calls visit for all records of a chunk, piece after piece. throws as load does
    void visit(uint32_t chunk, const std::function<void(std::span<const std::byte> records)>& visit) const;
    /// The same, to change attributes. Others may visit the chunk meanwhile, if they look at what stays.
    void change(uint32_t chunk, const std::function<void(std::span<std::byte> records)>& change);
    /// Gives the room of a chunk back: it will not be looked at again.
    void discard(uint32_t chunk);

    uint64_t size_bytes() const { return begin_.back(); }

private:
    void check_complete(uint32_t chunk) const;
    template <typename Body>
    void for_each_piece(uint32_t chunk, const Body& body) const;

    size_t record_size_;
    ScratchStore* scratch_;
    std::vector<uint64_t> begin_;                     // [chunks + 1] bytes
    std::unique_ptr<std::atomic<uint64_t>[]> used_;   // [chunks] bytes
    std::unique_ptr<std::byte[]> memory_;
};

}  // namespace strata
