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

// The levels of a cell from `level` downwards, at the top of 21 bits.
uint32_t bits_below(uint32_t cell, uint32_t level) {
    const int shift = int(kMaxLevel) - int(kCodeLevels) - int(level);
    return (shift >= 0 ? cell >> shift : cell << -shift) & ((1u << kCodeLevels) - 1);
}

// Orders the records of one bucket; keeps its buffers.
class BucketSort {
public:
    BucketSort(const OctreeFrame& frame, uint32_t level, size_t record_size, const std::byte* records, const uint64_t* codes)
        : frame_(frame), level_(level), record_size_(record_size), records_(records), codes_(codes) {}

    /// The indices begin ... end - 1 in the order of their records. Valid until the next call.
    std::span<const uint32_t> operator()(uint32_t begin, uint32_t end) {
        const uint32_t n = end - begin;
        order_.resize(n);
        uint64_t differing = 0;
        for (uint32_t i = begin; i < end; ++i) differing |= codes_[i] ^ codes_[begin];
        if (n < kSmall || n > kIndexMask || differing == 0) {
            std::iota(order_.begin(), order_.end(), begin);
            sort_by_content(order_);
            return order_;
        }
        // The highest bits that differ, and the index below them, in one word: nearly every scanned point differs in
        // these 40 bits.
        const int left = 64 - std::bit_width(differing);
        packed_.resize(n);
        for (uint32_t i = 0; i < n; ++i) packed_[i] = (codes_[begin + i] << left & ~kIndexMask) | i;
        radix_sort();
        for (uint32_t i = 0; i < n; ++i) order_[i] = begin + uint32_t(packed_[i] & kIndexMask);
        for (uint32_t first = 0, last = 1; first < n; first = last++) {
            while (last < n && (packed_[last] ^ packed_[first]) <= kIndexMask) ++last;
            if (last - first > 1) sort_by_content(std::span(order_).subspan(first, last - first));
        }
        return order_;
    }

private:
    static constexpr uint32_t kSmall = 96;  // below, comparisons are quicker than histograms
    static constexpr int kIndexBits = 24;
    static constexpr uint64_t kIndexMask = (uint64_t{1} << kIndexBits) - 1;

    // Least significant digit first; digits that all share are passed over.
    void radix_sort() {
        constexpr int kDigits = (64 - kIndexBits) / 8;
        std::array<std::array<uint32_t, 256>, kDigits> count{};
        for (const uint64_t word : packed_)
            for (int digit = 0; digit < kDigits; ++digit) ++count[size_t(digit)][word >> (kIndexBits + 8 * digit) & 0xff];
        other_.resize(packed_.size());
        for (int digit = 0; digit < kDigits; ++digit) {
            const int shift = kIndexBits + 8 * digit;
            std::array<uint32_t, 256>& start = count[size_t(digit)];
            if (start[packed_[0] >> shift & 0xff] == packed_.size()) continue;
            uint32_t sum = 0;
            for (uint32_t& entry : start) sum += std::exchange(entry, sum);
            for (const uint64_t word : packed_) other_[start[word >> shift & 0xff]++] = word;
            packed_.swap(other_);
        }
    }

    // By code; where codes agree deeper cells decide, then bytes.
    void sort_by_content(std::span<uint32_t> indices) const {
        const bool deeper = level_ + kCodeLevels < kMaxLevel;
        std::sort(indices.begin(), indices.end(), [&](uint32_t a, uint32_t b) {
            if (codes_[a] != codes_[b]) return codes_[a] < codes_[b];
            const std::byte* record_a = records_ + a * record_size_;
            const std::byte* record_b = records_ + b * record_size_;
            if (deeper) {
                const uint64_t code_a = code_below(frame_, level_ + kCodeLevels, record_a);
                const uint64_t code_b = code_below(frame_, level_ + kCodeLevels, record_b);
                if (code_a != code_b) return code_a < code_b;
            }
            return std::memcmp(record_a, record_b, record_size_) < 0;
        });
    }

    const OctreeFrame& frame_;
    uint32_t level_;
    size_t record_size_;
    const std::byte* records_;
    const uint64_t* codes_;
    std::vector<uint64_t> packed_, other_;
    std::vector<uint32_t> order_;
};

}  // namespace

uint64_t code_below(const OctreeFrame& frame, uint32_t level, const std::byte* record) {
    const Vec3i p_quanta = record_position(record);
    return octant_code(bits_below(frame.cell(0, p_quanta.x()), level), bits_below(frame.cell(1, p_quanta.y()), level),
                       bits_below(frame.cell(2, p_quanta.z()), level));
}

void sort_records(const OctreeFrame& frame, uint32_t level, size_t record_size, std::vector<std::byte>& records,
                  std::vector<std::byte>& scratch, std::vector<uint64_t>& codes) {
    const size_t n = records.size() / record_size;
    scratch.resize(records.size());
    codes.resize(n);
    if (n == 0) return;
    // Buckets of the first levels hold what fits in a cache, so that the sorting proper never leaves it.
    const int bucket_bits = std::clamp(int(std::bit_width(n / 4096)), 0, 9) / 3 * 3;
    const int bucket_shift = 3 * int(kCodeLevels) - bucket_bits;
    std::vector<uint32_t> bucket_end(size_t{1} << bucket_bits, 0);
    for (size_t i = 0; i < n; ++i) {
        codes[i] = code_below(frame, level, records.data() + i * record_size);
        ++bucket_end[codes[i] >> bucket_shift];
    }
    uint32_t sum = 0;
    for (uint32_t& entry : bucket_end) sum += std::exchange(entry, sum);
    std::vector<uint64_t> bucket_codes(n);
    for (size_t i = 0; i < n; ++i) {
        const uint32_t to = bucket_end[codes[i] >> bucket_shift]++;
        bucket_codes[to] = codes[i];
        copy_record(scratch.data() + size_t(to) * record_size, records.data() + i * record_size, record_size);
    }
    BucketSort sort(frame, level, record_size, scratch.data(), bucket_codes.data());
    uint32_t begin = 0;
    for (const uint32_t end : bucket_end) {
        uint32_t to = begin;
        for (const uint32_t from : sort(begin, end)) {
            codes[to] = bucket_codes[from];
            copy_record(records.data() + size_t(to) * record_size, scratch.data() + size_t(from) * record_size, record_size);
            ++to;
        }
        begin = end;
    }
}

}  // namespace strata
