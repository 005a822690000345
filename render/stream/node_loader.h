#pragma once

#include <memory>
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

/// How far points lie apart on the surface that they sample, from the number of cells they occupy in grids of several
/// sizes. 0 for less than two distinct points.
/// source  box counting: points a cell and the cell's side give points an area
double measure_spacing(std::span<const int32_t> x, std::span<const int32_t> y, std::span<const int32_t> z, const Vec3d& scale);

/// Spacing within nodes whose descendants are drawn too, by the finest drawn node at each place.
/// nodes    ascending by key, parents with their children
/// returns  one grid a node; empty where the node has no drawn child
std::vector<std::unique_ptr<SpacingGrid>> build_spacing_grids(const LayeredCloud& cloud, std::span<const NodeId> nodes,
                                                              std::span<const ResidentNode> points);

}  // namespace strata
