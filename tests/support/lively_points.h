#pragma once

#include <cstdint>
#include <vector>

#include "io/las/las_layout.h"
#include "tests/support/las_file.h"

namespace strata::test {

/// Point i of a made-up scan in which all that a compressor treats apart comes soon: coordinates that wrap, steps back,
/// repeats and jumps of the GPS time and two times interleaved, 8-bit, 16-bit and grey color, returns that no pulse has,
/// scanner channels that come and go. The records of golden LAZ files are these.
inline LasPoint lively_point(int format, int i) {
    const bool extended = format >= 6;
    uint32_t h = uint32_t(i + 1) * 2654435761u;
    h ^= h >> 15;
    h *= 2246822519u;
    h ^= h >> 13;
    LasPoint p;
    p.x = i % 29 == 7 ? INT32_MAX : i % 29 == 8 ? INT32_MIN : 100 * i - int32_t(h % 41);
    p.y = i % 37 == 5 ? INT32_MIN : i % 37 == 6 ? INT32_MAX : -3000 * (i % 10) + int32_t(h % 7);
    p.z = i % 41 == 11 ? INT32_MAX - i : i % 3 == 0 ? 700 : 700 - int32_t(h % 300);
    p.intensity = uint16_t(i % 5 == 0 ? h >> 16 : 300 + h % 50);
    p.number_of_returns = uint8_t(extended ? (i % 11 == 0 ? 15 - i % 4 : 1 + (h >> 5) % 5) : i % 13 == 0 ? 7 : 1 + (h >> 5) % 4);
    p.return_number = uint8_t(i % 17 == 3 ? 0 : i % 19 == 4 ? (extended ? 15 : 7) : 1 + i % p.number_of_returns);
    const uint8_t marks = uint8_t((i / 7) & (extended ? 15 : 7)), direction = uint8_t((i / 5 & 3) << 6);
    const uint8_t channel = uint8_t(i < 25 ? 1 : i / 6 % 7 < 4 ? i / 6 % 4 : i / 12 % 2 * 3);
    p.flags = uint8_t(marks | direction | (extended ? channel << 4 : 0));
    p.classification = uint8_t(extended && i % 23 == 0 ? 200 : (i / 13 + int(h % 2)) % 32);
    p.scan_angle = int16_t(extended ? int(h % 60) * (i % 7 == 0 ? 500 : 1) - 15000 : i % 60 - 30);
    p.user_data = uint8_t(i / 4 * 3);
    p.point_source_id = uint16_t(i / 20 * 20000 + (i % 33 == 0));
    // The bits of a double are coded as an integer: differences are written in units of its last place.
    const int64_t base = 0x41A5F5E100000000;
    int64_t time = base + int64_t(i / 4) * 6000;                                 // steady, four points each
    if (i >= 30 && i < 60) time = base + 1'000'000 + int64_t(i) * i * 40;        // ever faster
    if (i >= 60 && i < 80) time = base + (i % 2 ? int64_t{1} << 40 : 0) + i * 600;  // two sequences in turns
    if (i >= 80 && i < 100) time = base + 500'000'000 - int64_t(i) * 9000;       // backwards
    if (i >= 100 && i < 115) time = base + (int64_t(i) - 100) * (i % 3 ? 7'000'000 : 90);  // beyond all multiples
    if (i >= 115 && i < 118) time = int64_t(h) << 31;                            // anything
    std::memcpy(&p.gps_time, &time, sizeof time);
    const uint16_t shade = uint16_t(i % 4 == 0 ? h : 20000 + i * 3);
    p.rgb = {shade, uint16_t(i % 6 == 0 ? shade : shade + h % 90), uint16_t(i % 6 == 0 ? shade : (shade >> 1) + h % 40)};
    if (i >= 120) p.rgb = {uint16_t(h % 256), uint16_t(h / 256 % 256), uint16_t(i)};
    p.nir = uint16_t(i % 3 == 0 ? h >> 8 : 4000 + i);
    return p;
}

/// Its record with a wave packet, where the format has one, and extra bytes behind.
inline std::vector<std::byte> lively_record(int format, int i, int extra_bytes) {
    std::vector<std::byte> record = las_record(format, lively_point(format, i));
    if (const size_t wave = las::point_layout(format).wave) {
        const uint64_t offset = i % 9 == 0 ? 5'000'000'000u * uint64_t(i) : 60 + 256 * uint64_t(i) - (i % 5 == 0 ? 100 : 0);
        record[wave] = std::byte(i % 8 == 0 ? 2 : 1);
        poke<uint64_t>(record, wave + 1, offset);
        poke<uint32_t>(record, wave + 9, i % 10 == 0 ? 128 : 256);
        for (int f = 0; f < 4; ++f) poke<float>(record, wave + 13 + 4 * size_t(f), float(i * (f - 1)) / 3.0f);
    }
    for (int b = 0; b < extra_bytes; ++b) record.push_back(std::byte(b == 0 ? i : b == 1 ? 77 : i * i * 31 / 7));
    return record;
}

}  // namespace strata::test
