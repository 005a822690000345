#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/cloud/attribute.h"
#include "core/cloud/point_source.h"
#include "core/math/quantization.h"
#include "core/math/vec.h"
#include "core/octree/node_key.h"

namespace strata {

/// The cloud that is being built, as far as it is known once every point was read.
struct BuiltCloud {
    uint64_t points = 0;
    Quantization quantization;         // scale of the records' quanta; offset of the source
    Quantization source_quantization;  // record quanta = (source quanta - min_quanta) >> coarsening_bits, rounded
    int coarsening_bits = 0;           // 0 unless the extent takes more than 31 bits
    Vec3i min_quanta = Vec3i::Zero(), max_quanta = Vec3i::Zero();  // tight, source quanta
    double cube_side = 0.0;  // world units; the root cube's lowest corner is at min_quanta
    double spacing = 0.0;    // of the root, world units
    std::string crs;
    std::vector<CrsRecord> crs_records;
    std::optional<bool> adjusted_gps_time;  // as in CloudInfo
    std::vector<Attribute> attributes;  // the record after the position, in this order
    std::vector<std::vector<double>> attribute_min, attribute_max;  // [attribute][component], stored values
};

/// One finished node: where its bytes lie in what the sink was given.
struct BuiltNode {
    NodeKey key;
    uint32_t points = 0;
    uint64_t byte_offset = 0;  // within the bytes of the same append, then within the output
    uint64_t byte_size = 0;
};

/// Takes the nodes of a build. The sink decides how a node's points are stored.
class NodeSink {
public:
    virtual ~NodeSink() = default;

    /// Once, before any node.
    virtual void begin(const BuiltCloud& cloud) = 0;
    /// Appends a node's stored form to `out`. Called from several threads.
    /// records  [points * record_bytes] int32 x, y, z relative to the cloud's min_quanta, then the attributes, packed
    virtual void encode(std::span<const std::byte> records, uint32_t points, std::vector<std::byte>& out) const = 0;
    /// Stores encoded nodes. Called from one thread at a time, in an order that depends on the cloud alone.
    virtual void append(std::span<const BuiltNode> nodes, std::span<const std::byte> bytes) = 0;
    /// Once, after all nodes.
    virtual void finish() = 0;
};

}  // namespace strata
