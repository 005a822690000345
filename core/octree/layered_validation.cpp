#include "core/octree/layered_validation.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <mutex>
#include <numeric>
#include <string>
#include <tuple>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

/// What a check of this file found, as opposed to what the cloud threw: it does not name the cloud yet.
struct Fault : Error {
    explicit Fault(const std::string& message) : Error(ErrorKind::malformed, message) {}
};

Fault at_node(const LayeredNode& node, const std::string& message) {
    return Fault("node " + node_name(node.key) + ": " + message);
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
        cloud.load_children(NodeId(id));
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

/// The quanta that may lie in a node's interval of one axis, one quantum of slack at both ends.
std::pair<double, double> quanta_limits(double min, double max, double scale, double offset) {
    const double rounding = std::max(std::abs(min), std::abs(max)) * 0x1p-50 / scale;  // of the box's doubles
    return {(min - offset) / scale - 1.0 - rounding, (max - offset) / scale + 1.0 + rounding};
}

void check_axis(const CloudInfo& info, const LayeredNode& node, std::span<const int32_t> quanta, int axis) {
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
}

void check_points(const LayeredCloud& cloud, NodeId id, std::span<const int> wanted, PointBatch& batch) {
    const LayeredNode& node = cloud.node(id);
    cloud.read_node(id, wanted, batch);
    if (batch.size != node.points)
        throw at_node(node, std::to_string(node.points) + " points expected, " + std::to_string(batch.size) + " read");
    if (batch.size == 0) return;
    check_axis(cloud.info(), node, batch.x, 0);
    check_axis(cloud.info(), node, batch.y, 1);
    check_axis(cloud.info(), node, batch.z, 2);
}

/// Reads every node, in the order of keys as far as faults go: of several, that of the least key is thrown.
void check_all_points(const LayeredCloud& cloud, int threads) {
    std::vector<NodeId> order(cloud.node_count());
    std::iota(order.begin(), order.end(), NodeId{0});
    std::sort(order.begin(), order.end(), [&](NodeId a, NodeId b) { return cloud.node(a).key < cloud.node(b).key; });
    std::vector<int> wanted(cloud.info().attributes.size());
    std::iota(wanted.begin(), wanted.end(), 0);

    std::mutex mutex;
    size_t fault_index = order.size();
    std::exception_ptr fault;
    constexpr size_t kBlock = 8;  // nodes
    parallel_blocks(threads, order.size(), kBlock, [&](size_t begin, size_t end) {
        {
            const std::lock_guard lock(mutex);
            if (begin > fault_index) return;  // an earlier node is at fault already
        }
        PointBatch batch;
        for (size_t i = begin; i < end; ++i) {
            try {
                check_points(cloud, order[i], wanted, batch);
            } catch (const Error&) {
                const std::lock_guard lock(mutex);
                if (i < fault_index) {
                    fault_index = i;
                    fault = std::current_exception();
                }
                return;
            }
        }
    });
    if (fault) std::rethrow_exception(fault);
}

LayeredSummary summarize(const LayeredCloud& cloud) {
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
    return summary;
}

}  // namespace

LayeredSummary validate_layered(LayeredCloud& cloud, const ValidationSettings& settings) {
    try {
        load_hierarchy(cloud);
        check_byte_ranges(cloud);
        LayeredSummary summary = summarize(cloud);
        if (cloud.refinement() == Refinement::add && summary.points != cloud.info().points)
            throw Fault("hierarchy: its nodes hold " + std::to_string(summary.points) + " points, " +
                        std::to_string(cloud.info().points) + " are stated");
        if (settings.read_points) check_all_points(cloud, settings.threads);
        return summary;
    } catch (const Fault& fault) {
        if (settings.name.empty()) throw;
        throw fault.within(settings.name);
    }
}

}  // namespace strata
