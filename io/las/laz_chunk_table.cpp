#include "io/las/laz_chunk_table.h"

#include <algorithm>
#include <array>
#include <string>

#include "core/error.h"
#include "io/byte_reader.h"
#include "io/las/arithmetic_decoder.h"
#include "io/las/byte_window.h"
#include "io/las/integer_models.h"

namespace strata::las {
namespace {

constexpr uint64_t kPointerBytes = 8;      // offset of the table, before the first chunk
constexpr uint64_t kTableHeaderBytes = 8;  // version, count
constexpr uint64_t kAtEndOfFile = UINT64_MAX;

std::string number(uint64_t n) { return std::to_string(n); }

struct TableReader {
    const ByteSource& source;
    const Header& header;
    const LazHeader& laz;
    uint64_t begin = header.point_offset + kPointerBytes;  // of the first chunk

    [[noreturn]] void fail(uint64_t offset, const std::string& expectation) const {
        throw Error(ErrorKind::malformed, source.name() + ": chunk table: byte " + number(offset) + ": " + expectation);
    }

    uint64_t read_pointer(uint64_t at) const {
        std::array<std::byte, kPointerBytes> bytes;
        source.read(at, bytes);
        return ByteReader(bytes, source.name() + ": chunk table", at).read<uint64_t>();
    }

    /// The offset of the table; that of the pointer itself: there is none.
    uint64_t find() const {
        if (source.size() - header.point_offset < kPointerBytes)
            fail(header.point_offset, "8 bytes needed, " + number(source.size() - header.point_offset) + " left");
        uint64_t pointer = read_pointer(header.point_offset), at = header.point_offset;
        if (pointer == kAtEndOfFile) {
            at = source.size() - kPointerBytes;
            if (at < begin) fail(header.point_offset, "its offset is said to be in the last 8 bytes of the file, there are none behind these");
            pointer = read_pointer(at);
        }
        if (pointer == header.point_offset) return pointer;
        if (pointer < begin || pointer > source.size() || source.size() - pointer < kTableHeaderBytes)
            fail(at, "its offset is " + number(pointer) + ", it must lie between byte " + number(begin) + " and the end of the file at " + number(source.size()));
        return pointer;
    }

    /// Chunks of a fixed number of points, offsets unknown.
    std::vector<LazChunk> untabled(uint64_t first_offset, uint64_t chunk_points) const {
        std::vector<LazChunk> chunks;
        const uint64_t size = source.size() - std::min(first_offset, source.size());
        check_points(first_offset, size, header.points, 0);
        // Each chunk has a raw point at least.
        if (header.points / chunk_points > size / header.record_size)
            fail(first_offset, number(header.points) + " points in chunks of " + number(chunk_points) + " cannot lie in " + number(size) + " bytes");
        for (uint64_t first = 0; first < header.points; first += chunk_points)
            chunks.push_back({first_offset, size, std::min(chunk_points, header.points - first), true});
        return chunks;
    }

    void check_points(uint64_t offset, uint64_t size, uint64_t points, uint64_t chunk) const {
        if (points / kMostLazPointsPerByte > size)
            throw Error(ErrorKind::malformed, source.name() + ": chunk " + number(chunk + 1) + ": byte " + number(offset) + ": " + number(points) +
                                                  " points cannot lie in " + number(size) + " bytes");
    }

    std::vector<LazChunk> read(uint64_t table) const {
        std::array<std::byte, kTableHeaderBytes> head;
        source.read(table, head);
        ByteReader reader(head, source.name() + ": chunk table", table);
        if (const uint32_t version = reader.read<uint32_t>(); version != 0) fail(table, "version " + number(version) + ", version 0 is known");
        const uint64_t count = reader.read<uint32_t>();
        // Chunks lie before the table, except that of a writer that put the table first.
        const uint64_t end = table > begin ? table : source.size();
        if (count > (end - begin) / header.record_size)
            fail(table + 4, number(count) + " chunks, the " + number(end - begin) + " bytes of compressed points hold at most " +
                                number((end - begin) / header.record_size));
        if (laz.chunk_points > 0) {
            const uint64_t needed = header.points / laz.chunk_points + (header.points % laz.chunk_points != 0);
            if (count != needed)
                fail(table + 4, number(count) + " chunks of " + number(laz.chunk_points) + " points, " + number(header.points) + " points need " + number(needed));
        }
        if (count == 0 && header.points > 0) fail(table + 4, "no chunks, but the header counts " + number(header.points) + " points");
        return decode(table + kTableHeaderBytes, count, end);
    }

