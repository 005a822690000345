#include "io/draco/draco_block.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/cloud/rgb_depth.h"
#include "core/error.h"
#include "io/draco/draco_encoder.h"
#include "io/draco/draco_layout.h"

namespace strata::drc {
namespace {

using namespace attribute_name;

constexpr int kMostBits = 23;                   // of steps: Draco adds half a step in float32, which then is still exact
constexpr double kMostFloatSteps = 1 << 24;     // from zero, that float32 holds exactly
constexpr int64_t kMostIntegerSteps = 1 << 25;  // Draco counts how often each difference comes: 4 bytes a step
constexpr int kMostComponents = 127;

template <typename T>
std::vector<std::byte> bytes_of(const T& value) {
    std::vector<std::byte> bytes(sizeof value);
    std::memcpy(bytes.data(), &value, sizeof value);
    return bytes;
}

std::vector<std::byte> bytes_of(const std::string& text) {
    std::vector<std::byte> bytes(text.size());
    std::copy_n(reinterpret_cast<const std::byte*>(text.data()), text.size(), bytes.begin());
    return bytes;
}

std::vector<std::byte> bytes_of(const Vec3d& v) { return bytes_of(std::array{v.x(), v.y(), v.z()}); }
std::vector<std::byte> bytes_of(const Vec3i& v) { return bytes_of(std::array{v.x(), v.y(), v.z()}); }

// The quanta of a batch, an axis each.
std::array<const std::vector<int32_t>*, 3> axes_of(const PointBatch& points) { return {&points.x, &points.y, &points.z}; }

// Positions as they go into a file, and what a reader needs to know of them.
struct Places {
    EncoderColumn column;
    Vec3i origin = Vec3i::Zero();      // quanta of the source where POSITION is zero
    Vec3d scale = Vec3d::Ones();       // world units: world = world of origin + scale * POSITION
    Vec3d grid_scale = Vec3d::Ones();  // of the quanta that a point is read back as
    bool exact = true;                 // these are the source's
    Box3d bounds;                      // world, as read back
};

// The range of a batch, an axis each.
struct QuantaRange {
    std::array<int32_t, 3> min{}, max{};
};

QuantaRange range_of(const PointBatch& points) {
    QuantaRange range;
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto [low, high] = std::minmax_element(axes_of(points)[axis]->begin(), axes_of(points)[axis]->end());
        range.min[axis] = *low;
        range.max[axis] = *high;
    }
    return range;
}

// What each axis of a block may be off by, which as a default is no less than there are integer steps for.
Vec3d error_of(const BlockFrame& frame, const QuantaRange& range) {
    if (frame.max_error > 0.0) return Vec3d::Constant(frame.max_error);
    Vec3d error;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double extent = double(range.max[axis]) - range.min[axis];  // quanta
        error[Eigen::Index(axis)] = frame.quantization.scale[Eigen::Index(axis)] * std::max(0.5, extent / double(kMostIntegerSteps));
    }
    return error;
}

// The greatest power of two that is at most `value`.
double power_of_two_below(double value) { return std::ldexp(1.0, std::ilogb(value)); }

