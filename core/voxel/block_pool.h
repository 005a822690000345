#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace strata {

/// Blocks of memory of one size. Thread-safe. The memory is the system's again only when the pool ends.
class BlockPool {
public:
    /// most_bytes  how much take_within gives
    BlockPool(size_t block_bytes, uint64_t most_bytes);
    ~BlockPool();

    size_t block_bytes() const { return block_bytes_; }
    /// A block, beyond the limit too.
    std::byte* take();
    /// A block, or nullptr where that would go beyond the limit.
    std::byte* take_within();
    void give_back(std::byte* block);

private:
    std::byte* take_locked();

    struct Slab {
        void* memory;
        size_t bytes;
    };

    size_t block_bytes_, slab_bytes_;
    uint64_t most_bytes_, used_bytes_ = 0;
    std::mutex mutex_;
    std::vector<Slab> slabs_;
    std::byte *next_ = nullptr, *slab_end_ = nullptr;  // of the last slab: what was never given
    std::vector<std::byte*> free_;
};

}  // namespace strata
