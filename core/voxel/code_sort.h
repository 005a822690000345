#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace strata {

/// Sorts octant codes, or finds the order of what has them. Keeps its buffers; one per thread.
class CodeSort {
public:
    /// [n] words to be filled with codes.
    std::span<uint64_t> codes(size_t n);

    /// Sorts the codes filled in; valid until the next call, as below.
    std::span<const uint64_t> sort();

    /// The order of the codes filled in, as words: the index of each code is word & index_mask(). Equal codes in any order.
    /// code_at  the code of an index, for those that a word cannot tell apart
    template <typename CodeAt>
    std::span<const uint64_t> order(const CodeAt& code_at) {
        const bool told_apart = pack();
        std::span<uint64_t> words = radix_sort(index_bits_);
        if (!told_apart) {
            const auto by_code = [&](uint64_t a, uint64_t b) { return code_at(a & index_mask()) < code_at(b & index_mask()); };
            for (size_t first = 0, last = 1; first < words.size(); first = last++) {
                while (last < words.size() && (words[first] ^ words[last]) <= index_mask()) ++last;
                if (last - first > 1) std::sort(words.begin() + ptrdiff_t(first), words.begin() + ptrdiff_t(last), by_code);
            }
        }
        return words;
    }
    uint64_t index_mask() const { return (uint64_t{1} << index_bits_) - 1; }

    /// Bytes for each code.
    static constexpr size_t kBytesPerCode = 16;

private:
    bool pack();
    std::span<uint64_t> radix_sort(int lowest_bit);

    size_t size_ = 0;
    int index_bits_ = 0;
    std::vector<uint64_t> words_, other_;
    std::vector<uint32_t> counts_;  // of digits
};

}  // namespace strata