// Positions as float32 on a grid of a power of two, the coarsest that the error allows: every decoder's arithmetic is exact
// on it. Points that span more steps than float32 has room for cannot be written so; then false.
bool place_on_grid(const PointBatch& points, const BlockFrame& frame, const QuantaRange& range, const Vec3d& max_error, Places& places) {
    const double step = power_of_two_below(2.0 * max_error.minCoeff());
    if (!(step > 0x1p-60 && step < 0x1p60)) return false;
    const Vec3d& scale = frame.quantization.scale;
    std::array<double, 3> low, high;  // steps
    bool near = true;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double ratio = scale[Eigen::Index(axis)] / step, zero = frame.origin[Eigen::Index(axis)];
        low[axis] = std::nearbyint((range.min[axis] - zero) * ratio);
        high[axis] = std::nearbyint((range.max[axis] - zero) * ratio);
        near = near && low[axis] >= -kMostFloatSteps && high[axis] <= kMostFloatSteps;
    }
    places.origin = frame.origin;
    if (!near)  // far from the others: zero is in its own corner
        for (size_t axis = 0; axis < 3; ++axis) {
            places.origin[Eigen::Index(axis)] = range.min[axis];
            low[axis] = 0.0;
            high[axis] = std::nearbyint((double(range.max[axis]) - range.min[axis]) * (scale[Eigen::Index(axis)] / step));
        }
    double most = 0.0;
    for (size_t axis = 0; axis < 3; ++axis) most = std::max(most, high[axis] - low[axis]);
    if (most >= double(1 << kMostBits)) return false;

    places.column = {.header = {.kind = AttributeKind::position, .type = ScalarType::float32, .components = 3}};
    places.column.bits = std::max(1, int(std::bit_width(uint64_t(most))));
    places.column.step = float(step);
    places.column.values.resize(points.size * 3 * sizeof(float));
    places.scale = Vec3d::Ones();
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto a = Eigen::Index(axis);
        const double ratio = scale[a] / step, zero = places.origin[a];
        const std::vector<int32_t>& quanta = *axes_of(points)[axis];
        for (size_t i = 0; i < points.size; ++i) {
            const float value = float(std::nearbyint((quanta[i] - zero) * ratio) * step);
            std::memcpy(places.column.values.data() + (3 * i + axis) * sizeof value, &value, sizeof value);
        }
        // On steps finer than the source's, the nearest of its quanta is the one that was there.
        const bool restored = step <= scale[a];
        places.exact = places.exact && restored;
        places.grid_scale[a] = restored ? scale[a] : step;
        const double offset = frame.quantization.offset[a] + zero * scale[a];
        places.bounds.min[a] = restored ? range.min[axis] * scale[a] + frame.quantization.offset[a] : offset + low[axis] * step;
        places.bounds.max[a] = restored ? range.max[axis] * scale[a] + frame.quantization.offset[a] : offset + high[axis] * step;
    }
    return true;
}

int64_t floor_divided(int64_t value, int64_t by) { return value >= 0 ? value / by : -((-value + by - 1) / by); }

// Positions as integers, every k-th of the source's quanta with odd k: any range and any scale an axis, and exact where the
// error asks for it, but other programs see steps, not world units.
void place_on_quanta(const PointBatch& points, const BlockFrame& frame, const QuantaRange& range, const Vec3d& max_error, Places& places) {
    places.column = {.header = {.kind = AttributeKind::position, .type = ScalarType::int32, .components = 3}, .delta = true};
    places.column.values.resize(points.size * 3 * sizeof(int32_t));
    places.exact = true;
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto a = Eigen::Index(axis);
        const double scale = frame.quantization.scale[a];
        // A whole number of quanta that the error holds, whatever the rounding of both as decimals.
        const int64_t half = int64_t(std::min(std::floor(max_error[a] / scale + 1e-9), 0x1p31)), k = 2 * half + 1;
        const int64_t spread = (int64_t(range.max[axis]) - range.min[axis]) / k;
        if (spread > kMostIntegerSteps)
            throw Error(ErrorKind::limit, std::string("along ") + "xyz"[axis] + " points are " + std::to_string(spread) + " steps of the error apart, at most " +
                                              std::to_string(kMostIntegerSteps) + " can be compressed; a greater --max-error is needed");
        const int64_t zero = frame.origin[a], least = floor_divided(range.min[axis] - zero + half, k), greatest = floor_divided(range.max[axis] - zero + half, k);
        const bool near = least >= std::numeric_limits<int32_t>::min() / 2 && greatest <= std::numeric_limits<int32_t>::max() / 2;
        places.origin[a] = near ? frame.origin[a] : range.min[axis];
        const std::vector<int32_t>& quanta = *axes_of(points)[axis];
        for (size_t i = 0; i < points.size; ++i) {
            const int32_t value = int32_t(floor_divided(int64_t(quanta[i]) - places.origin[a] + half, k));
            std::memcpy(places.column.values.data() + (3 * i + axis) * sizeof value, &value, sizeof value);
        }
        places.scale[a] = scale * double(k);
        places.grid_scale[a] = scale;
        places.exact = places.exact && k == 1;
        const auto world = [&](int64_t q) {
            return double(places.origin[a] + floor_divided(q - places.origin[a] + half, k) * k) * scale + frame.quantization.offset[a];
        };
        places.bounds.min[a] = world(range.min[axis]);
        places.bounds.max[a] = world(range.max[axis]);
    }
}

