#pragma once

#include <span>
#include <vector>

#include "core/cloud/point_filter.h"
#include "core/octree/layered_cloud.h"
#include "render/point_color.h"
#include "render/point_normals.h"
#include "render/stream/node_cache.h"
#include "render/stream/resident_node.h"

namespace strata {

/// Reads, decodes, colors and filters a node. Safe from several threads at once.
/// attributes  those that colors, filter and normals want
/// normals     nullptr: the node gets none
ResidentNode load_node(const LayeredCloud& cloud, const NodeRequest& request, std::span<const int> attributes,
                       const PointColorizer& colors, const PointFilter& filter, const PointNormals* normals = nullptr);

}  // namespace strata
