#pragma once

#include <numeric>
#include <vector>

#include "core/cloud/point_source.h"

namespace strata::test {

/// All points of a source in one batch, all attributes wanted.
inline PointBatch points_of(const PointSource& source) {
    const std::vector<Attribute>& attributes = source.info().attributes;
    std::vector<int> all(attributes.size());
    std::iota(all.begin(), all.end(), 0);
    PointBatch points, batch;
    points.columns.resize(attributes.size());
    for (uint64_t i = 0; i < source.batch_count(); ++i) {
        source.read_batch(i, all, batch);
        points.size += batch.size;
        points.x.insert(points.x.end(), batch.x.begin(), batch.x.end());
        points.y.insert(points.y.end(), batch.y.begin(), batch.y.end());
        points.z.insert(points.z.end(), batch.z.begin(), batch.z.end());
        for (size_t a = 0; a < attributes.size(); ++a)
            points.columns[a].insert(points.columns[a].end(), batch.columns[a].begin(), batch.columns[a].end());
    }
    return points;
}

/// The stored values of the named attribute as doubles, components side by side.
inline std::vector<double> values_of(const PointSource& source, const PointBatch& points, std::string_view name) {
    const int index = find_attribute(source.info().attributes, name);
    std::vector<double> values;
    if (index < 0) return values;
    const ScalarType type = source.info().attributes[size_t(index)].type;
    const std::vector<std::byte>& column = points.columns[size_t(index)];
    for (size_t at = 0; at < column.size(); at += scalar_size(type)) values.push_back(load_scalar(type, column.data() + at));
    return values;
}

}  // namespace strata::test
