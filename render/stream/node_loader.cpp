#include "render/stream/node_loader.h"

#include <algorithm>

namespace strata {
namespace {

void find_extent(ResidentNode& node) {
    const auto extent = [&](const std::vector<int32_t>& values, int axis) {
        const auto [low, high] = std::minmax_element(values.begin(), values.end());
        node.min_quanta[axis] = *low;
        node.max_quanta[axis] = *high;
    };
    if (node.size() == 0) return;
    extent(node.x, 0);
    extent(node.y, 1);
    extent(node.z, 2);
}

}  // namespace

ResidentNode load_node(const LayeredCloud& cloud, const NodeRequest& request, std::span<const int> attributes,
                       const PointColorizer& colors, const PointFilter& filter, const PointNormals* normals) {
    PointBatch batch;
    cloud.read_node(request.id, attributes, batch);
    ResidentNode node;
    node.colors.resize(batch.size);
    colors.color(batch, request.level, node.colors);
    if (!filter.everything()) {
        node.passes.assign(batch.size, 1);
        filter.test(batch, request.level, node.passes);
    }
    if (normals != nullptr) node.normals = normals->read(batch);
    node.x = std::move(batch.x);
    node.y = std::move(batch.y);
    node.z = std::move(batch.z);
    find_extent(node);
    return node;
}

}  // namespace strata
