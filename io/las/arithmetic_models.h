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

/// Bytes that one symbol or up to 19 raw bits may take, at most.
inline constexpr size_t kBytesPerSymbol = 3;

/// Symbols from 0 to symbols - 1, at most MostSymbols of them, and how often each came so far.
/// Searched: symbols are looked for by their probability, as a decoder must. `first_` then says for the first probability of each
/// bucket which symbol it belongs to: nearly always that of the whole bucket.
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
        for (int s = 0; s < symbols; ++s) counts_[size_t(s)] = 1;
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
    static constexpr uint16_t kBeyond = Searched ? 0xFFFF : kMostSymbolCounts;
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
        [[maybe_unused]] size_t bucket = 0;
        for (size_t s = 0; s < symbols_; ++s) {
            const uint32_t below = (scale * sum) >> (31 - kSymbolProbabilityBits);
            below_[s] = uint16_t(below);
            // Buckets whose first probability is still below this symbol belong to the one before.
            if constexpr (Searched)
                for (; (uint32_t(bucket) << bucket_shift_) < below; ++bucket) first_[bucket] = Symbol(s - 1);
            sum += counts_[s];
        }
        if constexpr (Searched) {
            const size_t end = (size_t{1} << (kSymbolProbabilityBits - bucket_shift_)) + 1;
            for (; bucket < end; ++bucket) first_[bucket] = Symbol(symbols_ - 1);
        }
        below_[symbols_] = kBeyond;
    }

    uint16_t until_update_ = 0, cycle_ = 0, symbols_ = 0;
    uint8_t bucket_shift_ = 0;
    uint32_t total_ = 0;
    std::array<uint16_t, MostSymbols + 1> below_;  // probability of all smaller symbols, of 2^15; then one beyond all
    std::array<uint16_t, MostSymbols> counts_;
    std::array<Symbol, Searched ? kBucketRoom : 0> first_;
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
