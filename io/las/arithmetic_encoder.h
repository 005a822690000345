#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "io/las/arithmetic_models.h"

namespace strata::las {

/// Encodes symbols into bytes that it does not own. It never looks for their end: whoever holds it keeps kBytesPerSymbol of room
/// behind `next` for each symbol encoded between two looks, kBytesBehind more, and kBytesBefore ahead of the first byte.
/// It returns what it is told to encode, so that it can stand where a decoder stands.
class ArithmeticEncoder {
public:
    static constexpr bool kEncodes = true;
    template <int MostSymbols>
    using Symbols = SymbolModel<MostSymbols, false>;

    static constexpr size_t kBytesBefore = 4, kBytesBehind = 8;

    ArithmeticEncoder() = default;
    explicit ArithmeticEncoder(std::byte* bytes) : next_(bytes) {}

    std::byte* next() const { return next_; }
    void set_next(std::byte* next) { next_ = next; }

    template <int N>
    [[gnu::always_inline]] uint32_t symbol(Symbols<N>& model, uint32_t s) {
        auto& share = model.shares_[s];
        const uint32_t left = length_ & share.left_mask;
        length_ >>= kSymbolProbabilityBits;
        add(share.below * length_);
        length_ = share.size * length_ + left;
        renormalize();
        ++share.count;
        if (--model.until_update_ == 0) model.update();
        return s;
    }

    [[gnu::always_inline]] uint32_t bit(BitModel& model, uint32_t one) {
        const uint32_t split = model.zero_probability_ * (length_ >> kBitProbabilityBits);
        add(one ? split : 0);
        length_ = one ? length_ - split : split;
        model.zeros_ += 1 - one;
        renormalize();
        if (--model.until_update_ == 0) model.update();
        return one;
    }

    /// 1 to 32 bits, all equally likely.
    [[gnu::always_inline]] uint32_t raw_bits(int count, uint32_t bits) {
        if (count <= kMostBitsAtOnce) {
            raw_bits_at_once(count, bits);
        } else {
            raw_bits_at_once(16, bits & 0xFFFF);
            raw_bits_at_once(count - 16, bits >> 16);
        }
        return bits;
    }
    uint64_t raw_bits_64(uint64_t bits) {
        raw_bits(32, uint32_t(bits));
        raw_bits(32, uint32_t(bits >> 32));
        return bits;
    }

    /// Ends the stream and returns the byte behind it. Zeros follow up to where a decoder looks.
    std::byte* finish() {
        const bool wide = length_ > 2 * kLeastInterval;
        add(wide ? kLeastInterval : kLeastInterval / 2);
        write();
        const size_t kept = wide ? 1 : 2, zeros = wide ? 3 : 2;
        std::memset(next_ + kept, 0, zeros);
        return next_ += kept + zeros;
    }

private:
    [[gnu::always_inline]] void raw_bits_at_once(int count, uint32_t bits) {
        length_ >>= count;
        add(bits * length_);
        renormalize();
    }

    // The upper half of low_ are the last four bytes, which may still change; a carry beyond them is a rare thing.
    [[gnu::always_inline]] void add(uint32_t amount) {
        low_ += amount;
        if (low_ < amount) [[unlikely]]
            carry(next_ - kBytesBefore);
    }
    [[gnu::noinline, gnu::cold]] static void carry(std::byte* byte) {
        do --byte;
        while ((*byte = std::byte(std::to_integer<uint8_t>(*byte) + 1)) == std::byte{0});
    }

    [[gnu::always_inline]] void write() {
        const uint64_t bytes = __builtin_bswap64(low_);
        std::memcpy(next_ - kBytesBefore, &bytes, sizeof bytes);
    }

    // How many bytes are done with is as good as random: without a branch, none is mispredicted.
    [[gnu::always_inline]] void renormalize() {
        write();
        const int bits = __builtin_clz(length_) & ~7;  // no interval is empty
        low_ <<= bits;
        length_ <<= bits;
        next_ += bits >> 3;
    }

    std::byte* next_ = nullptr;
    uint64_t low_ = 0;
    uint32_t length_ = 0xFFFFFFFF;
};

}  // namespace strata::las
