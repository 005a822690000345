#include "core/voxel/block_pool.h"

#include <sys/mman.h>

#include <algorithm>
#include <new>

namespace strata {
namespace {

constexpr size_t kHugePage = size_t{2} << 20;

}  // namespace

BlockPool::BlockPool(size_t block_bytes, uint64_t most_bytes)
    : block_bytes_(block_bytes),
      slab_bytes_(std::max(block_bytes, size_t(std::clamp<uint64_t>(most_bytes / 16, 256 * 1024, 8 * kHugePage)))),
      most_bytes_(most_bytes) {}

BlockPool::~BlockPool() {
    for (const Slab& slab : slabs_) ::munmap(slab.memory, slab.bytes);
}

std::byte* BlockPool::take_locked() {
    used_bytes_ += block_bytes_;
    if (!free_.empty()) {
        std::byte* block = free_.back();
        free_.pop_back();
        return block;
    }
    if (size_t(slab_end_ - next_) < block_bytes_) {
        slabs_.reserve(slabs_.size() + 1);
        free_.reserve((slabs_.size() + 1) * (slab_bytes_ / block_bytes_));  // so that giving back needs no memory
        void* memory = ::mmap(nullptr, slab_bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (memory == MAP_FAILED) throw std::bad_alloc();
        // Pages of 4 KB would cost as much time as the records themselves.
        if (slab_bytes_ >= kHugePage) (void)::madvise(memory, slab_bytes_, MADV_HUGEPAGE);
        slabs_.push_back({memory, slab_bytes_});
        next_ = static_cast<std::byte*>(memory);
        slab_end_ = next_ + slab_bytes_;
    }
    std::byte* block = next_;
    next_ += block_bytes_;
    return block;
}

std::byte* BlockPool::take() {
    const std::lock_guard lock(mutex_);
    return take_locked();
}

std::byte* BlockPool::take_within() {
    const std::lock_guard lock(mutex_);
    return used_bytes_ + block_bytes_ <= most_bytes_ ? take_locked() : nullptr;
}

void BlockPool::give_back(std::byte* block) {
    const std::lock_guard lock(mutex_);
    used_bytes_ -= block_bytes_;
    free_.push_back(block);
}

}  // namespace strata
