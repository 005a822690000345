#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "io/las/arithmetic_models.h"

namespace strata::las {

/// Bytes that are looked at before it is known how many move in.
inline constexpr size_t kBytesAhead = 4;

/// Decodes symbols from bytes that it does not own. It never looks for their end: whoever holds it keeps
/// kBytesPerSymbol readable bytes ahead of `next` for each symbol decoded between two checks, and kBytesAhead more.
/// Every call keeps value < length, whatever the bytes are; that a symbol lies in its model's range follows from it.
class ArithmeticDecoder {
public:
    static constexpr bool kEncodes = false;
    template <int MostSymbols>
    using Symbols = SymbolModel<MostSymbols, true>;

    ArithmeticDecoder() = default;
    /// Takes the first 4 bytes. After bytes that no encoder writes, ok() is false.
    explicit ArithmeticDecoder(const std::byte* bytes) : next_(bytes) {
        for (int i = 0; i < 4; ++i) value_ = value_ << 8 | std::to_integer<uint32_t>(*next_++);
        if (value_ == length_) {
            value_ = 0;
            ok_ = false;
        }
    }

    const std::byte* next() const { return next_; }
    void set_next(const std::byte* next) { next_ = next; }
    /// False after what a sound stream cannot hold.
    bool ok() const { return ok_; }

    // The last argument of these is what an encoder is told; here it is ignored.

    template <int N>
    [[gnu::always_inline]] uint32_t symbol(Symbols<N>& model, uint32_t = 0) {
        const uint32_t whole = length_;
        length_ >>= kSymbolProbabilityBits;
        const uint32_t probability = value_ / length_;
        size_t s = model.first_[probability >> model.bucket_shift_];
        while (model.below_[s + 1] <= probability) ++s;
        const uint32_t low = model.below_[s] * length_;
        // A choice without a branch: of two symbols, the last is as likely as the other.
        const uint32_t is_last = -uint32_t(s + 1 == model.symbols_);
        const uint32_t high = (model.below_[s + 1] * length_ & ~is_last) | (whole & is_last);
        value_ -= low;
        length_ = high - low;
        renormalize();
        ++model.counts_[s];
        if (--model.until_update_ == 0) model.update();
        return uint32_t(s);
    }

    [[gnu::always_inline]] uint32_t bit(BitModel& model, uint32_t = 0) {
        const uint32_t split = model.zero_probability_ * (length_ >> kBitProbabilityBits);
        const bool one = value_ >= split;
        if (one) {
            value_ -= split;
            length_ -= split;
        } else {
            length_ = split;
            ++model.zeros_;
        }
        renormalize();
        if (--model.until_update_ == 0) model.update();
        return one;
    }

    /// 1 to 32 bits, all equally likely.
    [[gnu::always_inline]] uint32_t raw_bits(int count, uint32_t = 0) {
        if (count <= kMostBitsAtOnce) return raw_bits_at_once(count);
        const uint32_t lower = raw_bits_at_once(16);
        return raw_bits_at_once(count - 16) << 16 | lower;
    }
    uint64_t raw_bits_64(uint64_t = 0) {
        const uint64_t lower = raw_bits(32);
        return uint64_t(raw_bits(32)) << 32 | lower;
    }

private:
    [[gnu::always_inline]] uint32_t raw_bits_at_once(int count) {
        length_ >>= count;
        const uint32_t bits = value_ / length_;
        value_ -= bits * length_;
        renormalize();
        if (bits >> count) ok_ = false;
        return bits & ((1u << count) - 1);
    }

    // How many bytes move in is as good as random: without a branch, none is mispredicted.
    [[gnu::always_inline]] void renormalize() {
        const int bits = std::countl_zero(length_) & ~7;
        uint32_t ahead;
        std::memcpy(&ahead, next_, sizeof ahead);
        value_ = uint32_t((uint64_t(value_) << 32 | __builtin_bswap32(ahead)) << bits >> 32);
        length_ <<= bits;
        next_ += bits >> 3;
    }

    const std::byte* next_ = nullptr;
    uint32_t value_ = 0;
    uint32_t length_ = 0xFFFFFFFF;
    bool ok_ = true;
};

}  // namespace strata::las
