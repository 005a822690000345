#include "io/las/las_writer.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <span>

#include "core/error.h"
#include "io/las/las_header_writer.h"

namespace strata {
namespace {

constexpr uint16_t kWktRecordId = 2112;

// Record formats 6, 7 and 8: where their fields are (tables 14 to 16).
constexpr size_t kReturnByte = 14, kFlagByte = 15;
struct FieldPlace {
    std::string_view name;
    ScalarType type;
    int components;
    size_t position;
};
constexpr std::array<FieldPlace, 8> kFieldPlaces = {{{attribute_name::kIntensity, ScalarType::uint16, 1, 12},
                                                     {attribute_name::kClassification, ScalarType::uint8, 1, 16},
                                                     {attribute_name::kUserData, ScalarType::uint8, 1, 17},
                                                     {attribute_name::kScanAngle, ScalarType::int16, 1, 18},
                                                     {attribute_name::kPointSourceId, ScalarType::uint16, 1, 20},
                                                     {attribute_name::kGpsTime, ScalarType::float64, 1, 22},
                                                     {attribute_name::kRgb, ScalarType::uint16, 3, 30},
                                                     {attribute_name::kNearInfrared, ScalarType::uint16, 1, 36}}};

size_t record_size_of(int point_format) {
    switch (point_format) {
        case 6: return 30;
        case 7: return 36;
        case 8: return 38;
        default: throw Error(ErrorKind::unsupported, "LAS point format " + std::to_string(point_format) + ": only 6, 7 and 8 are written");
    }
}

int column_of(const std::vector<Attribute>& attributes, std::string_view name) {
    const int column = find_attribute(attributes, name);
    if (column >= 0 && (attributes[size_t(column)].type != ScalarType::uint8 || attributes[size_t(column)].components != 1))
        throw Error(ErrorKind::usage, "attribute '" + std::string(name) + "': one uint8 expected");
    return column;
}

}  // namespace

LasWriter::LasWriter(const std::string& path, const LasWriterSettings& settings, uint64_t expected_points)
    : settings_(settings), record_size_(record_size_of(settings.point_format)), file_(path, settings.overwrite) {
    least_.fill(std::numeric_limits<int32_t>::max());
    most_.fill(std::numeric_limits<int32_t>::min());
    for (size_t column = 0; column < settings_.attributes.size(); ++column) {
        const Attribute& attribute = settings_.attributes[column];
        if (attribute.name == attribute_name::kReturnNumber || attribute.name == attribute_name::kNumberOfReturns ||
            attribute.name == attribute_name::kClassificationFlags)
            continue;  // bit fields
        const auto place = std::find_if(kFieldPlaces.begin(), kFieldPlaces.end(), [&](const FieldPlace& p) { return p.name == attribute.name; });
        if (place == kFieldPlaces.end() || place->position + attribute.size_bytes() > record_size_ || place->type != attribute.type ||
            place->components != attribute.components)
            throw Error(ErrorKind::usage, path + ": attribute '" + attribute.name + "' (" + std::string(scalar_name(attribute.type)) + " x " +
                                              std::to_string(attribute.components) + ") has no field in LAS point format " +
                                              std::to_string(settings_.point_format));
        fields_.push_back({column, place->position, attribute.size_bytes()});
    }
    return_number_column_ = column_of(settings_.attributes, attribute_name::kReturnNumber);
    return_count_column_ = column_of(settings_.attributes, attribute_name::kNumberOfReturns);
    flags_column_ = column_of(settings_.attributes, attribute_name::kClassificationFlags);
    const std::vector<std::byte> head = header();
    if (expected_points > (std::numeric_limits<uint64_t>::max() >> 1) / record_size_)
        throw Error(ErrorKind::limit, path + ": " + std::to_string(expected_points) + " points do not fit into any file");
    if (expected_points > 0) file_.reserve(head.size() + expected_points * record_size_);
    file_.write(head);
}

std::vector<std::byte> LasWriter::header() const {
    std::vector<std::byte> records;
    if (!settings_.crs_wkt.empty()) {
        const std::span<const char> text(settings_.crs_wkt.c_str(), settings_.crs_wkt.size() + 1);  // ends with a zero
        try {
            las::append_record(records, "LASF_Projection", kWktRecordId, "WKT of the coordinate system", std::as_bytes(text));
        } catch (const Error& error) {
            throw error.within(file_.path());
        }
    }
    const las::HeaderValues values = {
        // The WKT bit must be set for these point formats, with or without a WKT (section 2.4, global encoding).
        .global_encoding = uint16_t(las::kWktBit | (settings_.adjusted_gps_time ? las::kAdjustedTimeBit : 0)),
        .system_identifier = settings_.system_identifier,
        .generating_software = settings_.generating_software,
        .creation_day = settings_.creation_day,
        .creation_year = settings_.creation_year,
        .point_offset = uint32_t(las::header_bytes(4) + records.size()),
        .records = settings_.crs_wkt.empty() ? 0u : 1u,
        .point_format = settings_.point_format,
        .record_size = uint16_t(record_size_),
        .quantization = settings_.quantization,
        .points = points_,
        .points_by_return = points_by_return_,
        .least = least_,
        .most = most_};
    std::vector<std::byte> bytes = las::header_block(values);
    bytes.insert(bytes.end(), records.begin(), records.end());
    return bytes;
}

void LasWriter::encode_plain(const PointBatch& batch) {
    for (size_t i = 0; i < batch.size; ++i) {
        const std::array<int32_t, 3> quanta = {batch.x[i], batch.y[i], batch.z[i]};
        for (size_t axis = 0; axis < 3; ++axis) {
            least_[axis] = std::min(least_[axis], quanta[axis]);
            most_[axis] = std::max(most_[axis], quanta[axis]);
        }
        std::memcpy(records_.data() + i * record_size_, quanta.data(), sizeof quanta);
    }
    for (const Field& field : fields_) {
        const std::vector<std::byte>& column = batch.columns[field.column];
        if (column.empty()) continue;
        for (size_t i = 0; i < batch.size; ++i)
            std::memcpy(records_.data() + i * record_size_ + field.position, column.data() + i * field.size_bytes, field.size_bytes);
    }
}

void LasWriter::encode_returns_and_flags(const PointBatch& batch) {
    const auto value = [&](int column, size_t i, uint8_t fallback) {
        return column < 0 || batch.columns[size_t(column)].empty() ? fallback : uint8_t(batch.columns[size_t(column)][i]);
    };
    for (size_t i = 0; i < batch.size; ++i) {
        const uint8_t number = value(return_number_column_, i, 1), count = value(return_count_column_, i, 1);
        records_[i * record_size_ + kReturnByte] = std::byte((number & 15) | (count & 15) << 4);
        records_[i * record_size_ + kFlagByte] = std::byte(value(flags_column_, i, 0));
        if (number >= 1 && number <= points_by_return_.size()) ++points_by_return_[size_t(number) - 1];
    }
}

void LasWriter::write(const PointBatch& batch) {
    if (batch.size == 0) return;
    records_.assign(batch.size * record_size_, std::byte(0));
    encode_plain(batch);
    encode_returns_and_flags(batch);
    file_.write(records_);
    points_ += batch.size;
}

void LasWriter::finish(Durability durability) {
    file_.write_at(0, header());
    file_.commit(durability);
}

}  // namespace strata
