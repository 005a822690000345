#include "io/las/las_extra_bytes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "io/byte_reader.h"
#include "io/las/las_layout.h"

namespace strata::las {
namespace {

enum Option : uint8_t { kHasNoData = 1, kHasScale = 8, kHasOffset = 16 };

struct Entry {
    std::string name, description;
    ScalarType type = ScalarType::uint8;
    int components = 1;
    std::array<double, 3> scale = {1.0, 1.0, 1.0}, offset = {0.0, 0.0, 0.0};
    double no_data = std::numeric_limits<double>::quiet_NaN();
};

// Types 1 to 10 are scalars, 11 to 20 and 21 to 30 arrays of two and three of them, deprecated since 1.4 R13.
ScalarType scalar_of(int data_type) {
    using enum ScalarType;
    constexpr std::array kTypes = {uint8, int8, uint16, int16, uint32, int32, uint64, int64, float32, float64};
    return kTypes[size_t(data_type - 1) % kTypes.size()];
}

// no_data, min and max are stored in 8 bytes as the widest type of the same kind.
double load_any(ScalarType type, std::span<const std::byte> bytes) {
    using enum ScalarType;
    if (type == float32 || type == float64) return load_scalar(float64, bytes.data());
    const bool is_signed = type == int8 || type == int16 || type == int32 || type == int64;
    return load_scalar(is_signed ? int64 : uint64, bytes.data());
}

Entry parse_entry(ByteReader& reader) {
    Entry entry;
    reader.skip(2);
    const int data_type = reader.read<uint8_t>();
    const uint8_t options = reader.read<uint8_t>();
    if (data_type > 30) reader.fail("extra bytes of type " + std::to_string(data_type) + ", types 0 to 30 are known");
    entry.name = reader.text(32);
    reader.skip(4);
    const std::span<const std::byte> no_data = reader.take(24);
    reader.skip(48);  // min and max: what a writer thought they are
    for (double& scale : entry.scale) scale = reader.read<double>();
    for (double& offset : entry.offset) offset = reader.read<double>();
    entry.description = reader.text(32);
    if (data_type == 0) {  // undocumented: `options` bytes
        entry.components = options;
        entry.scale = {1.0, 1.0, 1.0};
        entry.offset = {};
        return entry;
    }
    entry.type = scalar_of(data_type);
    entry.components = 1 + (data_type - 1) / 10;
    if (options & kHasNoData) entry.no_data = load_any(entry.type, no_data);
    for (int c = 0; c < 3; ++c) {
        if (!(options & kHasScale)) entry.scale[size_t(c)] = 1.0;
        if (!(options & kHasOffset)) entry.offset[size_t(c)] = 0.0;
        if (c >= entry.components) continue;
        if (!std::isfinite(entry.scale[size_t(c)]) || entry.scale[size_t(c)] == 0.0 || !std::isfinite(entry.offset[size_t(c)]))
            reader.fail("extra bytes '" + entry.name + "': scale " + std::to_string(entry.scale[size_t(c)]) + " and offset " +
                        std::to_string(entry.offset[size_t(c)]) + ", numbers are expected, the scale not 0");
    }
    return entry;
}

bool scaled_alike(const Entry& entry) {
    if (entry.components > 3) return true;
    for (int c = 1; c < entry.components; ++c)
        if (entry.scale[size_t(c)] != entry.scale[0] || entry.offset[size_t(c)] != entry.offset[0]) return false;
    return true;
}

bool stored_alike(const Attribute& a, const Attribute& b) {
    const bool same_no_data = a.no_data == b.no_data || (std::isnan(a.no_data) && std::isnan(b.no_data));
    return a.type == b.type && a.scale == b.scale && a.offset == b.offset && same_no_data && a.description == b.description;
}

// How many attributes from the first on are the components NAME[0], NAME[1], ... of one.
size_t components_of_one(std::span<const ExtraAttribute> list) {
    const Attribute& first = list[0].attribute;
    if (!first.name.ends_with("[0]") || first.name.size() == 3 || first.components != 1) return 1;
    const std::string base = first.name.substr(0, first.name.size() - 3);
    size_t count = 1;
    bool alike = true;
    for (; count < list.size() && list[count].attribute.name == base + "[" + std::to_string(count) + "]"; ++count)
        alike &= list[count].attribute.components == 1 && stored_alike(list[count].attribute, first);
    return alike ? count : 1;
}

// Arrays are written as an entry a component since their types are deprecated.
std::vector<ExtraAttribute> join_components(std::span<const ExtraAttribute> list) {
    std::vector<ExtraAttribute> joined;
    while (!list.empty()) {
        const size_t components = components_of_one(list);
        ExtraAttribute& attribute = joined.emplace_back(list[0]);
        if (components > 1) {
            attribute.attribute.name.resize(attribute.attribute.name.size() - 3);
            attribute.attribute.components = int(components);
        }
        list = list.subspan(components);
    }
    return joined;
}

void append(const Entry& entry, uint16_t record_offset, std::vector<ExtraAttribute>& out) {
    Attribute attribute{.name = entry.name,
                        .description = entry.description,
                        .type = entry.type,
                        .components = entry.components,
                        .scale = entry.scale[0],
                        .offset = entry.offset[0],
                        .no_data = entry.no_data};
    if (scaled_alike(entry)) {
        out.push_back({std::move(attribute), record_offset});
        return;
    }
    attribute.components = 1;
    for (int c = 0; c < entry.components; ++c) {
        attribute.name = entry.name + "[" + std::to_string(c) + "]";
        attribute.scale = entry.scale[size_t(c)];
        attribute.offset = entry.offset[size_t(c)];
        out.push_back({attribute, uint16_t(record_offset + size_t(c) * scalar_size(entry.type))});
    }
}

}  // namespace

std::vector<ExtraAttribute> read_extra_bytes(const ByteSource& source, const Header& header, std::vector<std::string>& notes) {
    std::vector<ExtraAttribute> attributes;
    size_t begin = point_layout(header.point_format).size;
    // Some writers append a record for each attribute they add, others leave one behind that the new one replaces.
    bool first = true;
    for (const VariableRecord& record : header.records) {
        if (!record.is("LASF_Spec", 4) || (!first && begin == header.record_size)) continue;
        first = false;
        const std::vector<std::byte> payload = read_record(source, record, UINT16_MAX);
        ByteReader reader(payload, source.name() + ": extra bytes", record.offset);
        if (payload.size() % kExtraBytesRecordBytes != 0)
            reader.fail(std::to_string(payload.size()) + " bytes, a multiple of " + std::to_string(kExtraBytesRecordBytes) +
                        " is expected");
        while (reader.left() > 0) {
            const Entry entry = parse_entry(reader);
            const size_t size = scalar_size(entry.type) * size_t(entry.components);
            if (begin + size > header.record_size)
                reader.fail("'" + entry.name + "' ends at byte " + std::to_string(begin + size) + " of a point, a point has " +
                            std::to_string(header.record_size));
            if (size > 0) append(entry, uint16_t(begin), attributes);
            begin += size;
        }
    }
    if (begin < header.record_size)
        notes.push_back(std::to_string(header.record_size - begin) +
                        " bytes at the end of each point have no description and are left out");
    return join_components(attributes);
}

}  // namespace strata::las
