#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace strata::las {

// Sizes of the public structures, bytes. LAS 1.4 R15, sections 2.4 to 2.7.
inline constexpr size_t kVlrHeaderBytes = 54;
inline constexpr size_t kEvlrHeaderBytes = 60;
inline constexpr size_t kExtraBytesRecordBytes = 192;

/// Bytes of the header block of LAS 1.`minor`, 0 to 4.
constexpr size_t header_bytes(int minor) { return minor >= 4 ? 375 : minor == 3 ? 235 : 227; }

inline constexpr int kLastPointFormat = 10;

/// Where the fields of a point record lie. 0: the format has no such field (offset 0 is always x).
/// Common to all: int32 x, y, z at 0, 4, 8; uint16 intensity at 12.
struct PointLayout {
    uint8_t size = 0;       // bytes without extra bytes
    bool extended = false;  // formats 6 to 10: 4-bit return numbers, 8-bit classes, 16-bit scan angles
    uint8_t gps_time = 0;   // float64
    uint8_t rgb = 0;        // uint16 x 3
    uint8_t nir = 0;        // uint16
    uint8_t wave = 0;       // 29 bytes that point into waveform data
};

/// LAS 1.4 R15, section 2.6, tables 7 to 17.
constexpr PointLayout point_layout(int format) {
    constexpr std::array<PointLayout, kLastPointFormat + 1> kLayouts = {{
        {20, false, 0, 0, 0, 0},
        {28, false, 20, 0, 0, 0},
        {26, false, 0, 20, 0, 0},
        {34, false, 20, 28, 0, 0},
        {57, false, 20, 0, 0, 28},
        {63, false, 20, 28, 0, 34},
        {30, true, 22, 0, 0, 0},
        {36, true, 22, 30, 0, 0},
        {38, true, 22, 30, 36, 0},
        {59, true, 22, 0, 0, 30},
        {67, true, 22, 30, 36, 38},
    }};
    return kLayouts[size_t(format)];
}

}  // namespace strata::las
