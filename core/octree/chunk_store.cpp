#include "core/octree/chunk_store.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstring>

#include "core/error.h"

namespace strata {

Error changed_source() { return {ErrorKind::malformed, "the points changed between the first and the second reading"}; }

ChunkStore::ChunkStore(const Partition& partition, size_t record_size, ScratchStore* scratch)
    : record_size_(record_size), scratch_(scratch), begin_{0}, used_(new std::atomic<uint64_t>[partition.chunks().size()]()) {
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

std::span<std::byte> ChunkStore::load(uint32_t chunk, std::vector<std::byte>& buffer) {
    check_complete(chunk);
    const uint64_t size = begin_[chunk + 1] - begin_[chunk];
    if (!scratch_) return {memory_.get() + begin_[chunk], size};
    if (buffer.size() < size) buffer.resize(size);
    const std::span<std::byte> records = std::span(buffer).first(size);
    scratch_->read(begin_[chunk], records);
    return records;
}

void ChunkStore::check_complete(uint32_t chunk) const {
    if (used_[chunk] != begin_[chunk + 1] - begin_[chunk]) throw changed_source();
}

// body(offset, size) of ranges of whole records that are worth a read.
template <typename Body>
void ChunkStore::for_each_piece(uint32_t chunk, const Body& body) const {
    constexpr uint64_t kPieceBytes = 1 << 20;
    check_complete(chunk);
    const uint64_t step = std::max<uint64_t>(kPieceBytes / record_size_, 1) * record_size_;
    for (uint64_t at = begin_[chunk]; at < begin_[chunk + 1]; at += step) body(at, std::min(step, begin_[chunk + 1] - at));
}

void ChunkStore::visit(uint32_t chunk, const std::function<void(std::span<const std::byte>)>& visit) const {
    std::vector<std::byte> piece;
    for_each_piece(chunk, [&](uint64_t at, uint64_t size) {
        if (!scratch_) return visit({memory_.get() + at, size});
        piece.resize(size);
        scratch_->read(at, piece);
        visit(piece);
    });
}

void ChunkStore::change(uint32_t chunk, const std::function<void(std::span<std::byte>)>& change) {
    std::vector<std::byte> piece;
    for_each_piece(chunk, [&](uint64_t at, uint64_t size) {
        if (!scratch_) return change({memory_.get() + at, size});
        piece.resize(size);
        scratch_->read(at, piece);
        change(piece);
        scratch_->write(at, piece);
    });
}

void ChunkStore::discard(uint32_t chunk) {
    if (scratch_) return scratch_->discard(begin_[chunk], begin_[chunk + 1] - begin_[chunk]);
    // Whole pages within: the nodes that are written now take their place.
    constexpr uintptr_t kPage = 4096;
    const uintptr_t memory = reinterpret_cast<uintptr_t>(memory_.get());
    const uintptr_t first = (memory + begin_[chunk] + kPage - 1) / kPage * kPage, last = (memory + begin_[chunk + 1]) / kPage * kPage;
    if (first < last) ::madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED);
}

}  // namespace strata
