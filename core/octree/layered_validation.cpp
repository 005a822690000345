#include "core/octree/layered_validation.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numeric>
#include <optional>
#include <string>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

Error at_node(const LayeredNode& node, const std::string& message) {
    return {ErrorKind::malformed, "node " + node_name(node.key) + ": " + message};
}

void check_children(const LayeredCloud& cloud, NodeId id) {
    const LayeredNode& node = cloud.node(id);
    const double slack = 1e-9 * node.bounds.size().maxCoeff();  // borders are computed, not stored
    for (NodeId child_id = node.first_child; child_id < node.first_child + node.child_count; ++child_id) {
        const LayeredNode& child = cloud.node(child_id);
        const Box3d room{.min = node.bounds.min.array() - slack, .max = node.bounds.max.array() + slack};
        if (child.parent != id || child.key.level != node.key.level + 1 || child.key.parent() != node.key)
            throw at_node(child, "not an octant of its parent " + node_name(node.key));
        if (!room.contains(child.bounds.min) || !room.contains(child.bounds.max))
            throw at_node(child, "reaches beyond its parent " + node_name(node.key));
        if (child_id > node.first_child && child.key <= cloud.node(child_id - 1).key)
            throw at_node(child, "not in the order of octants");
    }
}

/// Loads every pending part; nodes are appended, so one pass over growing ids meets all.
void load_hierarchy(LayeredCloud& cloud) {
    for (size_t id = 0; id < cloud.node_count(); ++id) {
        if (cloud.node(NodeId(id)).children_pending) cloud.load_children(NodeId(id));
        check_children(cloud, NodeId(id));
    }
}

void check_byte_ranges(const LayeredCloud& cloud) {
    std::vector<NodeId> order;
    for (size_t id = 0; id < cloud.node_count(); ++id)
        if (cloud.node(NodeId(id)).byte_size > 0) order.push_back(NodeId(id));
    std::sort(order.begin(), order.end(), [&](NodeId a, NodeId b) {
        const LayeredNode &first = cloud.node(a), &second = cloud.node(b);
        return std::tie(first.byte_offset, first.key) < std::tie(second.byte_offset, second.key);
    });
    for (size_t i = 1; i < order.size(); ++i) {
        const LayeredNode &before = cloud.node(order[i - 1]), &node = cloud.node(order[i]);
        if (node.byte_offset - before.byte_offset < before.byte_size)
            throw at_node(node, "its bytes overlap those of node " + node_name(before.key));
    }
}

/// Least and greatest of what some points hold.
struct Extremes {
    std::vector<int32_t> low = std::vector<int32_t>(3, INT32_MAX), high = std::vector<int32_t>(3, INT32_MIN);
    std::vector<std::vector<double>> attribute_min, attribute_max;

    explicit Extremes(const std::vector<Attribute>& attributes) {
        for (const Attribute& attribute : attributes) {
            attribute_min.emplace_back(size_t(attribute.components), std::numeric_limits<double>::infinity());
            attribute_max.emplace_back(size_t(attribute.components), -std::numeric_limits<double>::infinity());
        }
    }
    void merge(const Extremes& other) {
        for (size_t axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], other.low[axis]);
            high[axis] = std::max(high[axis], other.high[axis]);
        }
        for (size_t i = 0; i < attribute_min.size(); ++i)
            for (size_t c = 0; c < attribute_min[i].size(); ++c) {
                attribute_min[i][c] = std::min(attribute_min[i][c], other.attribute_min[i][c]);
                attribute_max[i][c] = std::max(attribute_max[i][c], other.attribute_max[i][c]);
            }
    }
};

template <typename T>
void extend_column(std::span<const T> values, size_t components, std::vector<double>& least, std::vector<double>& most) {
    for (size_t c = 0; c < components; ++c) {
        T low = values[c], high = values[c];
        for (size_t i = c; i < values.size(); i += components) {
            low = std::min(low, values[i]);
            high = std::max(high, values[i]);
        }
        least[c] = std::min(least[c], double(low));
        most[c] = std::max(most[c], double(high));
    }
}

void extend_attribute(const PointBatch& batch, size_t index, const Attribute& attribute, Extremes& extremes) {
    const auto extend = [&]<typename T>(T) {
        extend_column<T>(batch.column<T>(index), size_t(attribute.components), extremes.attribute_min[index],
                         extremes.attribute_max[index]);
    };
    switch (attribute.type) {
        case ScalarType::int8: return extend(int8_t());
        case ScalarType::uint8: return extend(uint8_t());
        case ScalarType::int16: return extend(int16_t());
        case ScalarType::uint16: return extend(uint16_t());
        case ScalarType::int32: return extend(int32_t());
        case ScalarType::uint32: return extend(uint32_t());
        case ScalarType::int64: return extend(int64_t());
        case ScalarType::uint64: return extend(uint64_t());
        case ScalarType::float32: return extend(float());
        case ScalarType::float64: return extend(double());
    }
}

/// The quanta that may lie in a node's interval of one axis, one quantum of slack at both ends.
std::pair<double, double> quanta_limits(double min, double max, double scale, double offset) {
    const double rounding = std::max(std::abs(min), std::abs(max)) * 0x1p-50 / scale;  // of the box's doubles
    return {(min - offset) / scale - 1.0 - rounding, (max - offset) / scale + 1.0 + rounding};
}

