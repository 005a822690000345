#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
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

/// Raw bits are coded by 16 where they are more than these.
inline constexpr int kMostBitsAtOnce = 19;
/// Bytes that one symbol or as many raw bits may take, at most.
inline constexpr size_t kBytesPerSymbol = 3;

/// Symbols from 0 to symbols - 1, at most MostSymbols of them, and how often each came so far.
/// Searched: symbols are looked for by their probability, as a decoder must. `first_` then says for the first probability of each
/// bucket which symbol it belongs to: nearly always that of the whole bucket. Else all that is known of a symbol lies together.
template <int MostSymbols, bool Searched>
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
        for (size_t s = 0; s < symbols_; ++s) count(s) = 1;
        if constexpr (!Searched)
            for (size_t s = 0; s < symbols_; ++s) shares_[s].left_mask = s + 1 == symbols_ ? kMostSymbolCounts - 1 : 0;
        total_ = uint32_t(symbols);
        distribute();
        cycle_ = until_update_ = uint16_t((symbols + 6) / 2);
    }

private:
    friend class ArithmeticDecoder;
    friend class ArithmeticEncoder;

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

    struct Share {
        uint16_t below, size;  // probability of all smaller symbols, and of this one, of 2^15
        uint16_t left_mask;    // of the interval's bits: the last symbol has what dividing it by 2^15 leaves
        uint16_t count;
    };

    uint16_t& count(size_t s) {
        if constexpr (Searched)
            return counts_[s];
        else
            return shares_[s].count;
    }

    [[gnu::noinline]] void update() {
        total_ += cycle_;
        if (total_ > kMostSymbolCounts) {
            total_ = 0;
            for (size_t s = 0; s < symbols_; ++s) total_ += count(s) = uint16_t((count(s) + 1) / 2);
        }
        distribute();
        const uint32_t most = uint32_t(symbols_ + 6) * 8;
        const uint32_t next = uint32_t(cycle_) * 5 / 4;
        cycle_ = until_update_ = uint16_t(next < most ? next : most);
    }

    void distribute() {
        const uint32_t scale = 0x80000000u / total_;
        const auto probability = [&](uint32_t counts) { return (scale * counts) >> (31 - kSymbolProbabilityBits); };
        uint32_t sum = 0;
        if constexpr (Searched) {
            size_t bucket = 0;
            for (size_t s = 0; s < symbols_; ++s) {
                const uint32_t below = probability(sum);
                below_[s] = uint16_t(below);
                // Buckets whose first probability is still below this symbol belong to the one before.
                for (; (uint32_t(bucket) << bucket_shift_) < below; ++bucket) first_[bucket] = Symbol(s - 1);
                sum += counts_[s];
            }
            const size_t end = (size_t{1} << (kSymbolProbabilityBits - bucket_shift_)) + 1;
            for (; bucket < end; ++bucket) first_[bucket] = Symbol(symbols_ - 1);
            below_[symbols_] = kBeyond;
        } else {
            uint32_t below = 0;
            for (size_t s = 0; s < symbols_; ++s) {
                sum += shares_[s].count;
                const uint32_t end = s + 1 < symbols_ ? probability(sum) : kMostSymbolCounts;
                shares_[s].below = uint16_t(below);
                shares_[s].size = uint16_t(end - below);
                below = end;
            }
        }
    }

    uint16_t until_update_ = 0, cycle_ = 0, symbols_ = 0;
    uint8_t bucket_shift_ = 0;
    uint32_t total_ = 0;
    std::array<uint16_t, Searched ? MostSymbols + 1 : 0> below_;  // probability of all smaller symbols, of 2^15; then one beyond all
    std::array<uint16_t, Searched ? MostSymbols : 0> counts_;
    std::array<Symbol, Searched ? kBucketRoom : 0> first_;
    std::array<Share, Searched ? 0 : MostSymbols> shares_;
};

/// A symbol 0 or 1.
class BitModel {
private:
    friend class ArithmeticDecoder;
    friend class ArithmeticEncoder;

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

}  // namespace strata::las
