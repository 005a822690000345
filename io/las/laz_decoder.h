#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "io/byte_source.h"
#include "io/las/las_header.h"
#include "io/las/laz_header.h"

namespace strata::las {

/// Where the bytes of a chunk lie, and what is known of it.
struct LazChunk {
    uint64_t offset = 0;  // bytes, in the file
    uint64_t size = 0;    // bytes; the true size, or with `open_end` a bound of it
    uint64_t points = 0;
    bool open_end = false;
    uint64_t wanted_points = 0;  // that will be decoded, so that less is read; 0: all

    /// Bytes of a stream of `stream_size` bytes in which the wanted points likely are: their share twice over, and a page.
    uint64_t likely_bytes(uint64_t stream_size) const {
        if (wanted_points == 0 || wanted_points >= points) return stream_size;
        return std::min(stream_size, uint64_t(2.0 * double(stream_size) * double(wanted_points) / double(points)) + 4096);
    }
};

/// The bytes of a record that a reader asks for; those of positions and returns always come.
struct LazSelection {
    std::vector<bool> bytes;  // [record size]; empty: all

    /// Whether any of the bytes [offset, offset + size) is asked for.
    bool has(size_t offset, size_t size) const {
        if (bytes.empty()) return true;
        const auto begin = bytes.begin() + std::ptrdiff_t(offset), end = begin + std::ptrdiff_t(size);
        return std::find(begin, end, true) != end;
    }
};

/// Decodes a chunk from its first point on, in as many steps as the caller likes. A copy goes on where the original was.
class LazDecoder {
public:
    virtual ~LazDecoder() = default;
    virtual std::unique_ptr<LazDecoder> clone() const = 0;

    /// Tells the source which bytes begin will read, and perhaps decode. Never fails.
    virtual void prefetch(const ByteSource& source, const LazChunk& chunk) const = 0;
    /// Begins a chunk of at least one point. What was decoded before is forgotten. With fewer wanted points than the chunk has, not all that
    /// they need may be read: decode then fails, where it would not with all points wanted.
    /// throws  Error{malformed}: "byte N: expectation", without file and chunk
    virtual void begin(const ByteSource& source, const LazChunk& chunk) = 0;
    /// Writes the next `count` records, of which the chunk has as many left.
    /// throws  as begin: the chunk's bytes ended before, or no encoder can have written them
    virtual void decode(size_t count, std::byte* records) = 0;
    /// To be called behind the last point: the offset of the byte behind the chunk.
    /// throws  as begin: the chunk's bytes do not end where its points do
    virtual uint64_t finish() = 0;
};

/// The decoder for a file's points; fields that are not selected are anything in its records, if that is faster.
std::unique_ptr<LazDecoder> make_laz_decoder(const Header& header, const LazHeader& laz, const LazSelection& selection);

std::unique_ptr<LazDecoder> make_pointwise_decoder(const Header& header, const LazHeader& laz);
std::unique_ptr<LazDecoder> make_layered_decoder(const Header& header, const LazHeader& laz, const LazSelection& selection);

}  // namespace strata::las
