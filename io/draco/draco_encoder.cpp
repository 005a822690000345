#include "io/draco/draco_encoder.h"

#include <draco/compression/expert_encode.h>
#include <draco/point_cloud/point_cloud.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "core/error.h"

namespace strata::drc {
namespace {

constexpr int kSpeed = 5;  // of 0 (smallest) to 10; points in their order hardly differ

draco::DataType data_type_of(ScalarType type) {
    switch (type) {
        case ScalarType::int8: return draco::DT_INT8;
        case ScalarType::uint8: return draco::DT_UINT8;
        case ScalarType::int16: return draco::DT_INT16;
        case ScalarType::uint16: return draco::DT_UINT16;
        case ScalarType::int32: return draco::DT_INT32;
        case ScalarType::uint32: return draco::DT_UINT32;
        case ScalarType::int64: return draco::DT_INT64;
        case ScalarType::uint64: return draco::DT_UINT64;
        case ScalarType::float32: return draco::DT_FLOAT32;
        case ScalarType::float64: return draco::DT_FLOAT64;
    }
    return draco::DT_INVALID;
}

void add_entries(const Entries& entries, draco::Metadata& metadata) {
    for (const auto& [name, value] : entries) {
        const auto* const bytes = reinterpret_cast<const uint8_t*>(value.data());
        metadata.AddEntryBinary(name, std::vector<uint8_t>(bytes, bytes + value.size()));
    }
}

void add_column(const EncoderColumn& column, uint32_t points, draco::PointCloud& cloud) {
    draco::GeometryAttribute description;
    description.Init(draco::GeometryAttribute::Type(column.header.kind), nullptr, uint8_t(column.header.components),
                     data_type_of(column.header.type), column.header.normalized, int64_t(column.header.size_bytes()), 0);
    const int index = cloud.AddAttribute(description, true, points);
    std::memcpy(cloud.attribute(index)->buffer()->data(), column.values.data(), column.values.size());
    if (column.metadata.empty()) return;
    auto metadata = std::make_unique<draco::AttributeMetadata>();
    add_entries(column.metadata, *metadata);
    cloud.AddAttributeMetadata(index, std::move(metadata));
}

// The least corner of positions on a grid.
std::array<float, 3> least_of(const EncoderColumn& column) {
    std::array<float, 3> least{}, value;
    for (size_t at = 0; at < column.values.size(); at += sizeof value) {
        std::memcpy(value.data(), column.values.data() + at, sizeof value);
        for (size_t axis = 0; axis < 3; ++axis) least[axis] = at == 0 ? value[axis] : std::min(least[axis], value[axis]);
    }
    return least;
}

}  // namespace

std::vector<std::byte> encode(uint32_t points, const std::vector<EncoderColumn>& columns, const Entries& metadata) {
    draco::PointCloud cloud;
    cloud.set_num_points(points);
    auto of_cloud = std::make_unique<draco::GeometryMetadata>();
    add_entries(metadata, *of_cloud);
    cloud.AddMetadata(std::move(of_cloud));
    for (const EncoderColumn& column : columns) add_column(column, points, cloud);

    draco::ExpertEncoder encoder(cloud);
    encoder.SetEncodingMethod(draco::POINT_CLOUD_SEQUENTIAL_ENCODING);
    encoder.SetSpeedOptions(kSpeed, kSpeed);
    for (size_t i = 0; i < columns.size(); ++i) {
        const EncoderColumn& column = columns[i];
        if (column.bits > 0) {
            const float range = column.step * float((1u << column.bits) - 1);
            encoder.SetAttributeExplicitQuantization(int(i), column.bits, 3, least_of(column).data(), range);
        } else if (column.header.kind != AttributeKind::normal) {
            encoder.SetAttributePredictionScheme(int(i), column.delta ? draco::PREDICTION_DIFFERENCE : draco::PREDICTION_NONE);
        }
    }
    draco::EncoderBuffer buffer;
    const draco::Status status = encoder.EncodeToBuffer(&buffer);
    if (!status.ok()) throw Error(ErrorKind::unsupported, "Draco cannot encode this: " + status.error_msg_string());
    const auto* const bytes = reinterpret_cast<const std::byte*>(buffer.data());
    return {bytes, bytes + buffer.size()};
}

}  // namespace strata::drc
