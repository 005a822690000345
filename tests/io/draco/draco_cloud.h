#pragma once

#include <draco/compression/expert_encode.h>
#include <draco/point_cloud/point_cloud.h>

#include <array>
#include <cstring>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

namespace strata::test {

/// A point cloud made and encoded by Draco itself, as other programs do it; strata's writer has no part in it.
class DracoCloud {
public:
    explicit DracoCloud(size_t points) : points_(points) { cloud_.set_num_points(uint32_t(points)); }

    /// Adds an attribute of `components` values a point.
    template <typename T>
    int add(draco::GeometryAttribute::Type kind, draco::DataType type, int components, const std::vector<T>& values, bool normalized = false,
            const std::string& name = "") {
        draco::GeometryAttribute description;
        description.Init(kind, nullptr, uint8_t(components), type, normalized, int64_t(sizeof(T)) * components, 0);
        const int index = cloud_.AddAttribute(description, true, uint32_t(points_));
        std::memcpy(cloud_.attribute(index)->buffer()->data(), values.data(), values.size() * sizeof(T));
        if (!name.empty()) {
            auto metadata = std::make_unique<draco::AttributeMetadata>();
            metadata->AddEntryString("name", name);
            cloud_.AddAttributeMetadata(index, std::move(metadata));
        }
        return index;
    }
    /// Quantizes a float attribute.
    void quantize(int attribute, int bits) { bits_.push_back({attribute, bits}); }

    std::vector<std::byte> encode(int method = draco::POINT_CLOUD_SEQUENTIAL_ENCODING, int speed = 5) {
        draco::ExpertEncoder encoder(cloud_);
        encoder.SetEncodingMethod(method);
        encoder.SetSpeedOptions(speed, speed);
        for (const auto& [attribute, bits] : bits_) encoder.SetAttributeQuantization(attribute, bits);
        draco::EncoderBuffer buffer;
        const draco::Status status = encoder.EncodeToBuffer(&buffer);
        if (!status.ok()) throw std::runtime_error("Draco does not encode: " + status.error_msg_string());
        const auto* const bytes = reinterpret_cast<const std::byte*>(buffer.data());
        return {bytes, bytes + buffer.size()};
    }

    draco::PointCloud& cloud() { return cloud_; }

private:
    size_t points_;
    draco::PointCloud cloud_;
    std::vector<std::array<int, 2>> bits_;
};

/// x, y, z of points one behind the other: a walk of whole steps, the same every time.
template <typename T>
std::vector<T> walk(size_t points, double step, std::array<double, 3> start = {0, 0, 0}) {
    std::vector<T> values;
    uint32_t state = 1;
    std::array<int, 3> at{};
    for (size_t i = 0; i < points; ++i)
        for (size_t axis = 0; axis < 3; ++axis) {
            state = state * 1664525u + 1013904223u;
            at[axis] += int(state >> 24) - 100;
            values.push_back(T(start[axis] + step * at[axis]));
        }
    return values;
}

}  // namespace strata::test
