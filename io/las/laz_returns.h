#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace strata::las {

// How returns choose the models of coordinates and intensity. r: return number; n: number of returns of the pulse.

/// 0 to 7: how many returns deep in the pulse. Both numbers below 16.
constexpr size_t return_depth(unsigned n, unsigned r) { return std::min(n < r ? r - n : n - r, 7u); }

namespace detail {

template <size_t Size>
constexpr std::array<std::array<uint8_t, Size>, Size> table_of_digits(const std::array<std::string_view, Size>& rows) {
    std::array<std::array<uint8_t, Size>, Size> table{};
    for (size_t n = 0; n < Size; ++n)
        for (size_t r = 0; r < Size; ++r) table[n][r] = uint8_t(rows[n][r] <= '9' ? rows[n][r] - '0' : rows[n][r] - 'a' + 10);
    return table;
}

// Rows are n, columns r; a hexadecimal digit a class. Numbers that no pulse has (r = 0, r > n) are classed too.
inline constexpr auto kReturnClass16 = table_of_digits<8>({"fedcba98", "e0136aa9", "d1247bba", "c3458ccb",  //
                                                           "b6789ddc", "aabcdeed", "9abcdefe", "89abcdef"});
inline constexpr auto kReturnClass6 = table_of_digits<16>(
    {"0123453445555555", "1013333333333333", "2124444444433333", "3345444444444444", "4344544444444444", "5344454444444444",
     "3344445444444444", "4344444544444444", "4344444454444444", "5344444445444444", "5344444444544444", "5334444444455444",
     "5334444444455544", "5334444444445554", "5334444444444555", "5334444444444455"});

}  // namespace detail

/// One of 16 classes, for point formats 0 to 5. Both numbers below 8.
constexpr size_t return_class_16(unsigned n, unsigned r) { return detail::kReturnClass16[n][r]; }

/// One of 6 classes, for point formats 6 to 10. Both numbers below 16.
constexpr size_t return_class_6(unsigned n, unsigned r) { return detail::kReturnClass6[n][r]; }

}  // namespace strata::las
