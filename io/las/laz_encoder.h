#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace strata::las {

/// Encodes chunks of point records. One per thread: it keeps its buffers and models.
class LazEncoder {
public:
    virtual ~LazEncoder() = default;
    /// Appends the bytes of one chunk of at least one point: those that the reference compressor writes for the same records.
    /// records  [count * record_size]
    virtual void encode(std::span<const std::byte> records, std::vector<std::byte>& out) = 0;
};

/// Point formats 0 to 10, with or without extra bytes: items of version 2 (wave packets 1) up to format 5, else of version 3.
/// throws  Error{unsupported}
std::unique_ptr<LazEncoder> make_laz_encoder(int point_format, size_t record_size);

std::unique_ptr<LazEncoder> make_pointwise_encoder(int point_format, size_t record_size);
std::unique_ptr<LazEncoder> make_layered_encoder(int point_format, size_t record_size);

inline constexpr uint32_t kVariableChunks = 0xFFFFFFFF;

/// The payload of the record "laszip encoded" (22204) of a file whose points make_laz_encoder encodes.
/// chunk_points  points of every chunk but the last, or kVariableChunks
std::vector<std::byte> laszip_record(int point_format, size_t record_size, uint32_t chunk_points);

struct LazTableEntry {
    uint32_t points = 0;
    uint32_t bytes = 0;
};

/// The chunk table: version, count, and the sizes of the chunks; their points only where they vary.
std::vector<std::byte> encode_chunk_table(std::span<const LazTableEntry> chunks, bool variable);

}  // namespace strata::las
