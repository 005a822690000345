#include "core/octree/chunk_store.h"

#include <cstring>

#include "core/error.h"

namespace strata {

Error changed_source() { return {ErrorKind::malformed, "the points changed between the first and the second reading"}; }

ChunkStore::ChunkStore(const Partition& partition, size_t record_size, ScratchStore* scratch)
    : scratch_(scratch), begin_{0}, used_(new std::atomic<uint64_t>[partition.chunks().size()]()) {
    for (const Partition::Chunk& chunk : partition.chunks()) begin_.push_back(begin_.back() + chunk.points * record_size);
    if (!scratch_) memory_ = std::make_unique_for_overwrite<std::byte[]>(begin_.back());
}

void ChunkStore::add(uint32_t chunk, std::span<const std::byte> records) {
    const uint64_t at = used_[chunk].fetch_add(records.size());
    if (at + records.size() > begin_[chunk + 1] - begin_[chunk]) throw changed_source();
    if (scratch_)
        scratch_->write(begin_[chunk] + at, records);
    else
        std::memcpy(memory_.get() + begin_[chunk] + at, records.data(), records.size());
}

void ChunkStore::load(uint32_t chunk, std::vector<std::byte>& records) const {
    if (used_[chunk] != begin_[chunk + 1] - begin_[chunk]) throw changed_source();
    records.resize(used_[chunk]);
    if (scratch_)
        scratch_->read(begin_[chunk], records);
    else
        std::memcpy(records.data(), memory_.get() + begin_[chunk], records.size());
}

void ChunkStore::discard(uint32_t chunk) {
    if (scratch_) scratch_->discard(begin_[chunk], begin_[chunk + 1] - begin_[chunk]);
}

}  // namespace strata
