#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace strata::las {

// The entropy coder of LAZ: one 32-bit interval, adaptive models, bytes moved in as the interval shrinks.
// source  A. Said, "Introduction to Arithmetic Coding: Theory and Practice", HP Labs HPL-2004-76, with 15-bit symbol
//         probabilities and 13-bit bit probabilities
inline constexpr int kSymbolProbabilityBits = 15;
inline constexpr int kBitProbabilityBits = 13;
inline constexpr uint32_t kLeastInterval = 1u << 24;
inline constexpr uint32_t kMostSymbolCounts = 1u << kSymbolProbabilityBits;
inline constexpr uint32_t kMostBitCounts = 1u << kBitProbabilityBits;

/// Bytes that decoding one symbol or up to 19 raw bits may move in, at most; and those that are looked at before it is
/// known how many move in.
inline constexpr size_t kBytesPerSymbol = 3, kBytesAhead = 4;

/// Symbols from 0 to symbols - 1, at most MostSymbols of them, and how often each came so far.
/// `first_` says for the first probability of each bucket which symbol it belongs to: nearly always that of the whole bucket.
template <int MostSymbols>
class SymbolModel {
public:
    /// Makes the model new, and usable at all: every symbol equally likely.
    void restart() {
        static const SymbolModel fresh = [] {
            SymbolModel model;
            model.restart(MostSymbols);
            return model;
        }();
        *this = fresh;  // a copy costs a tenth of making one, and chunks may be small
    }
    void restart(int symbols) {
        symbols_ = uint16_t(symbols);
        bucket_shift_ = uint8_t(kSymbolProbabilityBits - bucket_bits(symbols));
        for (int s = 0; s < symbols; ++s) counts_[size_t(s)] = 1;
        total_ = uint32_t(symbols);
        distribute();
        cycle_ = until_update_ = uint16_t((symbols + 6) / 2);
    }

private:
    friend class ArithmeticDecoder;

    static constexpr int bucket_bits(int symbols) {
        if (symbols <= 4) return 5;
        if (symbols <= 16) return 6;
        if (symbols <= 64) return 7;
        return symbols <= 128 ? 8 : 9;
    }
    static constexpr size_t kBuckets = size_t{1} << bucket_bits(MostSymbols);
    // An interval is not a multiple of 2^15, so that its last probabilities lie a little beyond the last bucket.
    static constexpr size_t kBucketRoom = kBuckets + 1;
    static constexpr uint16_t kBeyond = 0xFFFF;
    using Symbol = std::conditional_t<(MostSymbols <= 256), uint8_t, uint16_t>;

    [[gnu::noinline]] void update() {
        total_ += cycle_;
        if (total_ > kMostSymbolCounts) {
            total_ = 0;
            for (size_t s = 0; s < symbols_; ++s) total_ += counts_[s] = uint16_t((counts_[s] + 1) / 2);
        }
        distribute();
        const uint32_t most = uint32_t(symbols_ + 6) * 8;
        const uint32_t next = uint32_t(cycle_) * 5 / 4;
        cycle_ = until_update_ = uint16_t(next < most ? next : most);
    }

    void distribute() {
        const uint32_t scale = 0x80000000u / total_;
        uint32_t sum = 0;
        size_t bucket = 0;
        for (size_t s = 0; s < symbols_; ++s) {
            const uint32_t below = (scale * sum) >> (31 - kSymbolProbabilityBits);
            below_[s] = uint16_t(below);
            // Buckets whose first probability is still below this symbol belong to the one before.
            for (; (uint32_t(bucket) << bucket_shift_) < below; ++bucket) first_[bucket] = Symbol(s - 1);
            sum += counts_[s];
        }
        const size_t end = (size_t{1} << (kSymbolProbabilityBits - bucket_shift_)) + 1;
        for (; bucket < end; ++bucket) first_[bucket] = Symbol(symbols_ - 1);
        below_[symbols_] = kBeyond;
    }

    uint16_t until_update_ = 0, cycle_ = 0, symbols_ = 0;
    uint8_t bucket_shift_ = 0;
    uint32_t total_ = 0;
    std::array<uint16_t, MostSymbols + 1> below_;  // probability of all smaller symbols, of 2^15; then one beyond all
    std::array<uint16_t, MostSymbols> counts_;
    std::array<Symbol, kBucketRoom> first_;
};

/// A symbol 0 or 1.
class BitModel {
private:
    friend class ArithmeticDecoder;

    void update() {
        total_ += cycle_;
        if (total_ > kMostBitCounts) {
            total_ = (total_ + 1) / 2;
            zeros_ = (zeros_ + 1) / 2;
            if (zeros_ == total_) ++total_;
        }
        const uint32_t scale = 0x80000000u / total_;
        zero_probability_ = (zeros_ * scale) >> (31 - kBitProbabilityBits);
        cycle_ = cycle_ * 5 / 4 < 64 ? cycle_ * 5 / 4 : 64;
        until_update_ = cycle_;
    }

    uint32_t zero_probability_ = 1u << (kBitProbabilityBits - 1);
    uint32_t zeros_ = 1, total_ = 2;
    uint32_t cycle_ = 4, until_update_ = 4;
};

/// Decodes symbols from bytes that it does not own. It never looks for their end: whoever holds it keeps
/// kBytesPerSymbol readable bytes ahead of `next` for each symbol decoded between two checks, and kBytesAhead more.
/// Every call keeps value < length, whatever the bytes are; that a symbol lies in its model's range follows from it.
class ArithmeticDecoder {
public:
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

    template <int N>
    [[gnu::always_inline]] uint32_t symbol(SymbolModel<N>& model) {
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

    [[gnu::always_inline]] uint32_t bit(BitModel& model) {
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
    uint32_t raw_bits(int count) {
        if (count > 19) {
            const uint32_t lower = raw_bits(16);
            return raw_bits(count - 16) << 16 | lower;
        }
        length_ >>= count;
        const uint32_t bits = value_ / length_;
        value_ -= bits * length_;
        renormalize();
        if (bits >> count) ok_ = false;
        return bits & ((1u << count) - 1);
    }
    uint64_t raw_bits_64() {
        const uint64_t lower = raw_bits(32);
        return uint64_t(raw_bits(32)) << 32 | lower;
    }

private:
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
