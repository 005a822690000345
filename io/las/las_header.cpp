#include "io/las/las_header.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/error.h"
#include "io/byte_reader.h"
#include "io/las/las_layout.h"

namespace strata::las {
namespace {

constexpr uint8_t kCompressionBits = 0xC0;  // of the point format byte, set by LASzip

// LAS 1.4 R15, section 2.4, table 3; the fields of later versions follow those of earlier ones.
struct RawHeader {
    uint16_t header_size = 0;
    uint32_t record_count = 0;
    uint32_t legacy_points = 0;
    uint64_t evlr_offset = 0;
    uint32_t evlr_count = 0;
};

void check_quantization(ByteReader& reader, const Quantization& quantization) {
    constexpr double kFarthest = -double(std::numeric_limits<int32_t>::min());  // quanta
    constexpr double kWholeSteps = 0x1p53;  // that a double tells apart
    constexpr uint64_t kScales = 131, kOffsets = 155;
    const size_t behind = reader.position();
    for (int axis = 0; axis < 3; ++axis) {
        const double scale = quantization.scale[axis], offset = quantization.offset[axis];
        const std::string name(1, "xyz"[axis]);
        reader.seek(kScales + 8 * uint64_t(axis));
        if (!(scale > 0.0) || !std::isfinite(scale))
            reader.fail(name + " scale is " + std::to_string(scale) + ", a positive number is expected");
        if (!std::isfinite(kFarthest * scale)) reader.fail(name + " scale and offset reach beyond all numbers");
        reader.seek(kOffsets + 8 * uint64_t(axis));
        if (!std::isfinite(offset)) reader.fail(name + " offset is " + std::to_string(offset) + ", a number is expected");
        if (std::abs(offset) / scale > kWholeSteps) {
            char numbers[80];
            std::snprintf(numbers, sizeof numbers, "%g leaves no room for steps of %g", offset, scale);
            reader.fail(name + " offset " + numbers);
        }
    }
    reader.seek(behind);
}

// In 1.4 the 64-bit count is the one that counts. The 32-bit count must equal it or be 0, but writers that filled in only
// the old one exist, and so do those that let the two differ.
void choose_point_count(Header& header, uint64_t points64, uint32_t legacy_points) {
    header.points = points64;
    if (points64 == 0) header.points = legacy_points;
    if (points64 != legacy_points && legacy_points != 0)
        header.notes.push_back("the header counts " + std::to_string(points64) + " points in 64 bits and " +
                               std::to_string(legacy_points) + " in 32");
}

RawHeader parse_header(ByteReader& reader, uint64_t file_size, Header& header) {
    RawHeader raw;
    reader.seek(6);
    header.global_encoding = reader.read<uint16_t>();
    reader.seek(24);
    const int major = reader.read<uint8_t>();
    header.minor_version = reader.read<uint8_t>();
    if (major != 1 || header.minor_version > 4)
        throw Error(ErrorKind::unsupported, "LAS version " + std::to_string(major) + "." + std::to_string(header.minor_version) +
                                                ", versions 1.0 to 1.4 are known");
    reader.seek(94);
    raw.header_size = reader.read<uint16_t>();
    const size_t least_size = header_bytes(header.minor_version);
    if (raw.header_size < least_size || raw.header_size > file_size)
        reader.fail("header size is " + std::to_string(raw.header_size) + ", LAS 1." + std::to_string(header.minor_version) + " has " +
                    std::to_string(least_size) + " bytes or more and the file " + std::to_string(file_size));
    header.point_offset = reader.read<uint32_t>();
    if (header.point_offset < raw.header_size || header.point_offset > file_size)
        reader.fail("point data offset is " + std::to_string(header.point_offset) + ", the header ends at " +
                    std::to_string(raw.header_size) + " and the file at " + std::to_string(file_size));
    raw.record_count = reader.read<uint32_t>();
    if (raw.record_count > (header.point_offset - raw.header_size) / kVlrHeaderBytes)
        reader.fail("the header counts " + std::to_string(raw.record_count) + " variable length records, the " +
                    std::to_string(header.point_offset - raw.header_size) + " bytes before the point data hold at most " +
                    std::to_string((header.point_offset - raw.header_size) / kVlrHeaderBytes));
    const uint8_t format = reader.read<uint8_t>();
    header.compressed = (format & kCompressionBits) != 0;
    header.point_format = format & ~kCompressionBits;
    if (header.point_format > kLastPointFormat)
        throw Error(ErrorKind::unsupported, "point format " + std::to_string(header.point_format) + ", formats 0 to 10 are known");
    header.record_size = reader.read<uint16_t>();
    const int least_record = point_layout(header.point_format).size;
    if (header.record_size < least_record)
        reader.fail("point record length is " + std::to_string(header.record_size) + ", point format " +
                    std::to_string(header.point_format) + " needs " + std::to_string(least_record) + " or more");
    raw.legacy_points = reader.read<uint32_t>();
    for (int i = 0; i < 5; ++i) header.points_by_return.push_back(reader.read<uint32_t>());
    for (int axis = 0; axis < 3; ++axis) header.quantization.scale[axis] = reader.read<double>();
    for (int axis = 0; axis < 3; ++axis) header.quantization.offset[axis] = reader.read<double>();
    check_quantization(reader, header.quantization);
    for (int axis = 0; axis < 3; ++axis) {
        header.bounds.max[axis] = reader.read<double>();
        header.bounds.min[axis] = reader.read<double>();
    }
    if (header.minor_version < 4) {
        header.points = raw.legacy_points;
        return raw;
    }
    reader.seek(235);
    raw.evlr_offset = reader.read<uint64_t>();
    raw.evlr_count = reader.read<uint32_t>();
    choose_point_count(header, reader.read<uint64_t>(), raw.legacy_points);
    std::vector<uint64_t> by_return(15);
    for (uint64_t& count : by_return) count = reader.read<uint64_t>();
    if (std::any_of(by_return.begin(), by_return.end(), [](uint64_t count) { return count != 0; })) header.points_by_return = by_return;
    return raw;
}

void check_point_data(Header& header, const std::string& name, uint64_t file_size, Damage damage) {
    const uint64_t room = (file_size - header.point_offset) / header.record_size;
    if (header.points <= room) return;
    const Error error(ErrorKind::malformed, name + ": point data: byte " + std::to_string(header.point_offset) + ": the header counts " +
                                                std::to_string(header.points) + " points of " + std::to_string(header.record_size) +
                                                " bytes, the file holds " + std::to_string(room));
    if (damage == Damage::refuse) throw error;
    header.points = room;
    header.notes.push_back(error.what());
}

// Appends `count` records that lie one after the other in [begin, end).
void list_records(const ByteSource& source, uint64_t begin, uint64_t end, uint64_t count, bool extended, std::vector<VariableRecord>& out) {
    const size_t header_size = extended ? kEvlrHeaderBytes : kVlrHeaderBytes;
    std::array<std::byte, kEvlrHeaderBytes> bytes;
    for (uint64_t i = 0; i < count; ++i) {
        const std::string place = source.name() + ": " + (extended ? "extended " : "") + "variable length record " + std::to_string(i + 1) +
                                  " of " + std::to_string(count);
        if (end - begin < header_size)
            throw Error(ErrorKind::malformed, place + ": byte " + std::to_string(begin) + ": " + std::to_string(header_size) +
                                                  " bytes needed, " + std::to_string(end - begin) + " left");
        const std::span<std::byte> header = std::span(bytes).first(header_size);
        source.read(begin, header);
        ByteReader reader(header, place, begin);
        reader.skip(2);  // reserved; 0xAABB in LAS 1.0
        VariableRecord record;
        record.user_id = reader.text(16);
        record.record_id = reader.read<uint16_t>();
        record.offset = begin + header_size;
        record.size = extended ? reader.read<uint64_t>() : reader.read<uint16_t>();
        if (record.size > end - record.offset)
            reader.fail("its length is " + std::to_string(record.size) + " bytes, " + std::to_string(end - record.offset) + " are left before " +
                        (extended ? "the end of the file" : "the point data"));
        begin = record.offset + record.size;
        out.push_back(std::move(record));
    }
}

void list_extended_records(const ByteSource& source, const RawHeader& raw, Header& header) {
    const uint64_t file_size = source.size();
    const uint64_t least_offset = header.compressed ? header.point_offset : header.point_offset + header.points * header.record_size;
    if (raw.evlr_offset < least_offset || raw.evlr_offset > file_size ||
        raw.evlr_count > (file_size - raw.evlr_offset) / kEvlrHeaderBytes)
        throw Error(ErrorKind::malformed, source.name() + ": header: byte 235: " + std::to_string(raw.evlr_count) +
                                              " extended variable length records at byte " + std::to_string(raw.evlr_offset) +
                                              ", they must lie between the end of the point data at " + std::to_string(least_offset) +
                                              " and the end of the file at " + std::to_string(file_size));
    list_records(source, raw.evlr_offset, file_size, raw.evlr_count, true, header.records);
}

}  // namespace

Header read_header(const ByteSource& source, Damage damage) {
    const std::string& name = source.name();
    const uint64_t file_size = source.size();
    std::array<std::byte, header_bytes(4)> bytes{};
    const std::span<std::byte> head = std::span(bytes).first(size_t(std::min<uint64_t>(bytes.size(), file_size)));
    source.read(0, head);

    ByteReader reader(head, name + ": header");
    Header header;
    if (reader.text(4) != "LASF") throw Error(ErrorKind::malformed, name + ": byte 0: 'LASF' is expected, the mark of a LAS file");
    RawHeader raw;
    try {
        raw = parse_header(reader, file_size, header);
    } catch (const Error& error) {
        if (error.kind == ErrorKind::unsupported) throw error.within(name + ": header");
        throw;
    }
    list_records(source, raw.header_size, header.point_offset, raw.record_count, false, header.records);
    header.compressed |= std::any_of(header.records.begin(), header.records.end(),
                                     [](const VariableRecord& record) { return record.is("laszip encoded", 22204); });
    header.stated_points = header.points;
    if (!header.compressed) check_point_data(header, name, file_size, damage);
    if (raw.evlr_count == 0) return header;
    try {
        list_extended_records(source, raw, header);
    } catch (const Error& error) {
        if (error.kind != ErrorKind::malformed || damage == Damage::refuse) throw;
        header.notes.push_back(error.what());
    }
    return header;
}

std::vector<std::byte> read_record(const ByteSource& source, const VariableRecord& record, uint64_t most) {
    if (record.size > most)
        throw Error(ErrorKind::malformed, source.name() + ": record '" + record.user_id + "' " + std::to_string(record.record_id) + ": byte " +
                                              std::to_string(record.offset) + ": " + std::to_string(record.size) + " bytes, at most " +
                                              std::to_string(most) + " are expected");
    std::vector<std::byte> payload(size_t(record.size));
    source.read(record.offset, payload);
    return payload;
}

}  // namespace strata::las
