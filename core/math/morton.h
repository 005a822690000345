#pragma once

#include <cstdint>

namespace strata {

/// The lowest 21 bits of `value`, two zero bits between neighbours.
constexpr uint64_t spread_bits_by_3(uint64_t value) {
    value &= 0x1fffff;
    value = (value | value << 32) & 0x001f00000000ffff;
    value = (value | value << 16) & 0x001f0000ff0000ff;
    value = (value | value << 8) & 0x100f00f00f00f00f;
    value = (value | value << 4) & 0x10c30c30c30c30c3;
    return (value | value << 2) & 0x1249249249249249;
}

/// Inverse of spread_bits_by_3; other bits of `value` are ignored.
constexpr uint32_t gather_bits_by_3(uint64_t value) {
    value &= 0x1249249249249249;
    value = (value | value >> 2) & 0x10c30c30c30c30c3;
    value = (value | value >> 4) & 0x100f00f00f00f00f;
    value = (value | value >> 8) & 0x001f0000ff0000ff;
    value = (value | value >> 16) & 0x001f00000000ffff;
    return uint32_t((value | value >> 32) & 0x1fffff);
}

/// Morton code of up to 21 bits an axis with x as the highest bit of each triple: each triple is an octant digit
/// 4 x + 2 y + z, so codes sort like node names. (Potree's BROTLI positions have x lowest: io/potree has its own.)
constexpr uint64_t octant_code(uint32_t x, uint32_t y, uint32_t z) {
    return spread_bits_by_3(x) << 2 | spread_bits_by_3(y) << 1 | spread_bits_by_3(z);
}

}  // namespace strata