    std::vector<LazChunk> decode(uint64_t offset, uint64_t count, uint64_t end) const {
        std::vector<LazChunk> chunks;
        if (count == 0) return chunks;
        constexpr size_t kMargin = kBytesPerSymbol * 16 + kBytesAhead;
        ByteWindow window;
        window.open(source, offset, source.size(), kMargin);
        ArithmeticDecoder decoder(window.begin());
        IntegerModels<ArithmeticDecoder, 32, 2> models;
        models.restart();
        LazChunk last{begin, 0, 0, false};
        uint64_t points_left = header.points;
        try {
            for (uint64_t i = 0; i < count; ++i) {
                if (decoder.next() > window.limit()) decoder.set_next(window.advance(decoder.next()));
                LazChunk chunk;
                chunk.offset = last.offset + last.size;
                if (laz.chunk_points == 0) {
                    chunk.points = uint32_t(models.code(decoder, int32_t(uint32_t(last.points)), 0));
                } else {
                    chunk.points = std::min<uint64_t>(laz.chunk_points, points_left);
                }
                chunk.size = uint32_t(models.code(decoder, int32_t(uint32_t(last.size)), 1));
                window.check(decoder.next());
                check(chunk, i, count, end, points_left);
                points_left -= chunk.points;
                last = chunk;
                if (chunk.points > 0) chunks.push_back(chunk);
            }
        } catch (const Error& error) {
            if (std::string(error.what()).starts_with("byte")) throw error.within(source.name() + ": chunk table");
            throw;
        }
        if (!decoder.ok()) fail(offset, "its bytes are not compressed numbers");
        if (points_left > 0)
            fail(offset, "its chunks have " + number(header.points - points_left) + " points, the header counts " + number(header.points));
        return chunks;
    }

    void check(const LazChunk& chunk, uint64_t index, uint64_t count, uint64_t end, uint64_t points_left) const {
        const std::string place = source.name() + ": chunk " + number(index + 1) + " of " + number(count) + ": byte " + number(chunk.offset) + ": ";
        if (chunk.size > end - chunk.offset)
            throw Error(ErrorKind::malformed, place + number(chunk.size) + " bytes by the chunk table, " + number(end - chunk.offset) + " are there");
        if (chunk.points > points_left)
            throw Error(ErrorKind::malformed, place + number(chunk.points) + " points by the chunk table, the header leaves " + number(points_left));
        check_points(chunk.offset, chunk.size, chunk.points, index);
    }
};

}  // namespace

LazChunks read_laz_chunks(const ByteSource& source, const Header& header, const LazHeader& laz) {
    const TableReader reader{source, header, laz};
    if (!laz.chunked) return {reader.untabled(header.point_offset, std::max<uint64_t>(header.points, 1)), true};
    if (header.points == 0 && source.size() - header.point_offset < kPointerBytes) return {};
    const uint64_t table = reader.find();
    if (table != header.point_offset) return {reader.read(table), false};
    if (laz.chunk_points == 0 && header.points > 0)
        reader.fail(header.point_offset, "there is none, and without it chunks of varying size cannot be found");
    return {reader.untabled(reader.begin, std::max<uint64_t>(laz.chunk_points, 1)), true};
}

LazChunks salvage_laz_chunks(const ByteSource& source, const Header& header, const LazHeader& laz, std::vector<std::string>& notes) {
    try {
        return read_laz_chunks(source, header, laz);
    } catch (const Error& error) {
        if (error.kind != ErrorKind::malformed || (laz.chunked && laz.chunk_points == 0)) throw;
        notes.push_back(error.what());
    }
    const uint64_t begin = std::min(header.point_offset + (laz.chunked ? kPointerBytes : 0), source.size()), size = source.size() - begin;
    const uint64_t chunk_points = laz.chunked ? laz.chunk_points : std::max<uint64_t>(header.points, 1);
    LazChunks found{.chunks = {}, .sequential = true};
    uint64_t points_left = header.points;
    // Each chunk has a raw point at least: no more are listed than that leaves room for.
    for (uint64_t c = 0; c < size / header.record_size && points_left > 0; ++c) {
        const uint64_t points = std::min(chunk_points, points_left);
        found.chunks.push_back({begin, size, points, true});
        points_left -= points;
    }
    return found;
}

}  // namespace strata::las
