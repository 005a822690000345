#include "io/las/las_crs.h"

#include <algorithm>
#include <cctype>

#include "io/byte_reader.h"
#include "io/crs/geotiff_crs.h"

namespace strata::las {
namespace {

constexpr uint16_t kWktRecord = 2112, kGeoKeyRecord = 34735, kGeoDoubleRecord = 34736, kGeoTextRecord = 34737;
constexpr uint64_t kLargestWkt = 1 << 20;  // bytes; a real one has a few thousand

const VariableRecord* find_record(const Header& header, uint16_t record_id) {
    // An empty one is a placeholder that some writers leave.
    for (const VariableRecord& record : header.records)
        if (record.is("LASF_Projection", record_id) && record.size > 0) return &record;
    return nullptr;
}

std::string text_of(std::span<const std::byte> bytes) {
    std::string text = text_before_nul(bytes);
    while (!text.empty() && (text.back() == '|' || text.back() == ' ' || text.back() == '\n' || text.back() == '\r')) text.pop_back();
    // Some writers put '' where there is nothing to say.
    const bool says = std::any_of(text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
    return says ? text : std::string();
}

}  // namespace

void read_crs(const ByteSource& source, const Header& header, CloudInfo& info) {
    const auto leave_out = [&](const Error& error) {
        if (error.kind != ErrorKind::malformed) throw error;
        info.notes.push_back(std::string("the coordinate reference system is left out: ") + error.what());
    };
    try {
        for (const uint16_t id : {kGeoKeyRecord, kGeoDoubleRecord, kGeoTextRecord})
            if (const VariableRecord* const record = find_record(header, id))
                info.crs_records.push_back({id, read_record(source, *record, UINT16_MAX)});
    } catch (const Error& error) {
        info.crs_records.clear();
        leave_out(error);
    }
    try {
        if (const VariableRecord* const wkt = find_record(header, kWktRecord))
            if (info.crs = text_of(read_record(source, *wkt, kLargestWkt)); !info.crs.empty()) return;
        const auto bytes_of = [&](uint16_t id) -> std::span<const std::byte> {
            for (const CrsRecord& record : info.crs_records)
                if (record.id == id) return record.bytes;
            return {};
        };
        const std::span<const std::byte> directory = bytes_of(kGeoKeyRecord);
        if (directory.empty()) return;
        info.crs = crs_of_geotiff_keys(ByteReader(directory, source.name() + ": GeoTIFF keys", find_record(header, kGeoKeyRecord)->offset),
                                       bytes_of(kGeoDoubleRecord), bytes_of(kGeoTextRecord), info.notes);
    } catch (const Error& error) {
        leave_out(error);
    }
}

}  // namespace strata::las
