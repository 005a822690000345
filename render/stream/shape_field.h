#pragma once

#include <span>

#include "core/octree/layered_cloud.h"
#include "render/stream/resident_node.h"

namespace strata {

/// Gives every point its shape by the finest drawn node at its place, so that points of coarse nodes shrink where finer ones
/// are drawn between them. Nodes are measured when first seen; shapes are kept while the nodes drawn below stay the same.
/// nodes   ascending by key, parents with their children; points as many
/// cost    0.2 ms a node and 10 ns a point when first seen, nothing for what stays
void update_shapes(const LayeredCloud& cloud, std::span<const NodeId> nodes, std::span<ResidentNode* const> points, int threads);

}  // namespace strata
