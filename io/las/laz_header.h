#pragma once

#include <cstdint>
#include <vector>

#include "io/byte_source.h"
#include "io/las/las_header.h"

namespace strata::las {

/// Parts of a point record that are compressed each by a model of its own; the numbers are those in files.
enum class LazItemKind : uint16_t {
    bytes = 0,  // extra bytes, point formats 0 to 5
    point10 = 6,
    gps_time11 = 7,
    rgb12 = 8,
    wave_packet13 = 9,
    point14 = 10,
    rgb14 = 11,
    rgb_nir14 = 12,
    wave_packet14 = 13,
    bytes14 = 14,
};

struct LazItem {
    LazItemKind kind = LazItemKind::bytes;
    uint16_t size = 0;  // bytes of the record
    uint16_t version = 0;
};

/// How the points of a LAZ file are compressed: its record "laszip encoded".
struct LazHeader {
    bool layered = false;      // a stream of bytes a field, point formats 6 to 10; else one stream for all fields
    bool chunked = false;      // else the points are one stream without beginning anew; implied by layered
    uint32_t chunk_points = 0;  // points of each chunk but the last; 0: the chunk table says
    std::vector<LazItem> items;  // in the order of the record; together they are the record
};

/// The items of a point format, of the versions that an encoder writes.
std::vector<LazItem> laz_items(int point_format, size_t record_size);

/// Reads and checks the record: compressor and items are known, and the items are those of the point format.
/// throws  Error{malformed, unsupported, io}: file, place, expectation
LazHeader read_laz_header(const ByteSource& source, const Header& header);

}  // namespace strata::las
