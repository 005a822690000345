#pragma once

#include "core/cloud/point_source.h"
#include "core/octree/layered_cloud.h"

namespace strata {

/// An additive layered cloud as a plain source of points: a node is a batch. A view: the cloud is its owner's.
class LayeredPoints : public PointSource {
public:
    /// Loads the whole hierarchy.
    explicit LayeredPoints(LayeredCloud& cloud) : cloud_(cloud) {
        for (size_t id = 0; id < cloud.node_count(); ++id)
            cloud.load_children(NodeId(id));
    }

    const CloudInfo& info() const override { return cloud_.info(); }
    uint64_t batch_count() const override { return cloud_.node_count(); }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        cloud_.read_node(NodeId(index), wanted, out);
    }

private:
    const LayeredCloud& cloud_;
};

}  // namespace strata
