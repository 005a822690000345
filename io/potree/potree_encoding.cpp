#include "io/potree/potree_encoding.h"

#include <brotli/encode.h>

#include <algorithm>
#include <cstring>

#include "core/error.h"
#include "core/math/morton.h"

namespace strata {
namespace {

struct CodedPoint {
    uint64_t high, low;  // Morton codes of the upper and the lower 16 bits; x at bit 0, y at 1, z at 2
    const std::byte* record;
};

uint64_t interleave(uint32_t x, uint32_t y, uint32_t z) {
    return spread_bits_by_3(x) | spread_bits_by_3(y) << 1 | spread_bits_by_3(z) << 2;
}

std::vector<CodedPoint> sorted_points(std::span<const std::byte> records, size_t points) {
    const size_t record_size = records.size() / points;
    std::vector<CodedPoint> coded(points);
    for (size_t i = 0; i < points; ++i) {
        const std::byte* record = records.data() + i * record_size;
        uint32_t p[3];
        std::memcpy(p, record, sizeof p);
        coded[i] = {interleave(p[0] >> 16, p[1] >> 16, p[2] >> 16),
                    interleave(p[0] & 0xffff, p[1] & 0xffff, p[2] & 0xffff), record};
    }
    // The order of records breaks ties: it depends on the points alone.
    std::sort(coded.begin(), coded.end(), [](const CodedPoint& a, const CodedPoint& b) {
        if (a.high != b.high) return a.high < b.high;
        return a.low != b.low ? a.low < b.low : a.record < b.record;
    });
    return coded;
}

template <size_t size_bytes>
std::byte* put_column(const std::vector<CodedPoint>& points, size_t offset, std::byte* to) {
    for (const CodedPoint& point : points) {
        std::memcpy(to, point.record + offset, size_bytes);
        to += size_bytes;
    }
    return to;
}

std::byte* put_attribute(const std::vector<CodedPoint>& points, size_t offset, size_t size_bytes, std::byte* to) {
    switch (size_bytes) {
        case 1: return put_column<1>(points, offset, to);
        case 2: return put_column<2>(points, offset, to);
        case 4: return put_column<4>(points, offset, to);
        case 8: return put_column<8>(points, offset, to);
        default:
            for (const CodedPoint& point : points) {
                std::memcpy(to, point.record + offset, size_bytes);
                to += size_bytes;
            }
            return to;
    }
}

std::byte* put_codes_of_colors(const std::vector<CodedPoint>& points, size_t offset, std::byte* to) {
    for (const CodedPoint& point : points) {
        uint16_t rgb[3];
        std::memcpy(rgb, point.record + offset, sizeof rgb);
        const uint64_t code = interleave(rgb[0], rgb[1], rgb[2]);
        std::memcpy(to, &code, 8);
        to += 8;
    }
    return to;
}

}  // namespace

void append_brotli_node(std::span<const std::byte> records, size_t points, const std::vector<Attribute>& attributes, int quality,
                        std::vector<std::byte>& out) {
    const std::vector<CodedPoint> coded = sorted_points(records, points);
    std::vector<std::byte> arrays(points * (records.size() / points + 4 + 2));  // codes take 4 and 2 bytes more
    std::byte* to = arrays.data();
    for (const CodedPoint& point : coded) {
        std::memcpy(to, &point.high, 8);
        std::memcpy(to + 8, &point.low, 8);
        to += 16;
    }
    size_t offset = 12;
    for (const Attribute& attribute : attributes) {
        const bool color = attribute.name == attribute_name::kRgb && attribute.size_bytes() == 6;
        to = color ? put_codes_of_colors(coded, offset, to) : put_attribute(coded, offset, attribute.size_bytes(), to);
        offset += attribute.size_bytes();
    }
    const size_t arrays_size = size_t(to - arrays.data());
    size_t encoded_size = BrotliEncoderMaxCompressedSize(arrays_size);
    const size_t begin = out.size();
    out.resize(begin + encoded_size);
    if (!BrotliEncoderCompress(quality, BROTLI_DEFAULT_WINDOW, BROTLI_MODE_GENERIC, arrays_size,
                               reinterpret_cast<const uint8_t*>(arrays.data()), &encoded_size,
                               reinterpret_cast<uint8_t*>(out.data() + begin)))
        throw Error(ErrorKind::limit, "the Brotli encoder failed on " + std::to_string(arrays_size) + " bytes");
    out.resize(begin + encoded_size);
}

}  // namespace strata
