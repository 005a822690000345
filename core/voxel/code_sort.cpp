#include "core/voxel/code_sort.h"

#include <array>
#include <bit>
#include <utility>

namespace strata {

std::span<uint64_t> CodeSort::codes(size_t n) {
    size_ = n;
    if (words_.size() < n) {
        words_.resize(n);
        other_.resize(n);
    }
    return std::span(words_).first(n);
}

std::span<const uint64_t> CodeSort::sort() { return radix_sort(0); }

// Codes become words: the highest bits in which they differ, then the index. Returns whether that is all bits in which they differ.
bool CodeSort::pack() {
    uint64_t differing = 0;
    for (size_t i = 0; i < size_; ++i) differing |= words_[i] ^ words_[0];
    index_bits_ = std::bit_width(size_ > 0 ? size_ - 1 : 0);
    const int shift = std::countl_zero(differing | 1);
    for (size_t i = 0; i < size_; ++i) words_[i] = (words_[i] << shift & ~index_mask()) | i;
    // The words' highest bits are those that differ; what an index has pushed out is lost.
    return shift >= index_bits_ || (differing << shift & index_mask()) == 0;
}

// Least significant digit first, from lowest_bit up; digits that all share are passed over.
std::span<uint64_t> CodeSort::radix_sort(int lowest_bit) {
    constexpr int kDigitBits = 8, kBuckets = 1 << kDigitBits, kMostDigits = 64 / kDigitBits;
    std::span<uint64_t> from = std::span(words_).first(size_), to = std::span(other_).first(size_);
    constexpr size_t kSmall = 128;  // below, comparisons are quicker than histograms
    if (size_ < kSmall) {
        std::sort(from.begin(), from.end());
        return from;
    }
    uint64_t differing = 0;
    for (const uint64_t word : from) differing |= word ^ from[0];
    differing &= ~((uint64_t{1} << lowest_bit) - 1);
    if (differing == 0) return from;
    const int lowest = std::countr_zero(differing), digits = (std::bit_width(differing) - lowest + kDigitBits - 1) / kDigitBits;
    std::array<std::array<uint32_t, kBuckets>, kMostDigits> count{};
    for (const uint64_t word : from)
        for (int digit = 0; digit < digits; ++digit) ++count[size_t(digit)][word >> (lowest + kDigitBits * digit) & (kBuckets - 1)];
    for (int digit = 0; digit < digits; ++digit) {
        const int shift = lowest + kDigitBits * digit;
        std::array<uint32_t, kBuckets>& start = count[size_t(digit)];
        if (start[from[0] >> shift & (kBuckets - 1)] == size_) continue;
        uint32_t sum = 0;
        for (uint32_t& entry : start) sum += std::exchange(entry, sum);
        for (const uint64_t word : from) to[start[word >> shift & (kBuckets - 1)]++] = word;
        std::swap(from, to);
    }
    return from;
}

}  // namespace strata
