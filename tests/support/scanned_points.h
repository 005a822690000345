#pragma once

#include <algorithm>
#include <cstring>
#include <numbers>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata {

/// A point of a surface, as a test knows it.
struct ScannedPoint {
    Vec3d place;                                // world
    Vec3f normal = Vec3f::Zero();
    std::array<uint16_t, 3> color = {0, 0, 0};
    float number = 0.0f;
    uint8_t kind = 0;
};

/// Points in memory as a source, with normals if any is not zero, and attributes rgb, number and classification.
class ScannedPoints : public PointSource {
public:
    explicit ScannedPoints(std::vector<ScannedPoint> points, double scale = 1e-8) : points_(std::move(points)) {
        info_.format = "memory";
        info_.points = points_.size();
        info_.quantization.scale = Vec3d::Constant(scale);
        info_.attributes = {{.name = "rgb", .type = ScalarType::uint16, .components = 3}, {.name = "number", .type = ScalarType::float32}, {.name = "classification", .type = ScalarType::uint8}};
        if (std::any_of(points_.begin(), points_.end(), [](const ScannedPoint& p) { return !(p.normal == Vec3f::Zero()); }))
            for (const std::string_view name : attribute_name::kNormal) info_.attributes.push_back({.name = std::string(name), .type = ScalarType::float32});
        for (const ScannedPoint& p : points_) info_.bounds.extend(info_.quantization.world_from_quanta(quanta(p)));
    }

    const std::vector<ScannedPoint>& points() const { return points_; }
    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return (points_.size() + kBatch - 1) / kBatch; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        const size_t begin = index * kBatch, size = std::min(kBatch, points_.size() - begin);
        resize_batch(out, size, info_.attributes, wanted);
        for (size_t i = 0; i < size; ++i) {
            const ScannedPoint& p = points_[begin + i];
            const Vec3i q = quanta(p);
            out.x[i] = q.x(), out.y[i] = q.y(), out.z[i] = q.z();
            const auto put = [&](size_t column, const void* value, size_t bytes) {
                if (column < out.columns.size() && !out.columns[column].empty()) std::memcpy(out.columns[column].data() + bytes * i, value, bytes);
            };
            put(0, p.color.data(), 6);
            put(1, &p.number, 4);
            put(2, &p.kind, 1);
            for (size_t axis = 0; axis < 3; ++axis) put(3 + axis, &p.normal[int(axis)], 4);
        }
    }

private:
    static constexpr size_t kBatch = 3'000;
    Vec3i quanta(const ScannedPoint& p) const { return (p.place / info_.quantization.scale.x()).array().round().matrix().cast<int>(); }

    std::vector<ScannedPoint> points_;
    CloudInfo info_;
};

/// Evenly spread over a sphere around the origin: with their normals.
inline std::vector<ScannedPoint> sphere_points(size_t count, double radius) {
    std::vector<ScannedPoint> points(count);
    const double turn = std::numbers::pi * (3.0 - std::sqrt(5.0));
    for (size_t i = 0; i < count; ++i) {
        const double z = 1.0 - (2.0 * double(i) + 1.0) / double(count), ring = std::sqrt(1.0 - z * z);
        const Vec3d n(ring * std::cos(turn * double(i)), ring * std::sin(turn * double(i)), z);
        points[i] = {.place = radius * n, .normal = n.cast<float>()};
    }
    return points;
}

}  // namespace strata
