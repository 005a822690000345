#include "render/stream/shape_field.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "render/stream/local_shape.h"

namespace strata {
namespace {

constexpr size_t kNoSlot = ~size_t{0};
constexpr int kAncestors = 3;     // whose points are measured with a node's own; those farther up are too few to matter
// In spacings of the node.
constexpr float kMostGap = 8.0f;
constexpr float kAlone = 2.0f;  // the parent's: that near lies another point that is kept
// Gaps are closed by the points of that level whose spacing is theirs: those of finer levels, of which there are four times
// as many each, need not reach as far.
constexpr float kReach = 2.0f;

// The drawn nodes as a tree.
struct DrawnTree {
    DrawnTree(const LayeredCloud& cloud, std::span<const NodeId> nodes) : slot_of(cloud.node_count(), kNoSlot), children(nodes.size()) {
        for (size_t slot = 0; slot < nodes.size(); ++slot) slot_of[nodes[slot]] = slot;
        for (size_t slot = 0; slot < nodes.size(); ++slot) {
            const NodeId parent = cloud.node(nodes[slot]).parent;
            if (parent != kNoNode && slot_of[parent] != kNoSlot) children[slot_of[parent]].push_back(slot);
        }
    }

    std::vector<size_t> slot_of;                // by node id
    std::vector<std::vector<size_t>> children;  // [slot]
};

bool is_inner(const LayeredNode& node) { return node.child_count > 0 || node.children_pending; }

SpacingLimits limits_of(const LayeredNode& node) {
    return {.least = is_inner(node) ? float(node.spacing) : 0.0f, .most = kMostGap * float(node.spacing), .alone = kAlone * float(node.spacing)};
}

void measure(const LayeredCloud& cloud, std::span<const NodeId> nodes, std::span<ResidentNode* const> points, const DrawnTree& tree, size_t slot) {
    std::vector<const ResidentNode*> above;
    NodeId ancestor = cloud.node(nodes[slot]).parent;
    for (int generation = 0; generation < kAncestors && ancestor != kNoNode; ++generation) {
        if (const size_t at = tree.slot_of[ancestor]; at != kNoSlot) above.push_back(points[at]);
        ancestor = cloud.node(ancestor).parent;
    }
    ResidentNode& node = *points[slot];
    node.local_shape = measure_local_shape(node, above, cloud.info().quantization.scale, limits_of(cloud.node(nodes[slot])));
    node.shape_measured = true;
}

// Bounds in quanta, for finding the child that a point lies in.
struct QuantaBox {
    std::array<int64_t, 3> low, high;

    QuantaBox(const Box3d& box, const Quantization& quantization) {
        const auto first_from = [&](double world, int axis) {
            return int64_t(std::ceil(std::clamp((world - quantization.offset[axis]) / quantization.scale[axis], -0x1p62, 0x1p62)));
        };
        for (int axis = 0; axis < 3; ++axis) {
            low[size_t(axis)] = first_from(box.min[axis], axis);
            high[size_t(axis)] = first_from(box.max[axis], axis);
        }
    }
    bool holds(int32_t x, int32_t y, int32_t z) const {
        return x >= low[0] && x < high[0] && y >= low[1] && y < high[1] && z >= low[2] && z < high[2];
    }
};

}  // namespace

void update_shapes(const LayeredCloud& cloud, std::span<const NodeId> nodes, std::span<ResidentNode* const> points, int threads) {
    const DrawnTree tree(cloud, nodes);
    parallel_blocks(threads, nodes.size(), 1, [&](size_t begin, size_t end) {
        for (size_t slot = begin; slot < end; ++slot)
            if (!points[slot]->shape_measured) measure(cloud, nodes, points, tree, slot);
    });

    std::vector<std::vector<NodeId>> below(nodes.size());  // all drawn descendants, ascending
    for (size_t slot = nodes.size(); slot-- > 0;)
        for (const size_t child : tree.children[slot]) {
            below[slot].push_back(nodes[child]);
            below[slot].insert(below[slot].end(), below[child].begin(), below[child].end());
        }
    const Quantization& quantization = cloud.info().quantization;
    std::vector<QuantaBox> boxes;
    boxes.reserve(nodes.size());
    for (const NodeId node : nodes) boxes.emplace_back(cloud.node(node).bounds, quantization);

    parallel_blocks(threads, nodes.size(), 1, [&](size_t begin, size_t end) {
        for (size_t slot = begin; slot < end; ++slot) {
            ResidentNode& node = *points[slot];
            if (node.shapes.size() == node.size() && node.shapes_from == below[slot]) continue;
            node.shapes.resize(node.size());
            const LayeredNode& own = cloud.node(nodes[slot]);
            const float reach = kReach * float(own.spacing) * (is_inner(own) ? 1.0f : 2.0f);  // leaves hold what their parents left out
            for (size_t i = 0; i < node.size(); ++i) {
                const int32_t x = node.x[i], y = node.y[i], z = node.z[i];
                size_t finest = slot;
                for (bool descended = true; descended;) {
                    descended = false;
                    for (const size_t child : tree.children[finest])
                        if (boxes[child].holds(x, y, z)) {
                            finest = child;
                            descended = true;
                            break;
                        }
                }
                PointShape shape;
                if (!points[finest]->local_shape.cells.empty()) shape = points[finest]->local_shape.at(x, y, z);
                if (!(shape.spacing > 0.0f)) shape.spacing = float(cloud.node(nodes[finest]).spacing);
                shape.spacing = std::min(shape.spacing, reach);
                node.shapes[i] = shape;
            }
            node.shapes_from = std::move(below[slot]);
            ++node.shapes_version;
        }
    });
}

}  // namespace strata
