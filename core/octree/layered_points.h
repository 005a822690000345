#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/cloud/clip_box.h"
#include "core/cloud/point_source.h"
#include "core/octree/layered_cloud.h"

namespace strata {

/// Which nodes of a layered cloud are read: those that clip boxes may leave points of, down to a level.
struct NodeChoice {
    std::vector<ClipBox> clips;
    uint32_t deepest_level = std::numeric_limits<uint32_t>::max();  // the root's is 0

    bool everything() const { return clips.empty() && deepest_level == std::numeric_limits<uint32_t>::max(); }
};

/// An additive layered cloud as a plain source of points: a node is a batch. A view: the cloud is its owner's.
class LayeredPoints : public PointSource {
public:
    /// Loads the hierarchy, but for what lies below nodes that are not chosen.
    explicit LayeredPoints(LayeredCloud& cloud, const NodeChoice& choice = {});

    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return nodes_.size(); }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        cloud_.read_node(nodes_[size_t(index)], wanted, out);
    }

private:
    const LayeredCloud& cloud_;
    CloudInfo info_;  // the bounds are the whole cloud's
    std::vector<NodeId> nodes_;
};

}  // namespace strata
