#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/cloud/point_filter.h"
#include "core/octree/layered_cloud.h"
#include "render/point_color.h"
#include "render/stream/resident_node.h"

namespace strata {

/// Nodes that were to be drawn but could not be read; the frame goes on without them.
struct LoadFailures {
    uint64_t count = 0;
    std::string first;  // of the lowest slot, whatever the threads
};

/// Reads, decodes, colors and filters nodes, several at a time. What a cache that outlives the frame will replace.
/// returns  one entry a node, in the given order; empty where reading failed
std::vector<ResidentNode> load_nodes(const LayeredCloud& cloud, std::span<const NodeId> nodes, const PointColorizer& colors,
                                     const PointFilter& filter, int threads, LoadFailures& failures);

}  // namespace strata
