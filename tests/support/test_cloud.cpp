#include "tests/support/test_cloud.h"

#include <cstring>

#include "core/math/random.h"

namespace strata {

void TestCloud::read_node(NodeId id, std::span<const int> wanted, PointBatch& out) const {
    const std::vector<Vec3i>& quanta = nodes[id].quanta;
    resize_batch(out, quanta.size(), cloud_info.attributes, wanted);
    for (size_t i = 0; i < quanta.size(); ++i) {
        out.x[i] = quanta[i].x();
        out.y[i] = quanta[i].y();
        out.z[i] = quanta[i].z();
    }
    for (const int column : wanted) {
        std::vector<std::byte>& bytes = out.columns[size_t(column)];
        const size_t size = cloud_info.attributes[size_t(column)].size_bytes();
        for (size_t i = 0; i < quanta.size(); ++i) {
            const uint64_t value = mix_bits(i);
            std::memcpy(&bytes[i * size], &value, std::min(size, sizeof value));
        }
    }
}

TestCloud single_node_cloud(const std::vector<Vec3i>& quanta, const Quantization& quantization, double spacing) {
    TestCloud cloud;
    cloud.cloud_info.quantization = quantization;
    cloud.cloud_info.points = quanta.size();
    cloud.cloud_info.attributes = {{.name = "rgb", .description = "", .type = ScalarType::uint16, .components = 3}};
    TestCloud::Node root;
    for (const Vec3i& q : quanta) root.node.bounds.extend(quantization.world_from_quanta(q));
    root.node.points = quanta.size();
    root.node.spacing = spacing;
    root.quanta = quanta;
    cloud.cloud_info.bounds = root.node.bounds;
    cloud.nodes.push_back(root);
    return cloud;
}

TestCloud full_octree(double side, uint32_t levels, uint64_t points) {
    TestCloud cloud;
    TestCloud::Node root;
    root.node.bounds.min = Vec3d::Zero();
    root.node.bounds.max = Vec3d::Constant(side);
    cloud.nodes.push_back(root);
    for (size_t id = 0; id < cloud.nodes.size(); ++id) {
        LayeredNode node = cloud.nodes[id].node;
        node.points = points;
        node.spacing = side / 128.0 / double(1 << node.key.level);
        node.error = node.key.level + 1 < levels ? node.spacing : 0.0;
        if (node.key.level + 1 < levels) {
            node.first_child = NodeId(cloud.nodes.size());
            node.child_count = 8;
            for (int octant = 0; octant < 8; ++octant) {
                TestCloud::Node child;
                child.node.key = node.key.child(octant);
                child.node.parent = NodeId(id);
                const double size = side / double(2 << node.key.level);
                child.node.bounds.min = size * Vec3d(child.node.key.x, child.node.key.y, child.node.key.z);
                child.node.bounds.max = child.node.bounds.min + Vec3d::Constant(size);
                cloud.nodes.push_back(child);
            }
        }
        cloud.nodes[id].node = node;
        cloud.cloud_info.points += points;
    }
    cloud.cloud_info.bounds = root.node.bounds;
    return cloud;
}

}  // namespace strata
