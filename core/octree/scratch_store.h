#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace strata {

/// Room on disk for what does not fit in memory: one flat range of bytes. core reaches disk only through this; io
/// implements it with an unnamed file, which vanishes however the program ends. Safe from several threads.
class ScratchStore {
public:
    virtual ~ScratchStore() = default;

    virtual void write(uint64_t offset, std::span<const std::byte> bytes) = 0;
    virtual void read(uint64_t offset, std::span<std::byte> out) const = 0;
    /// The range will not be read again; its disk space may be given back.
    virtual void discard(uint64_t offset, uint64_t size) = 0;
};

}  // namespace strata
