#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "io/las/arithmetic_encoder.h"

namespace strata::las {

/// The bytes that an encoder writes, from one stream to the next in the same memory.
class CodedBytes {
public:
    /// An encoder at the begin of a stream, without room.
    ArithmeticEncoder begin() {
        if (bytes_.empty()) bytes_.resize(kAround);
        return ArithmeticEncoder(bytes_.data() + ArithmeticEncoder::kBytesBefore);
    }
    /// Room for `most` bytes from where the encoder is, which may move it to other memory.
    void make_room(ArithmeticEncoder& encoder, size_t most) {
        const size_t used = size_t(encoder.next() - bytes_.data()), needed = used + most + ArithmeticEncoder::kBytesBehind;
        if (bytes_.size() >= needed) return;
        bytes_.resize(2 * needed);
        encoder.set_next(bytes_.data() + used);
    }
    /// Ends the stream. What it returns lives until the next begins.
    std::span<const std::byte> finish(ArithmeticEncoder& encoder) {
        const std::byte* const begin = bytes_.data() + ArithmeticEncoder::kBytesBefore;
        return {begin, encoder.finish()};
    }

private:
    static constexpr size_t kAround = ArithmeticEncoder::kBytesBefore + ArithmeticEncoder::kBytesBehind;

    std::vector<std::byte> bytes_;
};

}  // namespace strata::las
