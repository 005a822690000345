#include "io/las/laz_chunk_reader.h"

#include <algorithm>
#include <vector>

namespace strata::las {
namespace {

constexpr size_t kTileBytes = 128 * 1024;  // of records, on their way from the decoder to the columns

}  // namespace

LazSelection select_bytes(const Columns& columns, size_t record_size, std::span<const int> wanted) {
    LazSelection selection{std::vector<bool>(record_size, false)};
    for (const int index : wanted) {
        const size_t begin = columns.record_offset(size_t(index));
        std::fill_n(selection.bytes.begin() + std::ptrdiff_t(begin), columns.attributes()[size_t(index)].size_bytes(), true);
    }
    return selection;
}

void LazChunkReader::read(const LazChunk& chunk, std::span<const int> wanted, PointBatch& out) const {
    resize_batch(out, size_t(chunk.points), columns_.attributes(), wanted);
    const std::unique_ptr<LazDecoder> decoder = make_laz_decoder(header_, laz_, select_bytes(columns_, header_.record_size, wanted));
    const size_t record_size = header_.record_size, tile = std::max<size_t>(1, kTileBytes / record_size);
    std::vector<std::byte> records(std::min(tile, size_t(chunk.points)) * record_size);
    decoder->begin(source_, chunk);
    for (size_t row = 0; row < size_t(chunk.points);) {
        const size_t count = std::min(tile, size_t(chunk.points) - row);
        decoder->decode(count, records.data());
        columns_.decode({records.data(), count * record_size}, wanted, row, out);
        row += count;
    }
    decoder->finish();
}

}  // namespace strata::las
