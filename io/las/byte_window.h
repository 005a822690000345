#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "io/byte_source.h"

namespace strata::las {

/// A range of a source that is read from front to back through a buffer of bounded size. Its reader may run ahead by
/// `margin` bytes between two looks at limit(); behind the end of the range it finds zeros there.
class ByteWindow {
public:
    /// first  bytes that the first look is likely to take; more are read as they are needed
    void open(const ByteSource& source, uint64_t begin, uint64_t end, size_t margin, uint64_t first = UINT64_MAX);

    const std::byte* begin() const { return bytes_.data(); }
    /// A reader beyond it must call advance.
    const std::byte* limit() const { return bytes_.data() + limit_; }
    /// Moves on so that the byte at `next` is the first of the buffer, and returns its new place.
    /// throws  Error{malformed}: "byte N: ...", `next` is behind the end of the range
    const std::byte* advance(const std::byte* next);

    /// Throws what advance throws, and does nothing else.
    void check(const std::byte* next) const;
    uint64_t offset_of(const std::byte* next) const { return offset_ + uint64_t(next - bytes_.data()); }
    uint64_t end() const { return end_; }

private:
    void fill(size_t kept, uint64_t most);

    const ByteSource* source_ = nullptr;
    uint64_t offset_ = 0, end_ = 0;  // of the buffer's first byte and behind the range, in the source
    size_t margin_ = 0;
    std::vector<std::byte> bytes_;
    size_t limit_ = 0;
};

}  // namespace strata::las
