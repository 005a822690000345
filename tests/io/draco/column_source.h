#pragma once

#include <cstring>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata::test {

/// Points that a test states column by column.
class ColumnSource : public PointSource {
public:
    CloudInfo cloud_info;
    std::vector<int32_t> x, y, z;
    std::vector<std::vector<std::byte>> columns;  // one an attribute
    std::vector<size_t> batches;                  // sizes of them, none: one of all points

    template <typename T>
    void add(Attribute attribute, const std::vector<T>& values) {
        cloud_info.attributes.push_back(std::move(attribute));
        std::vector<std::byte>& column = columns.emplace_back(values.size() * sizeof(T));
        std::memcpy(column.data(), values.data(), column.size());
    }
    /// Once the points are there.
    void finish() {
        cloud_info.points = x.size();
        for (size_t i = 0; i < x.size(); ++i) cloud_info.bounds.extend(cloud_info.quantization.world_from_quanta({x[i], y[i], z[i]}));
        if (batches.empty() && !x.empty()) batches = {x.size()};
    }

    const CloudInfo& info() const override { return cloud_info; }
    uint64_t batch_count() const override { return batches.size(); }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        size_t begin = 0;
        for (size_t i = 0; i < index; ++i) begin += batches[i];
        const size_t size = batches[index];
        resize_batch(out, size, cloud_info.attributes, wanted);
        const auto copy = [&](const auto& from, auto& to, size_t width) {
            std::copy(from.begin() + ptrdiff_t(begin * width), from.begin() + ptrdiff_t((begin + size) * width), to.begin());
        };
        copy(x, out.x, 1);
        copy(y, out.y, 1);
        copy(z, out.z, 1);
        for (const int i : wanted) copy(columns[size_t(i)], out.columns[size_t(i)], cloud_info.attributes[size_t(i)].size_bytes());
    }
};

}  // namespace strata::test
