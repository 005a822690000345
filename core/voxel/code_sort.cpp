#include "core/voxel/code_sort.h"

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
    // Fewer passes are worth more than destinations that all fit into the nearest cache.
    constexpr int kMostDigitBits = 11;
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
    const int lowest = std::countr_zero(differing), bits = std::bit_width(differing) - lowest;
    const int most_digit_bits = size_ < 4096 ? 8 : kMostDigitBits;
    const int digits = (bits + most_digit_bits - 1) / most_digit_bits, digit_bits = (bits + digits - 1) / digits;
    const uint64_t mask = (uint64_t{1} << digit_bits) - 1;
    counts_.assign(size_t(digits) << digit_bits, 0);
    for (const uint64_t word : from)
        for (int digit = 0; digit < digits; ++digit)
            ++counts_[size_t(digit) << digit_bits | (word >> (lowest + digit_bits * digit) & mask)];
    for (int digit = 0; digit < digits; ++digit) {
        const int shift = lowest + digit_bits * digit;
        uint32_t* const start = counts_.data() + (size_t(digit) << digit_bits);
        if (start[from[0] >> shift & mask] == size_) continue;
        uint32_t sum = 0;
        for (uint64_t i = 0; i <= mask; ++i) sum += std::exchange(start[i], sum);
        for (const uint64_t word : from) to[start[word >> shift & mask]++] = word;
        std::swap(from, to);
    }
    return from;
}

}  // namespace strata
