#include "tests/support/las_file.h"

#include <algorithm>

namespace strata::test {

void put_text(std::vector<std::byte>& out, const std::string& text, size_t size) {
    const size_t at = out.size();
    out.resize(at + size);
    std::memcpy(out.data() + at, text.data(), std::min(size, text.size()));
}

std::vector<std::byte> bytes_of(const std::string& text) {
    std::vector<std::byte> bytes(text.size());
    if (!text.empty()) std::memcpy(bytes.data(), text.data(), text.size());
    return bytes;
}

std::vector<std::byte> LasFile::bytes() const {
    const uint16_t header_size = minor_version >= 4 ? 375 : minor_version == 3 ? 235 : 227;
    size_t point_offset = header_size, record_bytes = records.empty() ? record_size : records.front().size();
    for (const Vlr& vlr : vlrs) point_offset += 54 + vlr.payload.size();
    const bool legacy = minor_version < 4 || point_format < 6;
    const auto by_return = [&](size_t i) { return i < points_by_return.size() ? points_by_return[i] : 0; };

    std::vector<std::byte> out;
    put_text(out, "LASF", 4);
    put<uint16_t>(out, 0);
    put<uint16_t>(out, global_encoding);
    put_text(out, "", 16);
    put<uint8_t>(out, 1);
    put<uint8_t>(out, uint8_t(minor_version));
    put_text(out, "strata test", 32);
    put_text(out, "las_file", 32);
    put<uint16_t>(out, 1);
    put<uint16_t>(out, 2026);
    put<uint16_t>(out, header_size);
    put<uint32_t>(out, uint32_t(point_offset));
    put<uint32_t>(out, uint32_t(vlrs.size()));
    put<uint8_t>(out, uint8_t(point_format));
    put<uint16_t>(out, uint16_t(record_bytes));
    put<uint32_t>(out, legacy ? uint32_t(records.size()) : 0);
    for (size_t i = 0; i < 5; ++i) put<uint32_t>(out, legacy ? uint32_t(by_return(i)) : 0);
    for (const double value : scale) put(out, value);
    for (const double value : offset) put(out, value);
    for (size_t axis = 0; axis < 3; ++axis) {
        put(out, max[axis]);
        put(out, min[axis]);
    }
    if (minor_version >= 3) put<uint64_t>(out, 0);
    if (minor_version >= 4) {
        put<uint64_t>(out, evlrs.empty() ? 0 : point_offset + records.size() * record_bytes);
        put<uint32_t>(out, uint32_t(evlrs.size()));
        put<uint64_t>(out, records.size());
        for (size_t i = 0; i < 15; ++i) put<uint64_t>(out, by_return(i));
    }
    for (const Vlr& vlr : vlrs) {
        put<uint16_t>(out, 0);
        put_text(out, vlr.user_id, 16);
        put<uint16_t>(out, vlr.record_id);
        put<uint16_t>(out, uint16_t(vlr.payload.size()));
        put_text(out, "", 32);
        out.insert(out.end(), vlr.payload.begin(), vlr.payload.end());
    }
    for (const std::vector<std::byte>& record : records) out.insert(out.end(), record.begin(), record.end());
    for (const Vlr& vlr : evlrs) {
        put<uint16_t>(out, 0);
        put_text(out, vlr.user_id, 16);
        put<uint16_t>(out, vlr.record_id);
        put<uint64_t>(out, vlr.payload.size());
        put_text(out, "", 32);
        out.insert(out.end(), vlr.payload.begin(), vlr.payload.end());
    }
    return out;
}

std::vector<std::byte> las_record(int point_format, const LasPoint& point) {
    std::vector<std::byte> out;
    put(out, point.x);
    put(out, point.y);
    put(out, point.z);
    put(out, point.intensity);
    const bool extended = point_format >= 6;
    if (extended) {
        put<uint8_t>(out, uint8_t(point.return_number | point.number_of_returns << 4));
        put(out, point.flags);
        put(out, point.classification);
        put(out, point.user_data);
        put(out, point.scan_angle);
    } else {
        put<uint8_t>(out, uint8_t(point.return_number | point.number_of_returns << 3 | (point.flags & 0xC0)));
        put<uint8_t>(out, uint8_t(point.classification | (point.flags & 7) << 5));
        put<int8_t>(out, int8_t(point.scan_angle));
        put(out, point.user_data);
    }
    put(out, point.point_source_id);
    if (extended || point_format == 1 || point_format == 3 || point_format == 4 || point_format == 5) put(out, point.gps_time);
    if (point_format == 2 || point_format == 3 || point_format == 5 || point_format == 7 || point_format == 8 || point_format == 10)
        for (const uint16_t channel : point.rgb) put(out, channel);
    if (point_format == 8 || point_format == 10) put(out, point.nir);
    if (point_format == 4 || point_format == 5 || point_format == 9 || point_format == 10) put_text(out, "", 29);
    return out;
}

std::vector<std::byte> extra_bytes_entry(const std::string& name, int data_type, uint8_t options, std::array<double, 3> scale,
                                         std::array<double, 3> offset, uint64_t no_data_bits) {
    std::vector<std::byte> out;
    put<uint16_t>(out, 0);
    put<uint8_t>(out, uint8_t(data_type));
    put<uint8_t>(out, options);
    put_text(out, name, 32);
    put<uint32_t>(out, 0);
    put(out, no_data_bits);
    put_text(out, "", 16 + 48);
    for (const double value : scale) put(out, value);
    for (const double value : offset) put(out, value);
    put_text(out, "of " + name, 32);
    return out;
}

}  // namespace strata::test
