#include "io/las/las_columns.h"

#include <algorithm>
#include <cstring>

#include "io/las/las_layout.h"
#include "io/las/las_promotion.h"

namespace strata::las {
namespace {

// Records of one pass over all columns: they stay in the first-level cache while each column takes its field from them.
constexpr size_t kTileBytes = 16 * 1024;

template <size_t Size>
void copy_field(const std::byte* field, size_t stride, size_t count, size_t, std::byte* out) {
    for (size_t i = 0; i < count; ++i) std::memcpy(out + i * Size, field + i * stride, Size);
}

void copy_bytes(const std::byte* field, size_t stride, size_t count, size_t size, std::byte* out) {
    for (size_t i = 0; i < count; ++i) std::memcpy(out + i * size, field + i * stride, size);
}

template <int Shift, int Mask>
void copy_bits(const std::byte* field, size_t stride, size_t count, size_t, std::byte* out) {
    for (size_t i = 0; i < count; ++i) out[i] = (field[i * stride] >> Shift) & std::byte(Mask);
}

// Formats 0 to 5 keep scan direction and edge in bits 6 and 7 of the byte of returns, and synthetic, key point and withheld
// in bits 5 to 7 of the next, the classification. The result is the byte of formats 6 to 10.
void join_flags(const std::byte* field, size_t stride, size_t count, size_t, std::byte* out) {
    for (size_t i = 0; i < count; ++i) {
        const std::byte* const at = field + i * stride;
        out[i] = (at[0] & std::byte{0xC0}) | (at[1] >> 5);
    }
}

void decode_positions(const std::byte* records, size_t stride, size_t count, int32_t* x, int32_t* y, int32_t* z) {
    for (size_t i = 0; i < count; ++i) {
        const std::byte* const at = records + i * stride;
        std::memcpy(x + i, at, 4);
        std::memcpy(y + i, at + 4, 4);
        std::memcpy(z + i, at + 8, 4);
    }
}

// Loops with a size known to the compiler are several times faster.
DecodeColumn copier(size_t size) {
    switch (size) {
        case 1: return copy_field<1>;
        case 2: return copy_field<2>;
        case 3: return copy_field<3>;
        case 4: return copy_field<4>;
        case 6: return copy_field<6>;
        case 8: return copy_field<8>;
        case 12: return copy_field<12>;
        case 16: return copy_field<16>;
        case 24: return copy_field<24>;
        default: return copy_bytes;
    }
}

std::string untaken_name(const std::vector<Attribute>& attributes, const std::string& wanted) {
    std::string name = wanted;
    for (int n = 2; name == "position" || find_attribute(attributes, name) >= 0; ++n) name = wanted + " " + std::to_string(n);
    return name;
}

}  // namespace

void Columns::add(Attribute attribute, DecodeColumn decoder, size_t record_offset) {
    attributes_.push_back(std::move(attribute));
    sources_.push_back({decoder, uint16_t(record_offset)});
}

Columns::Columns(int point_format, size_t record_size, const std::vector<ExtraAttribute>& extra) : record_size_(record_size) {
    using enum ScalarType;
    using namespace attribute_name;
    const PointLayout layout = point_layout(point_format);
    const auto field = [&](std::string_view name, ScalarType type, size_t offset, int components = 1, double scale = 1.0) {
        add({.name = std::string(name), .description = {}, .type = type, .components = components, .scale = scale},
            copier(scalar_size(type) * size_t(components)), offset);
    };
    const auto bits = [&](std::string_view name, DecodeColumn decoder, size_t offset) {
        add({.name = std::string(name), .description = {}}, decoder, offset);
    };
    field(kIntensity, uint16, 12);
    if (layout.extended) {
        bits(kReturnNumber, copy_bits<0, 15>, 14);
        bits(kNumberOfReturns, copy_bits<4, 15>, 14);
        field(kClassificationFlags, uint8, 15);
        field(kClassification, uint8, 16);
        field(kScanAngle, int16, 18, 1, kScanAngleStep);
        field(kUserData, uint8, 17);
        field(kPointSourceId, uint16, 20);
    } else {
        bits(kReturnNumber, copy_bits<0, 7>, 14);
        bits(kNumberOfReturns, copy_bits<3, 7>, 14);
        bits(kClassificationFlags, join_flags, 14);
        bits(kClassification, copy_bits<0, 31>, 15);
        field(kScanAngleRank, int8, 16);
        field(kUserData, uint8, 17);
        field(kPointSourceId, uint16, 18);
    }
    if (layout.gps_time) field(kGpsTime, float64, layout.gps_time);
    if (layout.rgb) field(kRgb, uint16, layout.rgb, 3);
    if (layout.nir) field(kNearInfrared, uint16, layout.nir);
    for (const ExtraAttribute& source : extra) {
        Attribute attribute = source.attribute;
        attribute.name = untaken_name(attributes_, attribute.name.empty() ? "extra bytes" : attribute.name);
        add(attribute, copier(attribute.size_bytes()), source.record_offset);
    }
}

void Columns::decode(std::span<const std::byte> records, std::span<const int> wanted, size_t first, PointBatch& out) const {
    const size_t count = records.size() / record_size_;
    const size_t tile = std::max<size_t>(1, kTileBytes / record_size_);
    for (size_t begin = 0; begin < count; begin += tile) {
        const size_t size = std::min(tile, count - begin), row = first + begin;
        const std::byte* const at = records.data() + begin * record_size_;
        decode_positions(at, record_size_, size, out.x.data() + row, out.y.data() + row, out.z.data() + row);
        for (const int index : wanted) {
            const Source& source = sources_[size_t(index)];
            const size_t bytes = attributes_[size_t(index)].size_bytes();
            source.decoder(at + source.record_offset, record_size_, size, bytes, out.columns[size_t(index)].data() + row * bytes);
        }
    }
}

}  // namespace strata::las
