#include "core/voxel/record_buckets.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "core/voxel/voxel_record.h"

namespace strata {

uint64_t ScratchBlocks::write(std::span<const std::byte> bytes) {
    const uint64_t offset = end_.fetch_add(bytes.size());
    store_->write(offset, bytes);
    return offset;
}

RecordBuckets::RecordBuckets(std::vector<uint64_t> first_codes, size_t record_size, BlockPool& pool, ScratchBlocks& scratch)
    : first_codes_(std::move(first_codes)),
      record_size_(record_size),
      block_records_(std::bit_floor(pool.block_bytes() / record_size)),
      pool_(pool),
      scratch_(scratch),
      buckets_(new Bucket[first_codes_.size()]) {}

RecordBuckets::~RecordBuckets() {
    for (size_t i = 0; i < size(); ++i) release(i);
}

void RecordBuckets::add(std::span<const std::byte> records) {
    const std::byte* const data = records.data();
    const size_t n = records.size() / record_size_;
    const auto code_at = [&](size_t i) {
        uint64_t key;
        std::memcpy(&key, data + i * record_size_, sizeof key);
        return code_of_key(key);
    };
    for (size_t begin = 0; begin < n;) {
        const size_t bucket = size_t(std::upper_bound(first_codes_.begin(), first_codes_.end(), code_at(begin)) - first_codes_.begin()) - 1;
        size_t end = n;
        if (bucket + 1 < size()) {  // the first code that is not in the bucket: in
                                    // steps that double, then halve
            const uint64_t next = first_codes_[bucket + 1];
            size_t step = 1, below = begin;
            while (below + step < n && code_at(below + step) < next) {
                below += step;
                step *= 2;
            }
            end = std::min(below + step, n);
            while (end - below > 1) {
                const size_t middle = below + (end - below) / 2;
                (code_at(middle) < next ? below : end) = middle;
            }
        }
        append(buckets_[bucket], records.subspan(begin * record_size_, (end - begin) * record_size_));
        begin = end;
    }
}

void RecordBuckets::append(Bucket& bucket, std::span<const std::byte> records) {
    const size_t block_bytes = block_records_ * record_size_;
    const std::lock_guard lock(bucket.mutex);
    bucket.records += records.size() / record_size_;
    while (!records.empty()) {
        if (!bucket.open) bucket.open = pool_.take();
        const size_t count = std::min(block_bytes - bucket.open_bytes, records.size());
        std::memcpy(bucket.open + bucket.open_bytes, records.data(), count);
        bucket.open_bytes += count;
        records = records.subspan(count);
        if (bucket.open_bytes < block_bytes) return;
        std::byte* const next = scratch_.present() ? pool_.take_within() : pool_.take();
        if (next) {
            bucket.kept.push_back(bucket.open);
            bucket.open = next;
        } else {
            bucket.spilled.push_back(scratch_.write({bucket.open, block_bytes}));
        }
        bucket.open_bytes = 0;
    }
}

std::vector<const std::byte*> RecordBuckets::load(size_t index, std::vector<std::byte>& buffer) const {
    const Bucket& bucket = buckets_[index];
    const size_t block_bytes = block_records_ * record_size_;
    std::vector<const std::byte*> blocks(bucket.kept.begin(), bucket.kept.end());
    if (buffer.size() < bucket.spilled.size() * block_bytes) buffer.resize(bucket.spilled.size() * block_bytes);
    std::byte* to = buffer.data();
    for (const uint64_t offset : bucket.spilled) {
        scratch_.read(offset, {to, block_bytes});
        blocks.push_back(to);
        to += block_bytes;
    }
    if (bucket.open_bytes > 0) blocks.push_back(bucket.open);
    return blocks;
}

void RecordBuckets::visit_some(size_t index, size_t most_blocks, const std::function<void(std::span<const std::byte>)>& visit) const {
    const Bucket& bucket = buckets_[index];
    const size_t block_bytes = block_records_ * record_size_, full = bucket.kept.size() + bucket.spilled.size(),
                 count = std::min(full, most_blocks);
    std::vector<std::byte> buffer;
    for (size_t i = 0; i < count; ++i) {
        const size_t block = i * full / count;
        if (block < bucket.kept.size()) {
            visit({bucket.kept[block], block_bytes});
        } else {
            buffer.resize(block_bytes);
            scratch_.read(bucket.spilled[block - bucket.kept.size()], buffer);
            visit(buffer);
        }
    }
    if (bucket.open_bytes > 0) visit({bucket.open, bucket.open_bytes});
}

void RecordBuckets::take(size_t index, const std::function<void(std::span<const std::byte>)>& visit) {
    Bucket& bucket = buckets_[index];
    const size_t block_bytes = block_records_ * record_size_;
    if (bucket.open) {
        visit({bucket.open, bucket.open_bytes});
        pool_.give_back(std::exchange(bucket.open, nullptr));
        bucket.open_bytes = 0;
    }
    while (!bucket.kept.empty()) {
        visit({bucket.kept.back(), block_bytes});
        pool_.give_back(bucket.kept.back());
        bucket.kept.pop_back();
    }
    std::vector<std::byte> buffer(bucket.spilled.empty() ? 0 : block_bytes);
    for (const uint64_t offset : bucket.spilled) {
        scratch_.read(offset, buffer);
        visit(buffer);
        scratch_.discard(offset, block_bytes);
    }
    bucket.spilled.clear();
}

void RecordBuckets::release(size_t index) {
    Bucket& bucket = buckets_[index];
    for (std::byte* block : bucket.kept) pool_.give_back(block);
    if (bucket.open) pool_.give_back(bucket.open);
    for (const uint64_t offset : bucket.spilled) scratch_.discard(offset, block_records_ * record_size_);
    bucket.kept.clear();
    bucket.spilled.clear();
    bucket.open = nullptr;
    bucket.open_bytes = 0;
}

}  // namespace strata
