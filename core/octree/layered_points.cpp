#include "core/octree/layered_points.h"

namespace strata {

LayeredPoints::LayeredPoints(LayeredCloud& cloud, const NodeChoice& choice) : cloud_(cloud), info_(cloud.info()) {
    const ClipRegion region(choice.clips, info_.quantization);
    std::vector<bool> chosen;
    if (!choice.everything()) info_.points = 0;
    // Nodes come behind their parents.
    for (NodeId id = 0; id < cloud.node_count(); ++id) {
        const LayeredNode& node = cloud.node(id);
        chosen.push_back((node.parent == kNoNode || chosen[node.parent]) && node.key.level <= choice.deepest_level &&
                         region.coverage(node.bounds) != Coverage::none);
        if (!chosen.back()) continue;
        nodes_.push_back(id);
        if (!choice.everything()) info_.points += node.points;
        if (node.key.level < choice.deepest_level) cloud.load_children(id);
    }
}

}  // namespace strata
