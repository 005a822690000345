#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "core/octree/scratch_store.h"
#include "core/voxel/block_pool.h"

namespace strata {

/// Where blocks go that have no room in memory: one behind the other.
class ScratchBlocks {
public:
    explicit ScratchBlocks(ScratchStore* store) : store_(store) {}

    bool present() const { return store_ != nullptr; }
    /// Returns where the bytes lie now.
    uint64_t write(std::span<const std::byte> bytes);
    void read(uint64_t offset, std::span<std::byte> out) const { store_->read(offset, out); }
    void discard(uint64_t offset, uint64_t size) { store_->discard(offset, size); }
    uint64_t written_bytes() const { return end_; }

private:
    ScratchStore* store_;
    std::atomic<uint64_t> end_ = 0;
};

/// Records, sorted into buckets by ranges of the code in their key, the first 8
/// bytes (voxel_record.h). Each bucket fills blocks of the pool; when the pool
/// has no more to give, full ones go to the scratch store.
class RecordBuckets {
public:
    /// first_codes  ascending, different, [0] is 0: bucket i holds codes from [i]
    /// to below [i + 1]
    RecordBuckets(std::vector<uint64_t> first_codes, size_t record_size, BlockPool& pool, ScratchBlocks& scratch);
    ~RecordBuckets();

    size_t size() const { return first_codes_.size(); }
    uint64_t first_code(size_t bucket) const { return first_codes_[bucket]; }
    uint64_t records(size_t bucket) const { return buckets_[bucket].records; }
    size_t block_records() const { return block_records_; }

    /// Adds records in ascending order. Thread-safe.
    void add(std::span<const std::byte> records);

    /// What add has put into a bucket, as blocks of block_records() records; the
    /// last may be shorter. Blocks from the scratch store are read into `buffer`.
    /// Valid until release.
    std::vector<const std::byte*> load(size_t bucket, std::vector<std::byte>& buffer) const;
    /// Calls visit with up to that many full blocks, evenly chosen, and with the
    /// last.
    void visit_some(size_t bucket, size_t most_blocks, const std::function<void(std::span<const std::byte> records)>& visit) const;
    /// Calls visit with one block after the other, and gives each back.
    void take(size_t bucket, const std::function<void(std::span<const std::byte> records)>& visit);
    void release(size_t bucket);

private:
    struct Bucket {
        std::mutex mutex;
        uint64_t records = 0;
        std::byte* open = nullptr;  // the last block, not full, or none
        size_t open_bytes = 0;
        std::vector<std::byte*> kept;   // full blocks
        std::vector<uint64_t> spilled;  // likewise: offsets in the scratch store
    };

    void append(Bucket& bucket, std::span<const std::byte> records);

    std::vector<uint64_t> first_codes_;
    size_t record_size_, block_records_;
    BlockPool& pool_;
    ScratchBlocks& scratch_;
    std::unique_ptr<Bucket[]> buckets_;
};

}  // namespace strata