Entries metadata_of(const Places& places, const CloudInfo& info, const BlockFrame& frame, const Vec3d& max_error) {
    const Quantization& source = frame.quantization;
    const Vec3d zero = source.world_from_quanta(places.origin);
    Vec3d grid_offset = source.offset;
    Vec3i grid_origin = places.origin;
    for (int axis = 0; axis < 3; ++axis)
        if (places.grid_scale[axis] != source.scale[axis]) {
            grid_offset[axis] = zero[axis];
            grid_origin[axis] = 0;
        }
    Entries entries;
    const auto put = [&](std::string_view key, std::vector<std::byte> value) {
        if (!value.empty()) entries[std::string(key)] = std::move(value);
    };
    put(kLayout, bytes_of(int32_t{1}));
    put(kScale, bytes_of(places.scale));
    put(kOffset, bytes_of(zero));
    put(kMin, bytes_of(places.bounds.min));
    put(kMax, bytes_of(places.bounds.max));
    put(kMaxError, bytes_of(max_error));
    put(kGridScale, bytes_of(places.grid_scale));
    put(kGridOffset, bytes_of(grid_offset));
    put(kGridOrigin, bytes_of(grid_origin));
    put(kCrs, bytes_of(info.crs));
    return entries;
}

Entries described(const Attribute& attribute) {
    Entries entries;
    if (!attribute.name.empty()) entries[std::string(kName)] = bytes_of(attribute.name);
    if (!attribute.description.empty()) entries[std::string(kDescription)] = bytes_of(attribute.description);
    if (attribute.scale != 1.0) entries[std::string(kValueScale)] = bytes_of(attribute.scale);
    if (attribute.offset != 0.0) entries[std::string(kValueOffset)] = bytes_of(attribute.offset);
    if (!std::isnan(attribute.no_data)) entries[std::string(kNoData)] = bytes_of(attribute.no_data);
    return entries;
}

uint32_t zigzag(int32_t value) { return uint32_t(value) << 1 ^ uint32_t(value >> 31); }

// Bits that the values of a histogram take at least, by Shannon.
double entropy_bits(const std::vector<uint32_t>& counts, size_t total) {
    double bits = 0.0;
    for (const uint32_t count : counts)
        if (count > 0) bits -= count * std::log2(double(count) / double(total));
    return bits;
}

// Whether integers of at most 16 bits take less as differences from the point before than as they are.
template <typename T>
bool is_better_as_delta(const std::vector<std::byte>& bytes, size_t components) {
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
    return entropy_bits(delta, count) < entropy_bits(plain, count);
}

