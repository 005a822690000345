#include "io/potree/potree_node.h"

#include <brotli/decode.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>

#include "core/error.h"

namespace strata {
namespace {

uint64_t load_u64(const std::byte* bytes) {
    uint64_t value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
}

/// Every third bit of `code`, from bit 0: undoes the interleaving of 16-bit numbers.
uint32_t gather_third_bits(uint64_t code) {
    code &= 0x0000249249249249;
    code = (code | code >> 2) & 0x00000c30c30c30c3;
    code = (code | code >> 4) & 0x000000f00f00f00f;
    code = (code | code >> 8) & 0x00000000ff0000ff;
    code = (code | code >> 16) & 0x000000000000ffff;
    return uint32_t(code);
}

/// Bytes that grow without being cleared: a decoder's output.
struct Buffer {
    std::unique_ptr<std::byte[]> bytes;
    size_t size = 0;

    void grow(size_t used, size_t new_size) {
        auto larger = std::make_unique_for_overwrite<std::byte[]>(new_size);
        if (used > 0) std::memcpy(larger.get(), bytes.get(), used);
        bytes = std::move(larger);
        size = new_size;
    }
};

/// Decodes one Brotli stream that must fill `expected` bytes exactly. What is allocated follows what the stream yields,
/// so that a lying count costs nothing.
Buffer decode_brotli(std::span<const std::byte> stored, uint64_t expected) {
    const std::unique_ptr<BrotliDecoderState, decltype(&BrotliDecoderDestroyInstance)> decoder(
        BrotliDecoderCreateInstance(nullptr, nullptr, nullptr), &BrotliDecoderDestroyInstance);
    if (!decoder) throw std::bad_alloc();
    Buffer buffer;
    // Scans shrink to a third or less; ten times covers them in one allocation.
    buffer.grow(0, size_t(std::min<uint64_t>(expected, std::max<uint64_t>(stored.size() * 10, 64 << 10))));
    size_t input_left = stored.size(), used = 0;
    const auto* input = reinterpret_cast<const uint8_t*>(stored.data());
    for (;;) {
        size_t room = buffer.size - used;
        auto* output = reinterpret_cast<uint8_t*>(buffer.bytes.get()) + used;
        const auto status = BrotliDecoderDecompressStream(decoder.get(), &input_left, &input, &room, &output, nullptr);
        used = buffer.size - room;
        if (status == BROTLI_DECODER_RESULT_SUCCESS) break;
        if (status != BROTLI_DECODER_RESULT_NEEDS_MORE_OUTPUT)
            throw Error(ErrorKind::malformed, "the Brotli stream is damaged or cut short");
        if (used == expected)
            throw Error(ErrorKind::malformed, "the Brotli stream holds more than the " + std::to_string(expected) + " bytes expected");
        buffer.grow(used, size_t(std::min<uint64_t>(expected, uint64_t{buffer.size} * 2)));
    }
    if (used != expected)
        throw Error(ErrorKind::malformed, "the Brotli stream holds " + std::to_string(used) + " bytes, " +
                                              std::to_string(expected) + " expected");
    if (input_left != 0) throw Error(ErrorKind::malformed, std::to_string(input_left) + " bytes after the Brotli stream");
    return buffer;
}

void read_position_records(const std::byte* records, size_t stride, PointBatch& out) {
    for (size_t i = 0; i < out.size; ++i, records += stride) {
        std::memcpy(&out.x[i], records, 4);
        std::memcpy(&out.y[i], records + 4, 4);
        std::memcpy(&out.z[i], records + 8, 4);
    }
}

template <size_t size_bytes>
void copy_strided(const std::byte* from, size_t stride, size_t points, std::byte* to) {
    for (size_t i = 0; i < points; ++i) std::memcpy(to + i * size_bytes, from + i * stride, size_bytes);
}

void read_column_records(const std::byte* records, size_t stride, size_t points, size_t size_bytes, std::byte* to) {
    switch (size_bytes) {  // a constant size makes each copy one load and one store
        case 1: return copy_strided<1>(records, stride, points, to);
        case 2: return copy_strided<2>(records, stride, points, to);
        case 4: return copy_strided<4>(records, stride, points, to);
        case 6: return copy_strided<6>(records, stride, points, to);
        case 8: return copy_strided<8>(records, stride, points, to);
        default:
            for (size_t i = 0; i < points; ++i) std::memcpy(to + i * size_bytes, records + i * stride, size_bytes);
    }
}

/// High code, then low code: each interleaves 16 bits of x, y and z, x at bit 0.
void read_position_codes(const std::byte* codes, PointBatch& out) {
    for (size_t i = 0; i < out.size; ++i) {
        const uint64_t high = load_u64(codes + 16 * i), low = load_u64(codes + 16 * i + 8);
        out.x[i] = int32_t(gather_third_bits(high) << 16 | gather_third_bits(low));
        out.y[i] = int32_t(gather_third_bits(high >> 1) << 16 | gather_third_bits(low >> 1));
        out.z[i] = int32_t(gather_third_bits(high >> 2) << 16 | gather_third_bits(low >> 2));
    }
}

void read_rgb_codes(const std::byte* codes, size_t points, std::byte* to) {
    for (size_t i = 0; i < points; ++i) {
        const uint64_t code = load_u64(codes + 8 * i);
        const uint16_t rgb[3] = {uint16_t(gather_third_bits(code)), uint16_t(gather_third_bits(code >> 1)),
                                 uint16_t(gather_third_bits(code >> 2))};
        std::memcpy(to + 6 * i, rgb, 6);
    }
}

}  // namespace

void decode_potree_node(const PotreeMetadata& metadata, std::span<const std::byte> stored, uint64_t points,
                        std::span<const int> wanted, PointBatch& out) {
    const bool plain = metadata.encoding == PotreeEncoding::plain;
    const uint64_t point_bytes = plain ? metadata.record_bytes : metadata.column_bytes;
    if (points > kMostNodeBytes / point_bytes)
        throw Error(ErrorKind::limit, std::to_string(points) + " points: a node of at most " +
                                          std::to_string(kMostNodeBytes >> 20) + " MiB can be read");
    if (plain && stored.size() != points * point_bytes)
        throw Error(ErrorKind::malformed, std::to_string(points) + " points of " + std::to_string(point_bytes) +
                                              " bytes expected, " + std::to_string(stored.size()) + " bytes found");
    Buffer decoded;
    if (!plain && points > 0) decoded = decode_brotli(stored, points * point_bytes);

    resize_batch(out, size_t(points), metadata.attributes, wanted);
    const std::byte* column = decoded.bytes.get();
    for (const PotreeField& field : metadata.fields) {
        const std::byte* record = stored.data() + field.record_offset;
        if (field.attribute < 0) {
            if (plain) read_position_records(record, metadata.record_bytes, out);
            else read_position_codes(column, out);
        } else if (std::vector<std::byte>& to = out.columns[size_t(field.attribute)]; !to.empty()) {
            if (plain) read_column_records(record, metadata.record_bytes, out.size, field.size_bytes, to.data());
            else if (field.rgb_morton) read_rgb_codes(column, out.size, to.data());
            else std::memcpy(to.data(), column, to.size());
        }
        column += field.packed_bytes * out.size;
    }
}

}  // namespace strata
