#include "io/las/laz_encoder.h"

#include <cstring>
#include <string>

#include "core/error.h"
#include "io/las/arithmetic_encoder.h"
#include "io/las/coded_bytes.h"
#include "io/las/integer_models.h"
#include "io/las/las_layout.h"
#include "io/las/laz_header.h"

namespace strata::las {
namespace {

constexpr uint32_t kTableVersion = 0;

template <typename T>
void put(std::vector<std::byte>& out, T value) {
    const size_t at = out.size();
    out.resize(at + sizeof value);
    std::memcpy(out.data() + at, &value, sizeof value);
}

void check(int point_format, size_t record_size) {
    if (point_format < 0 || point_format > kLastPointFormat)
        throw Error(ErrorKind::unsupported, "point format " + std::to_string(point_format) + " cannot be compressed, formats 0 to 10 can");
    const size_t least = point_layout(point_format).size;
    if (record_size < least || record_size > UINT16_MAX)
        throw Error(ErrorKind::unsupported, "records of " + std::to_string(record_size) + " bytes, those of point format " +
                                                std::to_string(point_format) + " have " + std::to_string(least) + " to 65535");
}

}  // namespace

std::unique_ptr<LazEncoder> make_laz_encoder(int point_format, size_t record_size) {
    check(point_format, record_size);
    return point_layout(point_format).extended ? make_layered_encoder(point_format, record_size) : make_pointwise_encoder(point_format, record_size);
}

std::vector<std::byte> laszip_record(int point_format, size_t record_size, uint32_t chunk_points) {
    check(point_format, record_size);
    const std::vector<LazItem> items = laz_items(point_format, record_size);
    std::vector<std::byte> out;
    put<uint16_t>(out, point_layout(point_format).extended ? 3 : 2);  // compressor: layered or pointwise chunks
    put<uint16_t>(out, 0);                                            // coder: arithmetic
    put<uint8_t>(out, 3);                                             // the version of the reference compressor that writes the same
    put<uint8_t>(out, 5);
    put<uint16_t>(out, 0);
    put<uint32_t>(out, 0);  // options
    put<uint32_t>(out, chunk_points);
    put<int64_t>(out, -1);  // special records: there are none
    put<int64_t>(out, -1);
    put<uint16_t>(out, uint16_t(items.size()));
    for (const LazItem& item : items) {
        put<uint16_t>(out, uint16_t(item.kind));
        put<uint16_t>(out, item.size);
        put<uint16_t>(out, item.version);
    }
    return out;
}

std::vector<std::byte> encode_chunk_table(std::span<const LazTableEntry> chunks, bool variable) {
    std::vector<std::byte> out;
    put<uint32_t>(out, kTableVersion);
    put<uint32_t>(out, uint32_t(chunks.size()));
    if (chunks.empty()) return out;
    IntegerModels<ArithmeticEncoder, 32, 2> models;
    models.restart();
    CodedBytes bytes;
    ArithmeticEncoder encoder = bytes.begin();
    LazTableEntry last;
    for (const LazTableEntry& chunk : chunks) {
        bytes.make_room(encoder, 2 * kMostIntegerBytes);
        if (variable) models.code(encoder, int32_t(last.points), 0, int32_t(chunk.points));
        models.code(encoder, int32_t(last.bytes), 1, int32_t(chunk.bytes));
        last = chunk;
    }
    const std::span<const std::byte> coded = bytes.finish(encoder);
    out.insert(out.end(), coded.begin(), coded.end());
    return out;
}

}  // namespace strata::las
