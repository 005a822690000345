#pragma once

#include <array>
#include <cstdint>

namespace strata {

// Words of a plane's samples or cells, moved by one along i or j; what comes in is the next brick's.
namespace brick_word {
inline constexpr uint64_t kFirstColumn = 0x0101010101010101, kLastColumn = kFirstColumn << 7, kLastRow = uint64_t{0xff} << 56;
inline uint64_t along_i(uint64_t plane, uint64_t next) { return (plane >> 1 & ~kLastColumn) | (next & kFirstColumn) << 7; }
inline uint64_t along_j(uint64_t plane, uint64_t next) { return plane >> 8 | next << 56; }
inline uint64_t back_along_i(uint64_t plane, uint64_t last) { return (plane & ~kLastColumn) << 1 | (last & kLastColumn) >> 7; }
inline uint64_t back_along_j(uint64_t plane, uint64_t last) { return plane << 8 | last >> 56; }
}  // namespace brick_word

/// Of a plane's cells, from the samples of two planes.
inline std::array<uint64_t, 8> corner_words(const std::array<uint64_t, 4>& low, const std::array<uint64_t, 4>& high) {
    return {low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]};
}
inline uint64_t active_cells(const std::array<uint64_t, 8>& corner) {
    uint64_t any = 0, all = ~uint64_t{0};
    for (const uint64_t word : corner) {
        any |= word;
        all &= word;
    }
    return any & ~all;
}
inline unsigned case_of_cell(const std::array<uint64_t, 8>& corner, unsigned bit) {
    unsigned cell_case = 0;
    for (unsigned c = 0; c < 8; ++c) cell_case |= unsigned(corner[c] >> bit & 1) << c;
    return cell_case;
}

}  // namespace strata
