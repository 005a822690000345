#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/quantization.h"
#include "io/las/las_layout.h"

namespace strata::las {

// Bits of the global encoding.
inline constexpr uint16_t kAdjustedTimeBit = 1, kWktBit = 1 << 4;

/// What times say of their kind where nothing else does: seconds of the week lie within one, and those since 1980 less 10^9 for one week
/// of 2011 alone.
inline bool looks_adjusted(double least_time, double most_time) { return least_time < 0.0 || most_time > 604'800.0; }

/// Bit 7 of the point format: the points are compressed.
inline constexpr uint8_t kCompressedBit = 0x80;

/// What the header block says of a file that is being written.
struct HeaderValues {
    int minor_version = 4;  // of 1.x, 2 to 4
    uint16_t global_encoding = 0;
    std::string system_identifier = "strata";
    std::string generating_software = "strata";
    uint16_t creation_day = 0, creation_year = 0;
    uint32_t point_offset = 0;  // bytes
    uint32_t records = 0;       // variable length records before the points
    int point_format = 7;
    bool compressed = false;
    uint16_t record_size = 0;
    Quantization quantization;
    uint64_t points = 0;
    std::array<uint64_t, 15> points_by_return{};  // from return 1 on
    std::array<int32_t, 3> least{}, most{};       // quanta; of no points: not used
    uint64_t extended_offset = 0;                 // bytes, of the first extended record; 0: none
    uint32_t extended_records = 0;
};

/// The header block. The counts of LAS 1.0 to 1.3 are filled in for point formats 0 to 5 where they can hold the numbers,
/// and 0 otherwise.
/// source  LAS 1.4 R15, section 2.4, table 3
std::vector<std::byte> header_block(const HeaderValues& values);

/// Appends a variable length record. throws Error{limit}: a payload of more than 65,535 bytes
void append_record(std::vector<std::byte>& out, std::string_view user_id, uint16_t record_id, std::string_view description,
                   std::span<const std::byte> payload);
/// Appends the header of an extended one, whose payload of `size` bytes follows.
void append_extended_record_header(std::vector<std::byte>& out, std::string_view user_id, uint16_t record_id,
                                   std::string_view description, uint64_t size);

}  // namespace strata::las
