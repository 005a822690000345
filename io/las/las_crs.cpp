#include "io/las/las_crs.h"

#include <algorithm>
#include <cctype>
#include <optional>

#include "io/byte_reader.h"

namespace strata::las {
namespace {

constexpr uint16_t kWktRecord = 2112, kGeoKeyRecord = 34735, kGeoTextRecord = 34737;
constexpr uint64_t kLargestWkt = 1 << 20;  // bytes; a real one has a few thousand

// GeoTIFF 1.0, section 6.2.
constexpr uint16_t kCitationKey = 1026, kGeographicTypeKey = 2048, kGeographicCitationKey = 2049, kProjectedTypeKey = 3072,
                   kProjectedCitationKey = 3073;
constexpr uint16_t kUserDefined = 32767;

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

struct GeoKey {
    uint16_t id, location, count, value;
};

std::vector<GeoKey> parse_keys(ByteReader reader) {
    reader.skip(6);  // versions of the directory
    const uint16_t count = reader.read<uint16_t>();
    if (count > reader.left() / sizeof(GeoKey))
        reader.fail(std::to_string(count) + " GeoTIFF keys, there is room for " + std::to_string(reader.left() / sizeof(GeoKey)));
    std::vector<GeoKey> keys(count);
    for (GeoKey& key : keys)
        key = {reader.read<uint16_t>(), reader.read<uint16_t>(), reader.read<uint16_t>(), reader.read<uint16_t>()};
    return keys;
}

std::string crs_from_keys(const std::vector<GeoKey>& keys, std::span<const std::byte> texts) {
    const auto find = [&](uint16_t id) -> const GeoKey* {
        const auto found = std::find_if(keys.begin(), keys.end(), [&](const GeoKey& key) { return key.id == id; });
        return found == keys.end() ? nullptr : &*found;
    };
    for (const uint16_t id : {kProjectedTypeKey, kGeographicTypeKey}) {
        const GeoKey* const key = find(id);
        if (key && key->location == 0 && key->value != 0 && key->value != kUserDefined) return "EPSG:" + std::to_string(key->value);
        if (key && key->location == 0 && key->value == kUserDefined) break;  // its base system is not the system
    }
    for (const uint16_t id : {kProjectedCitationKey, kCitationKey, kGeographicCitationKey}) {
        const GeoKey* const key = find(id);
        if (!key || key->location != kGeoTextRecord || key->value > texts.size() || key->count > texts.size() - key->value) continue;
        if (std::string text = text_of(texts.subspan(key->value, key->count)); !text.empty()) return text;
    }
    return {};
}

}  // namespace

std::string read_crs(const ByteSource& source, const Header& header, std::vector<std::string>& notes) {
    try {
        if (const VariableRecord* const wkt = find_record(header, kWktRecord))
            if (std::string text = text_of(read_record(source, *wkt, kLargestWkt)); !text.empty()) return text;
        const VariableRecord* const directory = find_record(header, kGeoKeyRecord);
        if (!directory) return {};
        const VariableRecord* const texts = find_record(header, kGeoTextRecord);
        const std::vector<std::byte> key_bytes = read_record(source, *directory, UINT16_MAX);
        const std::vector<std::byte> text_bytes = texts ? read_record(source, *texts, UINT16_MAX) : std::vector<std::byte>();
        return crs_from_keys(parse_keys(ByteReader(key_bytes, source.name() + ": GeoTIFF keys", directory->offset)), text_bytes);
    } catch (const Error& error) {
        if (error.kind != ErrorKind::malformed) throw;
        notes.push_back(std::string("the coordinate reference system is left out: ") + error.what());
        return {};
    }
}

}  // namespace strata::las
