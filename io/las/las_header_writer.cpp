#include "io/las/las_header_writer.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>

#include "core/error.h"

namespace strata::las {
namespace {

static_assert(std::endian::native == std::endian::little, "LAS is little-endian, and so are the machines strata runs on");

template <typename T>
void put(std::span<std::byte> bytes, size_t position, T value) {
    std::memcpy(bytes.data() + position, &value, sizeof value);
}

// Fixed-size text, padded with zeros.
void put_text(std::span<std::byte> bytes, size_t position, size_t size, std::string_view text) {
    std::memcpy(bytes.data() + position, text.data(), std::min(size, text.size()));
}

// Both kinds of record differ in the width of their size alone.
template <typename Size>
void append_any_header(std::vector<std::byte>& out, std::string_view user_id, uint16_t record_id, std::string_view description, Size size) {
    const size_t begin = out.size();
    out.resize(begin + 52 + sizeof size);
    const std::span<std::byte> bytes = std::span(out).subspan(begin);
    put_text(bytes, 2, 16, user_id);
    put(bytes, 18, record_id);
    put(bytes, 20, size);
    put_text(bytes, 20 + sizeof size, 32, description);
}

void put_legacy_counts(std::span<std::byte> bytes, const HeaderValues& values) {
    const bool fits = values.points <= std::numeric_limits<uint32_t>::max();
    if (values.point_format > 5 || !fits) return;
    put(bytes, 107, uint32_t(values.points));
    for (size_t i = 0; i < 5; ++i) put(bytes, 111 + 4 * i, uint32_t(values.points_by_return[i]));
}

}  // namespace

std::vector<std::byte> header_block(const HeaderValues& values) {
    std::vector<std::byte> bytes(header_bytes(values.minor_version));
    put_text(bytes, 0, 4, "LASF");
    put(bytes, 6, values.global_encoding);
    put(bytes, 24, uint8_t(1));
    put(bytes, 25, uint8_t(values.minor_version));
    put_text(bytes, 26, 32, values.system_identifier);
    put_text(bytes, 58, 32, values.generating_software);
    put(bytes, 90, values.creation_day);
    put(bytes, 92, values.creation_year);
    put(bytes, 94, uint16_t(bytes.size()));
    put(bytes, 96, values.point_offset);
    put(bytes, 100, values.records);
    put(bytes, 104, uint8_t(values.point_format | (values.compressed ? kCompressedBit : 0)));
    put(bytes, 105, values.record_size);
    put_legacy_counts(bytes, values);
    for (size_t axis = 0; axis < 3; ++axis) {
        const double scale = values.quantization.scale[Eigen::Index(axis)], offset = values.quantization.offset[Eigen::Index(axis)];
        put(bytes, 131 + 8 * axis, scale);
        put(bytes, 155 + 8 * axis, offset);
        if (values.points == 0) continue;
        put(bytes, 179 + 16 * axis, values.most[axis] * scale + offset);
        put(bytes, 187 + 16 * axis, values.least[axis] * scale + offset);
    }
    if (values.minor_version < 4) return bytes;
    put(bytes, 235, values.extended_offset);
    put(bytes, 243, values.extended_records);
    put(bytes, 247, values.points);
    for (size_t i = 0; i < values.points_by_return.size(); ++i) put(bytes, 255 + 8 * i, values.points_by_return[i]);
    return bytes;
}

void append_record(std::vector<std::byte>& out, std::string_view user_id, uint16_t record_id, std::string_view description,
                   std::span<const std::byte> payload) {
    if (payload.size() > std::numeric_limits<uint16_t>::max())
        throw Error(ErrorKind::limit, "record '" + std::string(user_id) + "', " + std::to_string(record_id) + ": " + std::to_string(payload.size()) +
                                          " bytes; a variable length record holds 65535");
    append_any_header(out, user_id, record_id, description, uint16_t(payload.size()));
    out.insert(out.end(), payload.begin(), payload.end());
}

void append_extended_record_header(std::vector<std::byte>& out, std::string_view user_id, uint16_t record_id,
                                   std::string_view description, uint64_t size) {
    append_any_header(out, user_id, record_id, description, size);
}

}  // namespace strata::las
