#include "io/las/laz_header.h"

#include <algorithm>
#include <array>
#include <string>

#include "core/error.h"
#include "io/byte_reader.h"
#include "io/las/las_layout.h"

namespace strata::las {
namespace {

constexpr uint64_t kFixedBytes = 34, kItemBytes = 6;
constexpr uint64_t kMostItems = 32;
constexpr uint32_t kChunksOfAnySize = 0xFFFFFFFF;

enum Compressor : uint16_t { kPointwise = 1, kPointwiseChunked = 2, kLayeredChunked = 3 };

struct ExpectedItem {
    LazItem item;                      // of the version that is written
    std::array<uint16_t, 3> versions;  // that exist; 0: none
};

// The items of a point format, in the order of its record; versions tell in what files they occur.
std::vector<ExpectedItem> expected_items(int point_format, size_t record_size) {
    using enum LazItemKind;
    const PointLayout layout = point_layout(point_format);
    std::vector<ExpectedItem> items;
    const auto add = [&](LazItemKind kind, size_t size, std::array<uint16_t, 3> versions) {
        const uint16_t written = kind == wave_packet13 ? 1 : layout.extended ? 3 : 2;
        items.push_back({{kind, uint16_t(size), written}, versions});
    };
    const bool extended = layout.extended;
    const std::array<uint16_t, 3> layered = {2, 3, 4}, pointwise = {1, 2, 0};
    if (extended) {
        add(point14, 30, layered);
        if (layout.nir) add(rgb_nir14, 8, layered);
        if (layout.rgb && !layout.nir) add(rgb14, 6, layered);
        if (layout.wave) add(wave_packet14, 29, {3, 4, 0});
    } else {
        add(point10, 20, pointwise);
        if (layout.gps_time) add(gps_time11, 8, pointwise);
        if (layout.rgb) add(rgb12, 6, pointwise);
        if (layout.wave) add(wave_packet13, 29, {1, 0, 0});
    }
    if (record_size > layout.size) add(extended ? bytes14 : bytes, record_size - layout.size, extended ? layered : pointwise);
    return items;
}

std::string text_of(const LazItem& item) {
    constexpr std::array<const char*, 15> kNames = {"byte",  "",          "",      "",             "",        "",      "point10",   "gpstime11",
                                                    "rgb12", "wavepacket13", "point14", "rgb14", "rgbnir14", "wavepacket14", "byte14"};
    const size_t kind = size_t(item.kind);
    const std::string name = kind < kNames.size() && *kNames[kind] ? kNames[kind] : "type " + std::to_string(kind);
    return name + " (" + std::to_string(item.size) + " bytes)";
}

void check_items(const ByteReader& reader, const Header& header, const std::vector<LazItem>& items) {
    const std::vector<ExpectedItem> expected = expected_items(header.point_format, header.record_size);
    const std::string record = "point format " + std::to_string(header.point_format) + " with records of " + std::to_string(header.record_size) + " bytes";
    for (size_t i = 0; i < std::max(items.size(), expected.size()); ++i) {
        const bool known = i < items.size(), wanted = i < expected.size();
        if (!known) reader.fail("item " + text_of(expected[i].item) + " is missing, " + record + " has it");
        if (!wanted || items[i].kind != expected[i].item.kind || items[i].size != expected[i].item.size)
            reader.fail("item " + std::to_string(i + 1) + " is " + text_of(items[i]) + ", " + record + " has " +
                        (wanted ? text_of(expected[i].item) : "no more"));
    }
    for (size_t i = 0; i < items.size(); ++i) {
        const auto& versions = expected[i].versions;
        if (items[i].version == 0 || std::find(versions.begin(), versions.end(), items[i].version) == versions.end())
            throw Error(ErrorKind::unsupported, "item " + text_of(items[i]) + " of version " + std::to_string(items[i].version) + " is not known");
    }
    // Versions 2 and 3 of layered items are the same; wave packets of formats 4 and 5 have one version only.
    const auto group = [](const LazItem& item) { return item.kind >= LazItemKind::point14 ? std::max<int>(item.version, 3) : item.version; };
    for (const LazItem& item : items)
        if (item.kind != LazItemKind::wave_packet13 && group(item) != group(items.front()))
            throw Error(ErrorKind::unsupported, "items of versions " + std::to_string(items.front().version) + " and " + std::to_string(item.version) + " in one file");
}

LazHeader parse(ByteReader& reader, const Header& header) {
    LazHeader laz;
    const uint16_t compressor = reader.read<uint16_t>(), coder = reader.read<uint16_t>();
    if (compressor < kPointwise || compressor > kLayeredChunked)
        throw Error(ErrorKind::unsupported, "compressor " + std::to_string(compressor) + ", compressors 1 to 3 are known");
    if (coder != 0) throw Error(ErrorKind::unsupported, "coder " + std::to_string(coder) + ", coder 0 (arithmetic) is known");
    laz.layered = compressor == kLayeredChunked;
    laz.chunked = compressor != kPointwise;
    if (laz.layered != point_layout(header.point_format).extended)
        reader.fail("compressor " + std::to_string(compressor) + " with point format " + std::to_string(header.point_format) +
                    ", formats 0 to 5 go with compressors 1 and 2, formats 6 to 10 with 3");
    reader.skip(8);  // version of the writer; options
    laz.chunk_points = reader.read<uint32_t>();
    if (laz.chunk_points == kChunksOfAnySize) laz.chunk_points = 0;  // some writers say so by 0 itself
    reader.skip(16);  // special records that no file has
    const uint16_t count = reader.read<uint16_t>();
    if (count > reader.left() / kItemBytes)
        reader.fail(std::to_string(count) + " items, there is room for " + std::to_string(reader.left() / kItemBytes));
    for (int i = 0; i < count; ++i) {
        LazItem item;
        item.kind = LazItemKind(reader.read<uint16_t>());
        item.size = reader.read<uint16_t>();
        item.version = reader.read<uint16_t>();
        laz.items.push_back(item);
    }
    check_items(reader, header, laz.items);
    return laz;
}

}  // namespace

std::vector<LazItem> laz_items(int point_format, size_t record_size) {
    std::vector<LazItem> items;
    for (const ExpectedItem& expected : expected_items(point_format, record_size)) items.push_back(expected.item);
    return items;
}

LazHeader read_laz_header(const ByteSource& source, const Header& header) {
    const auto record = std::find_if(header.records.begin(), header.records.end(),
                                     [](const VariableRecord& candidate) { return candidate.is("laszip encoded", 22204); });
    const std::string place = source.name() + ": record 'laszip encoded'";
    if (record == header.records.end()) throw Error(ErrorKind::malformed, place + " is missing, the point format says that the points are compressed");
    const std::vector<std::byte> payload = read_record(source, *record, kFixedBytes + kItemBytes * kMostItems);
    ByteReader reader(payload, place, record->offset);
    try {
        return parse(reader, header);
    } catch (const Error& error) {
        if (error.kind == ErrorKind::unsupported) throw error.within(place);
        throw;
    }
}

}  // namespace strata::las
