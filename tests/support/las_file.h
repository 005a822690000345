#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace strata::test {

/// A LAS file put together byte by byte for a test, so that any field of it can lie. Written from the specification alone:
/// it shares nothing with the reader or the writer under test.
struct LasFile {
    int minor_version = 2;
    int point_format = 0;
    uint16_t global_encoding = 0;
    std::array<double, 3> scale = {0.01, 0.01, 0.01}, offset = {0.0, 0.0, 0.0};
    std::array<double, 3> min = {0.0, 0.0, 0.0}, max = {0.0, 0.0, 0.0};
    std::vector<uint64_t> points_by_return = {};
    std::vector<std::vector<std::byte>> records = {};  // of equal size
    uint16_t record_size = 0;                     // for files without points; 0: that of the records

    struct Vlr {
        std::string user_id;
        uint16_t record_id = 0;
        std::vector<std::byte> payload = {};
    };
    std::vector<Vlr> vlrs = {}, evlrs = {};

    std::vector<std::byte> bytes() const;
};

/// Little-endian bytes appended to a vector.
template <typename T>
void put(std::vector<std::byte>& out, T value) {
    const size_t at = out.size();
    out.resize(at + sizeof value);
    std::memcpy(out.data() + at, &value, sizeof value);
}
/// Overwrites at a position.
template <typename T>
void poke(std::vector<std::byte>& out, size_t at, T value) {
    std::memcpy(out.data() + at, &value, sizeof value);
}
/// `text` in a field of `size` bytes, zeros behind it.
void put_text(std::vector<std::byte>& out, const std::string& text, size_t size);
std::vector<std::byte> bytes_of(const std::string& text);

/// Field values of one point; those that a format lacks are left out of its record.
struct LasPoint {
    int32_t x = 0, y = 0, z = 0;
    uint16_t intensity = 0;
    uint8_t return_number = 1, number_of_returns = 1;
    uint8_t flags = 0;  // bits 0 to 3 synthetic, key point, withheld, overlap; 4-5 channel; 6 scan direction; 7 edge
    uint8_t classification = 0;
    int16_t scan_angle = 0;  // as stored: degrees in formats 0 to 5, 0.006 degrees in 6 to 10
    uint8_t user_data = 0;
    uint16_t point_source_id = 0;
    double gps_time = 0.0;
    std::array<uint16_t, 3> rgb = {0, 0, 0};
    uint16_t nir = 0;
};

/// The record of a point in a point format, without extra bytes; wave packets are zeros.
std::vector<std::byte> las_record(int point_format, const LasPoint& point);

/// An entry of the extra bytes record (LASF_Spec 4), 192 bytes.
std::vector<std::byte> extra_bytes_entry(const std::string& name, int data_type, uint8_t options = 0, std::array<double, 3> scale = {},
                                         std::array<double, 3> offset = {}, uint64_t no_data_bits = 0);

}  // namespace strata::test
