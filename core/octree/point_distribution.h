#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/octree/chunk_store.h"
#include "core/octree/octree_frame.h"
#include "core/octree/partition.h"
#include "core/octree/record_layout.h"

namespace strata {

/// Called with the number of points done since the last call, from any thread.
using OnPoints = std::function<void(uint64_t points)>;

/// The tight bounds in quanta.
struct QuantaBounds {
    Vec3i min = Vec3i::Constant(INT32_MAX), max = Vec3i::Constant(INT32_MIN);
    uint64_t points = 0;
};

/// Reads every position once; when `partition` is given, counts it by the cells of `frame`, whatever the bounds are.
QuantaBounds count_points(const PointSource& source, int threads, const OctreeFrame& frame, Partition* partition,
                          const OnPoints& on_points);

/// Least and greatest stored value of each component of each attribute; NaN and no_data are passed over. Least > greatest: no value.
struct AttributeRanges {
    std::vector<std::vector<double>> min, max;  // [attribute][component]

    explicit AttributeRanges(const std::vector<Attribute>& attributes);
    void extend(const std::vector<Attribute>& attributes, const PointBatch& batch);
    void extend(const AttributeRanges& other);
    void append(const AttributeRanges& of_more_attributes);
};

/// Reads every point once and adds its record to its chunk.
/// layout        begins with the attributes of the source; what follows is left for others to fill
/// buffer_bytes  for records that wait for others of their chunk, all threads together
/// returns  the ranges of the source's attributes
AttributeRanges distribute_points(const PointSource& source, int threads, uint64_t buffer_bytes, const OctreeFrame& frame,
                                  const Partition& partition, const RecordLayout& layout, ChunkStore& store,
                                  const OnPoints& on_points);

}  // namespace strata
