#pragma once

#include <span>

#include "core/cloud/point_batch.h"
#include "io/byte_source.h"
#include "io/las/las_columns.h"
#include "io/las/las_header.h"
#include "io/las/laz_decoder.h"
#include "io/las/laz_header.h"

namespace strata::las {

/// Reads single chunks of a LAZ file whose places are known. A view of its owner's source, headers and columns.
class LazChunkReader {
public:
    LazChunkReader(const ByteSource& source, const Header& header, const LazHeader& laz, const Columns& columns)
        : source_(source), header_(header), laz_(laz), columns_(columns) {}

    /// Decodes a chunk, positions and the wanted attributes; fields that nobody wants are skipped where they are apart. Safe
    /// from several threads at once.
    /// throws  Error{malformed}: "byte N: expectation", without file and chunk
    void read(const LazChunk& chunk, std::span<const int> wanted, PointBatch& out) const;

private:
    const ByteSource& source_;
    const Header& header_;
    const LazHeader& laz_;
    const Columns& columns_;
};

/// The bytes of a record that hold the wanted attributes.
LazSelection select_bytes(const Columns& columns, size_t record_size, std::span<const int> wanted);

}  // namespace strata::las
