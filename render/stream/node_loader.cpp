#include "render/stream/node_loader.h"

#include <algorithm>
#include <mutex>

#include "core/error.h"
#include "core/parallel.h"

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

std::vector<ResidentNode> load_nodes(const LayeredCloud& cloud, std::span<const NodeId> nodes, const PointColorizer& colors,
                                     const PointFilter& filter, int threads, LoadFailures& failures) {
    std::vector<int> wanted(colors.wanted().begin(), colors.wanted().end());
    for (const int attribute : filter.wanted())
        if (std::find(wanted.begin(), wanted.end(), attribute) == wanted.end()) wanted.push_back(attribute);
    std::vector<ResidentNode> loaded(nodes.size());
    size_t first_failed = nodes.size();
    std::mutex failures_mutex;
    parallel_blocks(threads, nodes.size(), 1, [&](size_t begin, size_t end) {
        PointBatch batch;
        for (size_t i = begin; i < end; ++i) {
            ResidentNode& node = loaded[i];
            try {
                cloud.read_node(nodes[i], wanted, batch);
            } catch (const Error& error) {
                const std::lock_guard lock(failures_mutex);
                ++failures.count;
                if (i < first_failed) {
                    first_failed = i;
                    failures.first = error.what();
                }
                continue;
            }
            node.colors.resize(batch.size);
            colors.color(batch, cloud.node(nodes[i]).key.level, node.colors);
            if (!filter.everything()) {
                node.passes.assign(batch.size, 1);
                filter.test(batch, cloud.node(nodes[i]).key.level, node.passes);
            }
            node.x = std::move(batch.x);
            node.y = std::move(batch.y);
            node.z = std::move(batch.z);
            find_extent(node);
        }
    });
    return loaded;
}

}  // namespace strata
