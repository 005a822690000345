#pragma once

#include <string>
#include <vector>

#include "io/byte_source.h"
#include "io/las/las_header.h"
#include "io/las/laz_decoder.h"
#include "io/las/laz_header.h"

namespace strata::las {

// A point takes at least the symbol that says what changed, whose model gives no symbol more than 1 - 63/2^15 of the interval:
// 0.0028 bits.
inline constexpr uint64_t kMostLazPointsPerByte = 4096;

/// The chunks of a file in the order of their points; together they have the header's points.
struct LazChunks {
    std::vector<LazChunk> chunks;
    /// The writer was interrupted before it wrote the table, or the points are one stream: only the first chunk's offset is
    /// known, and each other one begins where the one before it ends. All have `open_end`.
    bool sequential = false;
};

/// Reads the chunk table, checked against the file: chunks lie one after the other behind the header and before the end of the
/// file, and none has more points than its bytes can hold.
/// throws  Error{malformed, io}: file, place, expectation
LazChunks read_laz_chunks(const ByteSource& source, const Header& header, const LazHeader& laz);

/// Of a file whose table is damaged or cut off: chunks of a fixed number of points, found one behind the other as far as the file
/// goes, with a line in `notes`. They may have fewer points together than the header says, and the last of them may not be there.
/// throws  as above: chunks of varying size cannot be found so
LazChunks salvage_laz_chunks(const ByteSource& source, const Header& header, const LazHeader& laz, std::vector<std::string>& notes);

}  // namespace strata::las
