#pragma once

#include <cstdint>
#include <utility>

#include "core/octree/scratch_store.h"

namespace strata {

/// Hands out ranges of a scratch store that several share.
class ScratchRoom {
public:
    explicit ScratchRoom(ScratchStore& store) : store_(store) {}
    ScratchStore& store() { return store_; }
    /// The offset of so many bytes.
    uint64_t take(uint64_t bytes) { return std::exchange(next_, next_ + bytes); }

private:
    ScratchStore& store_;
    uint64_t next_ = 0;
};

}  // namespace strata
