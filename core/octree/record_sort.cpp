#include "core/octree/record_sort.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "core/math/morton.h"
#include "core/octree/record_layout.h"

namespace strata {
namespace {

struct CodedIndex {
    uint64_t code;
    uint32_t index;
};

// The levels of a cell from `level` downwards, at the top of 21 bits.
uint32_t bits_below(uint32_t cell, uint32_t level) {
    const int shift = int(kMaxLevel) - int(kCodeLevels) - int(level);
    return (shift >= 0 ? cell >> shift : cell << -shift) & ((1u << kCodeLevels) - 1);
}

// Least significant digit first, over the highest bits that differ; what agrees there is short and compared.
void radix_sort(std::vector<CodedIndex>& items, std::vector<CodedIndex>& other) {
    constexpr size_t kSmall = 96;   // below, comparisons are quicker than histograms
    constexpr int kRadixBits = 40;  // of a chunk of scanned points, nearly every point differs in these
    const auto by_code = [](const CodedIndex& a, const CodedIndex& b) { return a.code < b.code; };
    if (items.size() < kSmall) return std::sort(items.begin(), items.end(), by_code);
    uint64_t differing = 0;
    for (const CodedIndex& item : items) differing |= item.code ^ items.front().code;
    other.resize(items.size());
    const int lowest = std::max(int(std::bit_width(differing)) - kRadixBits, 0);
    for (int shift = lowest; differing >> shift != 0; shift += 8) {
        std::array<uint32_t, 256> start{};
        for (const CodedIndex& item : items) ++start[item.code >> shift & 0xff];
        uint32_t sum = 0;
        for (uint32_t& entry : start) sum += std::exchange(entry, sum);
        for (const CodedIndex& item : items) other[start[item.code >> shift & 0xff]++] = item;
        items.swap(other);
        if (shift + 8 >= 64) break;
    }
    for (size_t begin = 0, end = 1; lowest > 0 && begin < items.size(); begin = end++) {
        while (end < items.size() && (items[end].code ^ items[begin].code) >> lowest == 0) ++end;
        if (end - begin > 1) std::sort(items.begin() + ptrdiff_t(begin), items.begin() + ptrdiff_t(end), by_code);
    }
}

// Points whose codes agree: deeper cells decide, then bytes.
void sort_equal_codes(const OctreeFrame& frame, uint32_t level, size_t record_size, const std::byte* records,
                      std::span<CodedIndex> items) {
    const bool deeper = level + kCodeLevels < kMaxLevel;
    std::sort(items.begin(), items.end(), [&](const CodedIndex& a, const CodedIndex& b) {
        const std::byte* record_a = records + a.index * record_size;
        const std::byte* record_b = records + b.index * record_size;
        if (deeper) {
            const uint64_t code_a = code_below(frame, level + kCodeLevels, record_a);
            const uint64_t code_b = code_below(frame, level + kCodeLevels, record_b);
            if (code_a != code_b) return code_a < code_b;
        }
        return std::memcmp(record_a, record_b, record_size) < 0;
    });
}

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
        copy_record(scratch.data() + to * record_size, records.data() + i * record_size, record_size);
    }
    std::vector<CodedIndex> items, other;
    uint32_t begin = 0;
    for (const uint32_t end : bucket_end) {
        items.resize(end - begin);
        for (uint32_t i = begin; i < end; ++i) items[i - begin] = {bucket_codes[i], i};
        radix_sort(items, other);
        for (size_t i = 0; i + 1 < items.size();) {
            size_t same = i + 1;
            while (same < items.size() && items[same].code == items[i].code) ++same;
            if (same - i > 1)
                sort_equal_codes(frame, level, record_size, scratch.data(), std::span(items).subspan(i, same - i));
            i = same;
        }
        for (size_t i = 0; i < items.size(); ++i) {
            codes[begin + i] = items[i].code;
            copy_record(records.data() + (begin + i) * record_size, scratch.data() + items[i].index * record_size, record_size);
        }
        begin = end;
    }
}

}  // namespace strata
