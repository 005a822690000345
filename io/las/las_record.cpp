#include "io/las/las_record.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "io/las/las_layout.h"
#include "io/las/las_promotion.h"

namespace strata::las {
namespace {

using namespace attribute_name;

// Records of one pass over all attributes: they stay in the first-level cache while each attribute fills its field of them.
constexpr size_t kTileBytes = 16 * 1024;
constexpr size_t kReturnByte = 14, kFlagByte = 15;
constexpr size_t kMostBytes = 65535;  // of a record and of a VLR: both lengths are 16-bit

[[noreturn]] void fail_value(const RecordField& field, double value, const std::string& holds) {
    std::string number = std::to_string(value);
    if (value == std::floor(value)) number.resize(number.find('.'));
    throw Error(ErrorKind::unsupported, "attribute '" + field.name + "': " + number + ", and point format " +
                                            std::to_string(field.point_format) + " holds " + holds);
}

template <size_t Size>
void copy_values(const RecordField&, const std::byte* values, size_t stride, size_t count, std::byte* records, size_t record_size) {
    for (size_t i = 0; i < count; ++i) std::memcpy(records + i * record_size, values + i * stride, Size);
}

void copy_bytes(const RecordField& field, const std::byte* values, size_t stride, size_t count, std::byte* records, size_t record_size) {
    const size_t size = field.size_bytes();
    for (size_t i = 0; i < count; ++i) std::memcpy(records + i * record_size, values + i * stride, size);
}

// Loops with a size known to the compiler are several times faster.
CopyField copier(size_t size) {
    switch (size) {
        case 1: return copy_values<1>;
        case 2: return copy_values<2>;
        case 4: return copy_values<4>;
        case 6: return copy_values<6>;
        case 8: return copy_values<8>;
        case 12: return copy_values<12>;
        case 24: return copy_values<24>;
        default: return copy_bytes;
    }
}

template <int Shift, uint8_t Most>
void put_bits(const RecordField& field, const std::byte* values, size_t stride, size_t count, std::byte* records, size_t record_size) {
    for (size_t i = 0; i < count; ++i) {
        const auto value = uint8_t(values[i * stride]);
        if (value > Most) fail_value(field, value, "0 to " + std::to_string(Most));
        records[i * record_size] |= std::byte(value << Shift);
    }
}

// Formats 0 to 5: scan direction and edge are bits 6 and 7 of the byte of returns; synthetic, key point and withheld bits 5 to 7
// of the next, the classification.
void split_flags(const RecordField& field, const std::byte* values, size_t stride, size_t count, std::byte* records, size_t record_size) {
    for (size_t i = 0; i < count; ++i) {
        const auto flags = uint8_t(values[i * stride]);
        if (flags & 0x38) fail_value(field, flags, "neither the overlap flag (8) nor a scanner channel (16, 32)");
        records[i * record_size] |= std::byte(flags & 0xC0);
        records[i * record_size + 1] |= std::byte(flags << 5);
    }
}

// From the byte of flags on, which the class follows.
void promote_class(const RecordField&, const std::byte* values, size_t stride, size_t count, std::byte* records, size_t record_size) {
    for (size_t i = 0; i < count; ++i) {
        const auto value = uint8_t(values[i * stride]);
        records[i * record_size] |= std::byte(flags_of_class(value));
        records[i * record_size + 1] = std::byte(promoted_class(value));
    }
}

void promote_rank(const RecordField&, const std::byte* values, size_t stride, size_t count, std::byte* records, size_t record_size) {
    for (size_t i = 0; i < count; ++i) {
        const int16_t angle = angle_of_rank(int8_t(values[i * stride]));
        std::memcpy(records + i * record_size, &angle, sizeof angle);
    }
}

std::vector<RecordField> standard_fields(int point_format, bool promoted) {
    using enum ScalarType;
    const PointLayout layout = point_layout(point_format);
    std::vector<RecordField> fields;
    const auto add = [&](std::string_view name, ScalarType type, size_t offset, CopyField copy = nullptr, int components = 1) {
        RecordField field{.name = std::string(name),
                          .point_format = point_format,
                          .copy = copy,
                          .record_offset = offset,
                          .type = type,
                          .components = components,
                          .stored = type};
        if (!copy) field.copy = copier(field.size_bytes());
        fields.push_back(std::move(field));
    };
    add(kIntensity, uint16, 12);
    add(kUserData, uint8, 17);
    if (layout.extended) {
        add(kReturnNumber, uint8, kReturnByte, put_bits<0, 15>);
        add(kNumberOfReturns, uint8, kReturnByte, put_bits<4, 15>);
        add(kClassificationFlags, uint8, kFlagByte, put_bits<0, 255>);
        if (promoted) {
            add(kClassification, uint8, kFlagByte, promote_class);
            add(kScanAngleRank, int8, 18, promote_rank);
        } else {
            add(kClassification, uint8, 16);
            add(kScanAngle, int16, 18);
        }
        add(kPointSourceId, uint16, 20);
    } else {
        add(kReturnNumber, uint8, kReturnByte, put_bits<0, 7>);
        add(kNumberOfReturns, uint8, kReturnByte, put_bits<3, 7>);
        add(kClassificationFlags, uint8, kReturnByte, split_flags);
        add(kClassification, uint8, 15, put_bits<0, 31>);
        add(kScanAngleRank, int8, 16);
        add(kPointSourceId, uint16, 18);
    }
    if (layout.gps_time) add(kGpsTime, float64, layout.gps_time);
    if (layout.rgb) add(kRgb, uint16, layout.rgb, nullptr, 3);
    if (layout.nir) add(kNearInfrared, uint16, layout.nir);
    return fields;
}

bool is_float(ScalarType type) { return type == ScalarType::float32 || type == ScalarType::float64; }

// The type as which an attribute's bytes are read. Some Potree folders call the signed rank unsigned.
ScalarType stored_type(const Attribute& attribute) {
    const bool rank = attribute.name == kScanAngleRank && attribute.type == ScalarType::uint8;
    return rank ? ScalarType::int8 : attribute.type;
}

// Fractions would be lost in a field of whole numbers, and large 64-bit integers in one of double. A narrower field is
// tried: fail_value says so where a value does not fit.
bool fits(const Attribute& attribute, const RecordField& field) {
    if (attribute.name != field.name || attribute.components != field.components || attribute.offset != 0.0) return false;
    const bool own_scale = attribute.scale == 1.0 || (field.name == kScanAngle && attribute.scale == kScanAngleStep);
    return own_scale && (stored_type(attribute) == field.type || is_float(attribute.type) == is_float(field.type));
}

bool has_field(const std::vector<Attribute>& attributes, std::string_view name, int point_format, bool promoted) {
    const int index = find_attribute(attributes, name);
    if (index < 0) return false;
    const std::vector<RecordField> fields = standard_fields(point_format, promoted);
    return std::any_of(fields.begin(), fields.end(), [&](const RecordField& field) { return fits(attributes[size_t(index)], field); });
}

template <typename T>
void store_whole(const RecordField& field, double value, std::byte* out) {
    using Limits = std::numeric_limits<T>;
    if (!(value >= Limits::min() && value <= Limits::max()))
        fail_value(field, value, std::to_string(Limits::min()) + " to " + std::to_string(Limits::max()));
    const T stored = T(value);
    std::memcpy(out, &stored, sizeof stored);
}

// Values of another type than the field's, as that type, packed.
void convert_values(const RecordField& field, const std::byte* values, size_t stride, size_t count, std::byte* out) {
    using enum ScalarType;
    const size_t from = scalar_size(field.stored), to = scalar_size(field.type);
    // 8 of 16 bits: full light must stay full light.
    const double factor = field.name == kRgb && from == 1 ? 257.0 : 1.0;
    for (size_t i = 0; i < count; ++i)
        for (size_t c = 0; c < size_t(field.components); ++c, out += to) {
            const double value = load_scalar(field.stored, values + i * stride + c * from) * factor;
            switch (field.type) {
                case uint8: store_whole<uint8_t>(field, value, out); break;
                case int8: store_whole<int8_t>(field, value, out); break;
                case uint16: store_whole<uint16_t>(field, value, out); break;
                case int16: store_whole<int16_t>(field, value, out); break;
                default: std::memcpy(out, &value, sizeof value); break;  // float64
            }
        }
}

// Table 24: types 1 to 10.
uint8_t data_type_of(ScalarType type) {
    using enum ScalarType;
    constexpr std::array kTypes = {uint8, int8, uint16, int16, uint32, int32, uint64, int64, float32, float64};
    return uint8_t(1 + (std::find(kTypes.begin(), kTypes.end(), type) - kTypes.begin()));
}

// As the widest type of the same kind, which no_data, min and max are stored as. False: that type cannot hold it.
bool store_any(ScalarType type, double value, std::byte* out) {
    using enum ScalarType;
    if (std::isnan(value)) return false;
    if (is_float(type)) {
        std::memcpy(out, &value, sizeof value);
        return true;
    }
    const bool is_signed = type == int8 || type == int16 || type == int32 || type == int64;
    if (value < (is_signed ? -0x1p63 : 0.0) || value >= (is_signed ? 0x1p63 : 0x1p64) || value != std::floor(value)) return false;
    const uint64_t bits = is_signed ? uint64_t(int64_t(value)) : uint64_t(value);
    std::memcpy(out, &bits, sizeof bits);
    return true;
}

void add_to_positions(std::byte* records, size_t record_size, size_t count, const Vec3i& shift) {
    for (size_t i = 0; i < count; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            uint32_t quanta;
            std::memcpy(&quanta, records + i * record_size + 4 * axis, sizeof quanta);
            quanta += uint32_t(shift[axis]);
            std::memcpy(records + i * record_size + 4 * axis, &quanta, sizeof quanta);
        }
}

void put_axis(const int32_t* quanta, size_t count, std::byte* records, size_t record_size) {
    for (size_t i = 0; i < count; ++i) std::memcpy(records + i * record_size, quanta + i, 4);
}

bool is_promoted(const std::vector<Attribute>& attributes, bool extended) {
    return extended && find_attribute(attributes, kScanAngle) < 0 && has_field(attributes, kScanAngleRank, 6, true);
}

}  // namespace

int point_format_for(const std::vector<Attribute>& attributes, bool extended) {
    const auto has = [&](std::string_view name, int format) { return has_field(attributes, name, format, false); };
    if (!extended && has(kScanAngleRank, 3) && find_attribute(attributes, kScanAngle) < 0 && !has(kNearInfrared, 8))
        return (has(kGpsTime, 3) ? 1 : 0) + (has(kRgb, 3) ? 2 : 0);
    if (has(kNearInfrared, 8)) return 8;
    return has(kRgb, 7) ? 7 : 6;
}

RecordFields::RecordFields(int point_format, const std::vector<Attribute>& attributes)
    : point_format_(point_format), attributes_(attributes) {
    if (point_format < 0 || point_format > 8 || point_format == 4 || point_format == 5)
        throw Error(ErrorKind::unsupported, "LAS point format " + std::to_string(point_format) + ": formats 0 to 3 and 6 to 8 are written");
    const PointLayout layout = point_layout(point_format);
    record_size_ = layout.size;
    packed_size_ = 12;
    const bool promoted = is_promoted(attributes, layout.extended);
    std::vector<RecordField> standard = standard_fields(point_format, promoted);
    for (size_t index = 0; index < attributes.size(); ++index) {
        const Attribute& attribute = attributes[index];
        const auto place = std::find_if(standard.begin(), standard.end(), [&](const RecordField& field) { return fits(attribute, field); });
        const bool found = place != standard.end();
        RecordField field = found ? *place : RecordField{.name = attribute.name, .components = attribute.components};
        field.stored = stored_type(attribute);
        field.attribute = index;
        field.packed_offset = packed_size_;
        packed_size_ += attribute.size_bytes();
        if (found) {
            standard.erase(place);
            if (field.name == kRgb && field.stored != field.type && scalar_size(field.stored) == 1)
                notes_.push_back("color of 8 bits is widened to 16");
            fields_.push_back(std::move(field));
        } else {
            add_extra(attribute, std::move(field));
        }
    }
    for (const RecordField& missing : standard) {
        if (missing.name == kReturnNumber) returns_ |= 1;
        if (missing.name == kNumberOfReturns) returns_ |= layout.extended ? 1 << 4 : 1 << 3;
        if (missing.name == kGpsTime) notes_.push_back("there is no GPS time: it becomes 0");
        if (missing.name == kRgb) notes_.push_back("there is no color: it becomes 0");
    }
    if (promoted) notes_.emplace_back(kPromotionNote);
    if (record_size_ > kMostBytes || entries_.size() * kExtraBytesRecordBytes > kMostBytes)
        throw Error(ErrorKind::limit, "LAS: " + std::to_string(record_size_) + " bytes a point in " + std::to_string(entries_.size()) +
                                          " extra attributes: " + std::to_string(kMostBytes) + " bytes and " +
                                          std::to_string(kMostBytes / kExtraBytesRecordBytes) + " attributes are possible");
}

void RecordFields::add_extra(const Attribute& attribute, RecordField field) {
    static const std::vector<RecordField> kNamed = [] {
        std::vector<RecordField> all = standard_fields(3, false), extended = standard_fields(8, false);
        all.insert(all.end(), extended.begin(), extended.end());
        return all;
    }();
    if (std::any_of(kNamed.begin(), kNamed.end(), [&](const RecordField& named) { return named.name == attribute.name; }))
        notes_.push_back("point format " + std::to_string(point_format_) + " has no field for '" + attribute.name + "' (" +
                         std::string(scalar_name(attribute.type)) + " x " + std::to_string(attribute.components) +
                         "): it becomes extra bytes");
    field.type = field.stored;
    field.copy = copier(field.size_bytes());
    field.record_offset = record_size_;
    record_size_ += field.size_bytes();
    extra_attributes_.push_back(field.attribute);

    constexpr size_t kNameBytes = 32;
    const bool plain = attribute.scale == 1.0 && attribute.offset == 0.0 && std::isnan(attribute.no_data);
    const bool raw = attribute.type == ScalarType::uint8 && attribute.components > 3 && attribute.components <= 255 && plain;
    if (raw) {  // bytes without a meaning: type 0, of which `options` is the size
        entries_.push_back({attribute.name.substr(0, kNameBytes), field.attribute, 0, 0, uint8_t(attribute.components)});
    } else {
        const uint8_t type = data_type_of(attribute.type);
        for (int c = 0; c < attribute.components; ++c) {
            const std::string ending = attribute.components > 1 ? "[" + std::to_string(c) + "]" : "";
            entries_.push_back({attribute.name.substr(0, kNameBytes - ending.size()) + ending, field.attribute, c, type, 0});
        }
    }
    if (!attribute.name.empty() && !entries_.back().name.starts_with(attribute.name))
        notes_.push_back("'" + attribute.name + "' becomes '" + entries_.back().name + "': names of extra bytes are at most 32 bytes long");
    fields_.push_back(std::move(field));
}

std::vector<std::byte> RecordFields::extra_bytes_record(std::span<const std::vector<double>> least,
                                                        std::span<const std::vector<double>> most) const {
    enum Option : uint8_t { kNoData = 1, kMin = 2, kMax = 4, kScale = 8, kOffset = 16 };
    std::vector<std::byte> payload(entries_.size() * kExtraBytesRecordBytes);
    std::byte* at = payload.data();
    for (const ExtraEntry& entry : entries_) {
        const Attribute& attribute = attributes_[entry.attribute];
        uint8_t options = entry.options;
        const auto said = [&](std::span<const std::vector<double>> values) {
            return entry.attribute < values.size() && size_t(entry.component) < values[entry.attribute].size()
                       ? values[entry.attribute][size_t(entry.component)]
                       : std::numeric_limits<double>::quiet_NaN();
        };
        if (entry.data_type != 0) {
            if (store_any(attribute.type, attribute.no_data, at + 40)) options |= kNoData;
            const double low = said(least), high = said(most);
            if (low <= high) {  // else there is no value
                if (store_any(attribute.type, low, at + 64)) options |= kMin;
                if (store_any(attribute.type, high, at + 88)) options |= kMax;
            }
            if (attribute.scale != 1.0) options |= kScale;
            if (attribute.offset != 0.0) options |= kOffset;
            std::memcpy(at + 112, &attribute.scale, sizeof attribute.scale);
            std::memcpy(at + 136, &attribute.offset, sizeof attribute.offset);
        }
        at[2] = std::byte(entry.data_type);
        at[3] = std::byte(options);
        std::memcpy(at + 4, entry.name.data(), entry.name.size());
        std::memcpy(at + 160, attribute.description.data(), std::min<size_t>(attribute.description.size(), 32));
        at += kExtraBytesRecordBytes;
    }
    return payload;
}

void RecordFields::put(const RecordField& field, const std::byte* values, size_t stride, size_t count, std::byte* records) const {
    std::byte* const at = records + field.record_offset;
    if (field.stored == field.type) return field.copy(field, values, stride, count, at, record_size_);
    std::vector<std::byte> converted(count * field.size_bytes());
    convert_values(field, values, stride, count, converted.data());
    field.copy(field, converted.data(), field.size_bytes(), count, at, record_size_);
}

void RecordFields::begin_records(std::byte* records, size_t count) const {
    std::memset(records, 0, count * record_size_);
    if (returns_ == 0) return;
    for (size_t i = 0; i < count; ++i) records[i * record_size_ + kReturnByte] = std::byte(returns_);
}

void RecordFields::encode(const PointBatch& batch, size_t first, std::span<std::byte> records) const {
    const size_t count = records.size() / record_size_, tile = std::max<size_t>(1, kTileBytes / record_size_);
    for (size_t begin = 0; begin < count; begin += tile) {
        const size_t size = std::min(tile, count - begin), row = first + begin;
        std::byte* const at = records.data() + begin * record_size_;
        begin_records(at, size);
        put_axis(batch.x.data() + row, size, at, record_size_);
        put_axis(batch.y.data() + row, size, at + 4, record_size_);
        put_axis(batch.z.data() + row, size, at + 8, record_size_);
        for (const RecordField& field : fields_) {
            const std::vector<std::byte>& column = batch.columns[field.attribute];
            if (!column.empty()) put(field, column.data() + row * field.stored_bytes(), field.stored_bytes(), size, at);
        }
    }
}

void RecordFields::encode(std::span<const std::byte> packed, const Vec3i& shift, std::span<std::byte> records) const {
    const size_t count = records.size() / record_size_, tile = std::max<size_t>(1, kTileBytes / record_size_);
    for (size_t begin = 0; begin < count; begin += tile) {
        const size_t size = std::min(tile, count - begin);
        const std::byte* const from = packed.data() + begin * packed_size_;
        std::byte* const at = records.data() + begin * record_size_;
        begin_records(at, size);
        for (size_t i = 0; i < size; ++i) std::memcpy(at + i * record_size_, from + i * packed_size_, 12);
        add_to_positions(at, record_size_, size, shift);
        for (const RecordField& field : fields_) put(field, from + field.packed_offset, packed_size_, size, at);
    }
}

}  // namespace strata::las
