#pragma once

#include <cstring>
#include <mutex>
#include <vector>

#include "core/octree/scratch_store.h"

namespace strata {

/// A scratch store in memory, that knows how much was written.
struct MemoryStore : ScratchStore {
    std::vector<std::byte> bytes;
    mutable std::mutex mutex;
    uint64_t written = 0;

    void write(uint64_t offset, std::span<const std::byte> from) override {
        const std::lock_guard lock(mutex);
        if (bytes.size() < offset + from.size()) bytes.resize(offset + from.size());
        std::memcpy(bytes.data() + offset, from.data(), from.size());
        written += from.size();
    }
    void read(uint64_t offset, std::span<std::byte> out) const override {
        const std::lock_guard lock(mutex);
        std::memcpy(out.data(), bytes.data() + offset, out.size());
    }
    void discard(uint64_t, uint64_t) override {}
};

}  // namespace strata
