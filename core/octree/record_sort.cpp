#include "core/octree/record_sort.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <numeric>
#include <utility>

#include "core/math/morton.h"
#include "core/octree/record_layout.h"

namespace strata {
namespace {

// Levels that one 64-bit code covers below a node.
constexpr uint32_t kCodeLevels = 21;

// The levels of a cell from `level` downwards, at the top of 21 bits.
uint32_t bits_below(uint32_t cell, uint32_t level) {
    const int shift = int(kMaxLevel) - int(kCodeLevels) - int(level);
    return (shift >= 0 ? cell >> shift : cell << -shift) & ((1u << kCodeLevels) - 1);
}

// The octant digits of a point from `level` downwards: the digit of level + 1 is the highest of kCodeLevels triples.
uint64_t code_below(const OctreeFrame& frame, uint32_t level, const std::byte* record) {
    const Vec3i p_quanta = record_position(record);
    return octant_code(bits_below(frame.cell(0, p_quanta.x()), level), bits_below(frame.cell(1, p_quanta.y()), level),
                       bits_below(frame.cell(2, p_quanta.z()), level));
}

// Records that the words cannot tell apart: by code, where codes agree by deeper cells, then by bytes.
class ContentOrder {
public:
    ContentOrder(const OctreeFrame& frame, uint32_t level, std::span<const std::byte> records, size_t record_size)
        : frame_(frame), level_(level), records_(records.data()), record_size_(record_size) {}

    bool operator()(uint32_t a, uint32_t b) const {
        const std::byte *record_a = records_ + a * record_size_, *record_b = records_ + b * record_size_;
        for (uint32_t level = level_; level < kMaxLevel; level += kCodeLevels) {
            const uint64_t code_a = code_below(frame_, level, record_a), code_b = code_below(frame_, level, record_b);
            if (code_a != code_b) return code_a < code_b;
        }
        return std::memcmp(record_a, record_b, record_size_) < 0;
    }

private:
    const OctreeFrame& frame_;
    uint32_t level_;
    const std::byte* records_;
    size_t record_size_;
};

}  // namespace

// Returns the mask of the index bits.
uint64_t RecordSort::pack(uint32_t level, std::span<const std::byte> records, size_t record_size) {
    uint64_t differing = 0;
    for (size_t i = 0; i < words_.size(); ++i) {
        words_[i] = code_below(frame_, level, records.data() + i * record_size);
        differing |= words_[i] ^ words_[0];
    }
    const int index_bits = std::max<int>(std::bit_width(words_.size() - 1), 1), shift = std::countl_zero(differing | 1);
    const uint64_t index_mask = (uint64_t{1} << index_bits) - 1;
    for (size_t i = 0; i < words_.size(); ++i) words_[i] = (words_[i] << shift & ~index_mask) | i;
    return index_mask;
}

// Least significant digit first, all but the index; digits that all share are passed over. The result is in `words`.
void RecordSort::radix_sort(std::span<uint64_t> words, std::span<uint64_t> other) {
    constexpr size_t kSmall = 96;  // below, comparisons are quicker than histograms
    if (words.size() < kSmall) return std::sort(words.begin(), words.end());
    constexpr int kDigitBits = 7, kBuckets = 1 << kDigitBits, kMaxDigits = 64 / kDigitBits + 1;
    uint64_t differing = 0;
    for (const uint64_t word : words) differing |= word ^ words[0];
    const int lowest = std::bit_width(words_.size() - 1),
              digits = (std::bit_width(differing) - lowest + kDigitBits - 1) / kDigitBits;
    std::array<std::array<uint32_t, kBuckets>, kMaxDigits> count{};
    for (const uint64_t word : words)
        for (int digit = 0; digit < digits; ++digit)
            ++count[size_t(digit)][word >> (lowest + kDigitBits * digit) & (kBuckets - 1)];
    std::span<uint64_t> from = words, to = other;
    for (int digit = 0; digit < digits; ++digit) {
        const int shift = lowest + kDigitBits * digit;
        std::array<uint32_t, kBuckets>& start = count[size_t(digit)];
        if (start[from[0] >> shift & (kBuckets - 1)] == from.size()) continue;
        uint32_t sum = 0;
        for (uint32_t& entry : start) sum += std::exchange(entry, sum);
        for (const uint64_t word : from) to[start[word >> shift & (kBuckets - 1)]++] = word;
        std::swap(from, to);
    }
    if (from.data() != words.data()) std::copy(from.begin(), from.end(), words.begin());
}

std::span<const uint32_t> RecordSort::operator()(uint32_t level, std::span<const std::byte> records,
                                                 size_t record_size) {
    const size_t n = records.size() / record_size;
    words_.resize(n);
    other_.resize(n);
    order_.resize(n);
    if (n == 0) return order_;
    const uint64_t index_mask = pack(level, records, record_size);

    // Buckets of the first levels hold what fits in a cache, so that the sorting proper never leaves it.
    const int bucket_bits = std::clamp(int(std::bit_width(n / 4096)), 0, 9);
    const int bucket_shift = 63 - bucket_bits;
    std::vector<uint32_t> bucket_end(size_t{1} << (bucket_bits + 1), 0);
    for (const uint64_t word : words_) ++bucket_end[word >> bucket_shift];
    uint32_t sum = 0;
    for (uint32_t& entry : bucket_end) sum += std::exchange(entry, sum);
    for (const uint64_t word : words_) other_[bucket_end[word >> bucket_shift]++] = word;
    uint32_t begin = 0;
    for (const uint32_t end : bucket_end) {
        radix_sort(std::span(other_).subspan(begin, end - begin), std::span(words_).subspan(begin, end - begin));
        begin = end;
    }

    for (size_t i = 0; i < n; ++i) order_[i] = uint32_t(other_[i] & index_mask);
    for (size_t first = 0, last = 1; first < n; first = last++) {
        while (last < n && (other_[last] ^ other_[first]) <= index_mask) ++last;
        if (last - first > 1)
            std::sort(order_.begin() + ptrdiff_t(first), order_.begin() + ptrdiff_t(last),
                      ContentOrder(frame_, level, records, record_size));
    }
    return order_;
}

}  // namespace strata
