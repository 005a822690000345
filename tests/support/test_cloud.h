#pragma once

#include <vector>

#include "core/octree/layered_cloud.h"

namespace strata {

/// A layered cloud whose nodes a test states one by one.
class TestCloud : public LayeredCloud {
public:
    struct Node {
        LayeredNode node;
        std::vector<Vec3i> quanta;
        bool hidden_children = false;  // known only after load_children
    };

    CloudInfo cloud_info;
    std::vector<Node> nodes;
    size_t loads = 0;

    const CloudInfo& info() const override { return cloud_info; }
    size_t node_count() const override { return nodes.size(); }
    const LayeredNode& node(NodeId id) const override { return nodes[id].node; }
    std::unique_ptr<HierarchyPage> read_page(NodeId) const override { return std::make_unique<HierarchyPage>(); }
    void add_page(NodeId id, const HierarchyPage&) override {
        nodes[id].node.children_pending = false;
        ++loads;
    }
    void read_node(NodeId id, std::span<const int> wanted, PointBatch& out) const override;
};

/// One node that holds all the points; a color derived from the index. spacing: world units
TestCloud single_node_cloud(const std::vector<Vec3i>& quanta, const Quantization& quantization, double spacing);

/// A full octree over the cube [0, side]^3 whose nodes have `points` points in metadata and none in fact.
TestCloud full_octree(double side, uint32_t levels, uint64_t points);

}  // namespace strata