bool is_better_as_delta(ScalarType type, const std::vector<std::byte>& values, int components) {
    switch (type) {
        case ScalarType::int8: return is_better_as_delta<int8_t>(values, size_t(components));
        case ScalarType::uint8: return is_better_as_delta<uint8_t>(values, size_t(components));
        case ScalarType::int16: return is_better_as_delta<int16_t>(values, size_t(components));
        case ScalarType::uint16: return is_better_as_delta<uint16_t>(values, size_t(components));
        default: return true;
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
void add_words(const Attribute& attribute, const std::vector<std::byte>& values, std::vector<EncoderColumn>& columns) {
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
}

void add_column(AttributeHeader header, const Attribute& attribute, std::vector<std::byte> values, std::vector<EncoderColumn>& columns) {
    EncoderColumn column{.header = header, .values = std::move(values)};
    column.delta = is_better_as_delta(header.type, column.values, header.components);
    if (header.kind == AttributeKind::generic) column.metadata = described(attribute);
    columns.push_back(std::move(column));
}

void add_color(const Attribute& attribute, const std::vector<std::byte>& values, int bits, std::vector<EncoderColumn>& columns) {
    AttributeHeader header{.kind = AttributeKind::color, .type = ScalarType::uint16, .components = 3, .normalized = true};
    if (bits > 8) return add_column(header, attribute, values, columns);
    header.type = ScalarType::uint8;
    std::vector<std::byte> low(values.size() / 2);
    for (size_t i = 0; i < low.size(); ++i) low[i] = values[2 * i];  // the lower byte comes first
    add_column(header, attribute, std::move(low), columns);
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

void add_normals(const PointBatch& points, const std::vector<Attribute>& attributes, std::vector<EncoderColumn>& columns) {
    EncoderColumn column{.header = {.kind = AttributeKind::normal, .type = ScalarType::float32, .components = 3}};
    column.values.resize(points.size * 3 * sizeof(float));
    for (size_t axis = 0; axis < 3; ++axis) {
        const std::vector<std::byte>& from = points.columns[size_t(find_attribute(attributes, kNormal[axis]))];
        for (size_t i = 0; i < points.size; ++i) std::memcpy(column.values.data() + (3 * i + axis) * sizeof(float), from.data() + i * sizeof(float), sizeof(float));
    }
    columns.push_back(std::move(column));
}

void add_attribute(const Attribute& attribute, const std::vector<std::byte>& values, std::vector<EncoderColumn>& columns) {
    if (attribute.components > kMostComponents)
        throw Error(ErrorKind::unsupported, "attribute '" + attribute.name + "' has " + std::to_string(attribute.components) + " components, Draco holds " + std::to_string(kMostComponents));
    const size_t size = scalar_size(attribute.type);
    const bool plain = size <= 2 || attribute.type == ScalarType::float32 || (size == 4 && is_narrow(attribute.type, values));
    if (plain)
        add_column({.kind = AttributeKind::generic, .type = attribute.type, .components = attribute.components}, attribute, values, columns);
    else if (size == 4)
        add_words<uint32_t>(attribute, values, columns);
    else
        add_words<uint64_t>(attribute, values, columns);
}

// Decodes what was encoded: other columns as they were, positions as far off as they are, which is returned.
double check_block(const std::vector<std::byte>& bytes, const std::vector<EncoderColumn>& columns, const PointBatch& points, const BlockFrame& frame,
                   const Places& places) {
    const std::string name = "encoded block";
    const DecodedPoints decoded = decode(bytes, read_header(*memory_source(name, bytes)), name);
    bool same = decoded.points == points.size && decoded.columns.size() == columns.size();
    for (size_t i = 1; same && i < columns.size(); ++i) same = decoded.columns[i].values == columns[i].values;
    if (!same) throw Error(ErrorKind::unsupported, "Draco does not give back what it was given");
    const Column& found = decoded.columns.front();
    const Lattice unit{.min = {0.0, 0.0, 0.0}, .range = 1.0, .bits = 1};  // of integers
    const Lattice& lattice = found.lattice ? *found.lattice : unit;
    const double step = lattice.range / double((uint64_t{1} << lattice.bits) - 1);
    double worst = 0.0;
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto a = Eigen::Index(axis);
        const double scale = frame.quantization.scale[a], zero = places.origin[a];
        const std::vector<int32_t>& quanta = *axes_of(points)[axis];
        for (size_t i = 0; i < points.size; ++i) {
            const double value = lattice.min[axis] + step * load_scalar(found.header.type, found.values.data() + (3 * i + axis) * sizeof(int32_t));
            worst = std::max(worst, std::abs(value * places.scale[a] - (quanta[i] - zero) * scale));
        }
    }
    return worst;
}

}  // namespace

BlockFrame block_frame(const PointSource& source, double max_error, int threads) {
    const CloudInfo& info = source.info();
    BlockFrame frame{.quantization = info.quantization, .max_error = max_error};
    for (int axis = 0; axis < 3; ++axis) {
        const double scale = info.quantization.scale[axis], low = info.bounds.min[axis], extent = info.bounds.max[axis] - low;
        const bool known = std::isfinite(extent) && extent >= 0.0;
        const double corner = known ? std::nearbyint((low - info.quantization.offset[axis]) / scale) : 0.0;
        frame.origin[axis] = int32_t(std::clamp(corner, double(std::numeric_limits<int32_t>::min()), double(std::numeric_limits<int32_t>::max())));
    }
    frame.rgb_bits = rgb_depth(source, threads) > 8 ? 16 : 8;
    return frame;
}

EncodedBlock encode_block(const PointBatch& points, const CloudInfo& info, const BlockFrame& frame) {
    Places places;
    const QuantaRange range = range_of(points);
    const Vec3d max_error = error_of(frame, range);
    if (!place_on_grid(points, frame, range, max_error, places)) place_on_quanta(points, frame, range, max_error, places);
    std::vector<EncoderColumn> columns;
    columns.push_back(std::move(places.column));
    const bool normals = has_normals(info.attributes);
    for (size_t i = 0; i < info.attributes.size(); ++i) {
        const Attribute& attribute = info.attributes[i];
        if (is_color(attribute))
            add_color(attribute, points.columns[i], frame.rgb_bits, columns);
        else if (normals && is_normal_component(attribute)) {
            if (attribute.name == kNormal[0]) add_normals(points, info.attributes, columns);
        } else
            add_attribute(attribute, points.columns[i], columns);
    }
    EncodedBlock block;
    block.bytes = encode(uint32_t(points.size), columns, metadata_of(places, info, frame, max_error));
    block.worst_error = check_block(block.bytes, columns, points, frame, places);
    block.exact = places.exact;
    return block;
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
    // The columns, the encoder's copy of them, and what decoding takes to check them.
    return points > UINT32_MAX ? UINT64_MAX : 2 * points * record + decoding_bytes(points, headers);
}

}  // namespace strata::drc
