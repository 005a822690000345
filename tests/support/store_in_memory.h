#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <mutex>
#include <vector>

#include "core/octree/scratch_store.h"

namespace strata::test {

/// A scratch store whose bytes can be counted.
class StoreInMemory : public ScratchStore {
public:
    void write(uint64_t offset, std::span<const std::byte> bytes) override {
        const std::lock_guard lock(mutex_);
        bytes_.resize(std::max<size_t>(bytes_.size(), offset + bytes.size()));
        std::memcpy(bytes_.data() + offset, bytes.data(), bytes.size());
        written_ += bytes.size();
    }
    void read(uint64_t offset, std::span<std::byte> out) const override {
        const std::lock_guard lock(mutex_);
        std::memcpy(out.data(), bytes_.data() + offset, out.size());
    }
    void discard(uint64_t, uint64_t) override {}
    size_t size() const { return bytes_.size(); }
    uint64_t written() const { return written_; }  // in all, over others, too

private:
    mutable std::mutex mutex_;
    std::vector<std::byte> bytes_;
    uint64_t written_ = 0;
};

}  // namespace strata::test