void check_axis(const CloudInfo& info, const LayeredNode& node, std::span<const int32_t> quanta, int axis,
                Extremes& extremes) {
    const auto [low, high] = std::minmax_element(quanta.begin(), quanta.end());
    const auto [least, most] = quanta_limits(node.bounds.min[axis], node.bounds.max[axis],
                                             info.quantization.scale[axis], info.quantization.offset[axis]);
    for (const auto at : {low, high})
        if (double(*at) < least || double(*at) > most) {
            char numbers[160];
            const double world = double(*at) * info.quantization.scale[axis] + info.quantization.offset[axis];
            std::snprintf(numbers, sizeof numbers, "%c = %.10g lies outside the node's %.10g to %.10g", 'x' + axis, world,
                          node.bounds.min[axis], node.bounds.max[axis]);
            throw at_node(node, "point " + std::to_string(at - quanta.begin()) + ": " + numbers);
        }
    extremes.low[size_t(axis)] = std::min(extremes.low[size_t(axis)], *low);
    extremes.high[size_t(axis)] = std::max(extremes.high[size_t(axis)], *high);
}

void check_points(const LayeredCloud& cloud, NodeId id, std::span<const int> wanted, PointBatch& batch,
                  Extremes& extremes) {
    const LayeredNode& node = cloud.node(id);
    const CloudInfo& info = cloud.info();
    cloud.read_node(id, wanted, batch);
    if (batch.size != node.points)
        throw at_node(node, std::to_string(node.points) + " points expected, " + std::to_string(batch.size) + " read");
    if (batch.size == 0) return;
    check_axis(info, node, batch.x, 0, extremes);
    check_axis(info, node, batch.y, 1, extremes);
    check_axis(info, node, batch.z, 2, extremes);
    for (size_t i = 0; i < info.attributes.size(); ++i) extend_attribute(batch, i, info.attributes[i], extremes);
}

void read_all_points(const LayeredCloud& cloud, const ValidationSettings& settings, LayeredSummary& summary) {
    const CloudInfo& info = cloud.info();
    std::vector<NodeId> order(cloud.node_count());
    std::iota(order.begin(), order.end(), NodeId{0});
    std::sort(order.begin(), order.end(), [&](NodeId a, NodeId b) { return cloud.node(a).key < cloud.node(b).key; });
    std::vector<int> wanted(info.attributes.size());
    std::iota(wanted.begin(), wanted.end(), 0);

    std::mutex mutex;
    Extremes extremes(info.attributes);
    size_t fault_index = order.size();
    std::optional<Error> fault;
    uint64_t points_done = 0;
    constexpr size_t kBlock = 8;  // nodes
    parallel_blocks(settings.threads, order.size(), kBlock, [&](size_t begin, size_t end) {
        {
            const std::lock_guard lock(mutex);
            if (begin > fault_index) return;  // an earlier node is at fault already
        }
        PointBatch batch;
        Extremes own(info.attributes);
        uint64_t own_points = 0;
        std::optional<Error> own_fault;
        size_t i = begin;
        for (; i < end && !own_fault; ++i) {
            try {
                check_points(cloud, order[i], wanted, batch, own);
                own_points += batch.size;
            } catch (const Error& error) {
                own_fault = error;
            }
        }
        const std::lock_guard lock(mutex);
        extremes.merge(own);
        if (own_fault && i - 1 < fault_index) {
            fault_index = i - 1;
            fault = own_fault;
        }
        points_done += own_points;
        if (settings.on_progress) settings.on_progress(points_done);
    });
    if (fault) throw *fault;
    if (summary.points == 0) return;
    const auto world = [&](const std::vector<int32_t>& q) { return info.quantization.world_from_quanta({q[0], q[1], q[2]}); };
    summary.bounds.extend(world(extremes.low));
    summary.bounds.extend(world(extremes.high));
    summary.attribute_min = std::move(extremes.attribute_min);
    summary.attribute_max = std::move(extremes.attribute_max);
}

}  // namespace

LayeredSummary validate_layered(LayeredCloud& cloud, const ValidationSettings& settings) {
    load_hierarchy(cloud);
    check_byte_ranges(cloud);
    LayeredSummary summary;
    summary.nodes = cloud.node_count();
    for (size_t id = 0; id < cloud.node_count(); ++id) {
        const LayeredNode& node = cloud.node(NodeId(id));
        const size_t levels = std::max<size_t>(summary.points_per_level.size(), node.key.level + 1);
        summary.nodes_per_level.resize(levels);
        summary.points_per_level.resize(levels);
        ++summary.nodes_per_level[node.key.level];
        summary.points_per_level[node.key.level] += node.points;
        summary.points += node.points;
        summary.point_bytes += node.byte_size;
    }
    if (cloud.refinement() == Refinement::add && summary.points != cloud.info().points)
        throw Error(ErrorKind::malformed, "hierarchy: its nodes hold " + std::to_string(summary.points) + " points, " +
                                              std::to_string(cloud.info().points) + " are stated");
    if (settings.read_points) read_all_points(cloud, settings, summary);
    return summary;
}

}  // namespace strata
