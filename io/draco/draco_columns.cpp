#include "io/draco/draco_columns.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "io/draco/draco_layout.h"

namespace strata::drc {
namespace {

using namespace attribute_name;

constexpr int kMostComponents = 127;

Entries described(const Attribute& attribute) {
    Entries entries;
    if (!attribute.name.empty()) entries[std::string(kName)] = bytes_of(attribute.name);
    if (!attribute.description.empty()) entries[std::string(kDescription)] = bytes_of(attribute.description);
    if (attribute.scale != 1.0) entries[std::string(kValueScale)] = bytes_of(attribute.scale);
    if (attribute.offset != 0.0) entries[std::string(kValueOffset)] = bytes_of(attribute.offset);
    if (!std::isnan(attribute.no_data)) entries[std::string(kNoData)] = bytes_of(attribute.no_data);
    return entries;
}

// 0, -1, 1, -2, ... as 0, 1, 2, 3, ...
uint32_t zigzag(int32_t value) { return uint32_t(value) << 1 ^ uint32_t(value >> 31); }

// Bits that the values of a histogram take at least, by Shannon.
double entropy_bits(const std::vector<uint32_t>& counts, size_t total) {
    double bits = 0.0;
    for (const uint32_t count : counts)
        if (count > 0) bits -= count * std::log2(double(count) / double(total));
    return bits;
}

// What integers of at most 16 bits take, as they are and as differences from the point before.
struct ColumnBits {
    double plain = 0.0, delta = 0.0;
};

template <typename T>
ColumnBits small_column_bits(const std::vector<std::byte>& bytes, size_t components) {
    const size_t count = bytes.size() / sizeof(T);
    std::vector<uint32_t> plain(2 << (8 * sizeof(T))), delta(plain.size());
    std::vector<int32_t> before(components, 0);
    for (size_t i = 0; i < count; ++i) {
        T value;
        std::memcpy(&value, bytes.data() + i * sizeof value, sizeof value);
        ++plain[zigzag(value)];
        ++delta[zigzag(int32_t(value) - before[i % components])];
        before[i % components] = value;
    }
    return {entropy_bits(plain, count), entropy_bits(delta, count)};
}

// Integers of 32 bits: the digits of the largest difference of a point, and how many these are. That is how Draco codes them.
template <typename ValueAt>
double wide_column_bits(size_t count, size_t components, ValueAt value_at) {
    std::vector<uint32_t> widths(64);
    double bits = 0.0;
    for (size_t i = 1; i < count; ++i) {
        double most = 0.0;
        for (size_t c = 0; c < components; ++c) most = std::max(most, std::abs(value_at(i, c) - value_at(i - 1, c)));
        const int width = std::bit_width(uint64_t(2.0 * most));
        ++widths[size_t(width)];
        bits += double(components) * width;
    }
    return bits + entropy_bits(widths, count);
}

double wide_column_bits(ScalarType type, const std::vector<std::byte>& values, int components) {
    const size_t size = scalar_size(type), width = size * size_t(components);
    return wide_column_bits(values.size() / width, size_t(components),
                            [&](size_t i, size_t c) { return load_scalar(type, values.data() + i * width + c * size); });
}

ColumnBits column_bits(ScalarType type, const std::vector<std::byte>& values, int components) {
    switch (type) {
        case ScalarType::int8: return small_column_bits<int8_t>(values, size_t(components));
        case ScalarType::uint8: return small_column_bits<uint8_t>(values, size_t(components));
        case ScalarType::int16: return small_column_bits<int16_t>(values, size_t(components));
        case ScalarType::uint16: return small_column_bits<uint16_t>(values, size_t(components));
        default: return {};
    }
}

// Draco codes integers as int32, and counts how often each comes: those that lie close together go as they are.
bool is_narrow(ScalarType type, const std::vector<std::byte>& values) {
    double low = 0.0, high = 0.0;
    for (size_t at = 0; at < values.size(); at += scalar_size(type)) {
        const double value = load_scalar(type, values.data() + at);
        low = at == 0 ? value : std::min(low, value);
        high = at == 0 ? value : std::max(high, value);
    }
    return high <= std::numeric_limits<int32_t>::max() && high - low < 1 << 20;
}

// Differences from point to point of the bits of wide scalars, in words of 16 bits; draco_layout.h says how.
template <typename Unsigned>
void add_words(const Attribute& attribute, const std::vector<std::byte>& values, ColumnSet& set) {
    std::vector<EncoderColumn>& columns = set.columns;
    constexpr size_t kWords = sizeof(Unsigned) / 2;
    const size_t count = values.size() / sizeof(Unsigned), components = size_t(attribute.components), first = columns.size();
    for (size_t word = 0; word < kWords; ++word) {
        EncoderColumn column{.header = {.kind = AttributeKind::generic, .type = ScalarType::uint16, .components = attribute.components}};
        column.metadata = described(attribute);
        column.metadata[std::string(kType)] = bytes_of(std::string(scalar_name(attribute.type)));
        column.metadata[std::string(kWord)] = bytes_of(int32_t(word));
        column.values.resize(count * 2);
        columns.push_back(std::move(column));
    }
    std::vector<Unsigned> before(components, 0);
    for (size_t i = 0; i < count; ++i) {
        Unsigned bits;
        std::memcpy(&bits, values.data() + i * sizeof bits, sizeof bits);
        const Unsigned difference = bits - before[i % components], sign = Unsigned(0) - (difference >> (8 * sizeof bits - 1));
        before[i % components] = bits;
        const Unsigned coded = Unsigned(difference << 1) ^ sign;
        for (size_t word = 0; word < kWords; ++word) {
            const uint16_t part = uint16_t(coded >> (16 * word));
            std::memcpy(columns[first + word].values.data() + 2 * i, &part, sizeof part);
        }
    }
    for (size_t word = 0; word < kWords; ++word) set.bits += column_bits(ScalarType::uint16, columns[first + word].values, attribute.components).plain;
}

void add_column(AttributeHeader header, const Attribute& attribute, std::vector<std::byte> values, ColumnSet& set) {
    EncoderColumn column{.header = header, .values = std::move(values)};
    if (scalar_size(header.type) <= 2) {
        const ColumnBits bits = column_bits(header.type, column.values, header.components);
        column.delta = bits.delta < bits.plain;
        set.bits += std::min(bits.plain, bits.delta);
    } else if (header.type != ScalarType::float32) {
        column.delta = true;
        set.bits += wide_column_bits(header.type, column.values, header.components);
    }
    if (header.kind == AttributeKind::generic) column.metadata = described(attribute);
    set.columns.push_back(std::move(column));
}

void add_color(const Attribute& attribute, const std::vector<std::byte>& values, int bits, ColumnSet& set) {
    AttributeHeader header{.kind = AttributeKind::color, .type = ScalarType::uint16, .components = 3, .normalized = true};
    if (bits > 8) return add_column(header, attribute, values, set);
    header.type = ScalarType::uint8;
    std::vector<std::byte> low(values.size() / 2);
    for (size_t i = 0; i < low.size(); ++i) low[i] = values[2 * i];  // the lower byte comes first
    add_column(header, attribute, std::move(low), set);
}

bool is_color(const Attribute& attribute) {
    return attribute.name == kRgb && attribute.type == ScalarType::uint16 && attribute.components == 3;
}

bool is_one_float(const std::vector<Attribute>& attributes, std::string_view name) {
    const int index = find_attribute(attributes, name);
    return index >= 0 && attributes[size_t(index)].type == ScalarType::float32 && attributes[size_t(index)].components == 1;
}

bool has_normals(const std::vector<Attribute>& attributes) {
    return std::all_of(std::begin(kNormal), std::end(kNormal), [&](std::string_view name) { return is_one_float(attributes, name); });
}

bool is_normal_component(const Attribute& attribute) { return std::find(std::begin(kNormal), std::end(kNormal), attribute.name) != std::end(kNormal); }

void add_normals(const PointBatch& points, const std::vector<Attribute>& attributes, ColumnSet& set) {
    EncoderColumn column{.header = {.kind = AttributeKind::normal, .type = ScalarType::float32, .components = 3}};
    column.values.resize(points.size * 3 * sizeof(float));
    for (size_t axis = 0; axis < 3; ++axis) {
        const std::vector<std::byte>& from = points.columns[size_t(find_attribute(attributes, kNormal[axis]))];
        for (size_t i = 0; i < points.size; ++i) std::memcpy(column.values.data() + (3 * i + axis) * sizeof(float), from.data() + i * sizeof(float), sizeof(float));
    }
    set.columns.push_back(std::move(column));
}

void add_attribute(const Attribute& attribute, const std::vector<std::byte>& values, ColumnSet& set) {
    if (attribute.components > kMostComponents)
        throw Error(ErrorKind::unsupported, "attribute '" + attribute.name + "' has " + std::to_string(attribute.components) + " components, Draco holds " + std::to_string(kMostComponents));
    const size_t size = scalar_size(attribute.type);
    const bool plain = size <= 2 || attribute.type == ScalarType::float32 || (size == 4 && is_narrow(attribute.type, values));
    if (plain)
        add_column({.kind = AttributeKind::generic, .type = attribute.type, .components = attribute.components}, attribute, values, set);
    else if (size == 4)
        add_words<uint32_t>(attribute, values, set);
    else
        add_words<uint64_t>(attribute, values, set);
}

template <typename T>
double position_bits_of(const EncoderColumn& column, const std::vector<uint32_t>& order, double steps) {
    const size_t count = column.values.size() / (3 * sizeof(T));
    return wide_column_bits(count, 3, [&](size_t i, size_t c) {
        T value;
        std::memcpy(&value, column.values.data() + (3 * (order.empty() ? i : size_t(order[i])) + c) * sizeof value, sizeof value);
        return double(value) * steps;
    });
}

}  // namespace

std::vector<std::byte> bytes_of(const std::string& text) {
    std::vector<std::byte> bytes(text.size());
    std::copy_n(reinterpret_cast<const std::byte*>(text.data()), text.size(), bytes.begin());
    return bytes;
}

double position_bits(const EncoderColumn& column, const std::vector<uint32_t>& order) {
    return column.header.type == ScalarType::float32 ? position_bits_of<float>(column, order, 1.0 / double(column.step)) : position_bits_of<int32_t>(column, order, 1.0);
}

void add_attributes(const PointBatch& points, const std::vector<Attribute>& attributes, int rgb_bits, ColumnSet& set) {
    const bool normals = has_normals(attributes);
    for (size_t i = 0; i < attributes.size(); ++i) {
        const Attribute& attribute = attributes[i];
        if (is_color(attribute))
            add_color(attribute, points.columns[i], rgb_bits, set);
        else if (normals && is_normal_component(attribute)) {
            if (attribute.name == kNormal[0]) add_normals(points, attributes, set);
        } else
            add_attribute(attribute, points.columns[i], set);
    }
}

uint64_t encoding_bytes(uint64_t points, const std::vector<Attribute>& attributes) {
    std::vector<AttributeHeader> headers = {{.kind = AttributeKind::position, .type = ScalarType::float32, .components = 3}};
    uint64_t record = 12;
    for (const Attribute& attribute : attributes) {
        record += attribute.size_bytes();
        const size_t words = scalar_size(attribute.type) > 2 && attribute.type != ScalarType::float32 ? scalar_size(attribute.type) / 2 : 1;
        for (size_t word = 0; word < words; ++word)
            headers.push_back({.type = words > 1 ? ScalarType::uint16 : attribute.type, .components = attribute.components});
    }
    // The points and their columns in two orders, with the keys of one; the encoder's copy; what decoding takes to check them.
    return points > UINT32_MAX ? UINT64_MAX : points * (4 * record + 20) + decoding_bytes(points, headers);
}

}  // namespace strata::drc
