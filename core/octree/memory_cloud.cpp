#include "core/octree/memory_cloud.h"

#include <algorithm>
#include <cstring>

#include "core/error.h"
#include "core/octree/record_layout.h"

namespace strata {
namespace {

class MemoryCloud : public LayeredCloud, public NodeSink {
public:
    const CloudInfo& info() const override { return info_; }
    size_t node_count() const override { return nodes_.size(); }
    const LayeredNode& node(NodeId id) const override { return nodes_[id]; }

    void read_node(NodeId id, std::span<const int> wanted, PointBatch& out) const override {
        const LayeredNode& node = nodes_[id];
        const RecordLayout layout(info_.attributes);
        resize_batch(out, node.points, info_.attributes, wanted);
        const std::byte* record = pieces_[node_piece_[id]].data() + node.byte_offset;
        for (size_t i = 0; i < node.points; ++i, record += layout.size) {
            const Vec3i p_quanta = record_position(record);
            out.x[i] = p_quanta.x(), out.y[i] = p_quanta.y(), out.z[i] = p_quanta.z();
            for (const int a : wanted) {
                const size_t size = info_.attributes[size_t(a)].size_bytes();
                std::memcpy(out.columns[size_t(a)].data() + i * size, record + layout.offsets[size_t(a)], size);
            }
        }
    }

    void begin(const BuiltCloud& cloud) override {
        info_.points = cloud.points;
        info_.crs = cloud.crs;
        info_.attributes = cloud.attributes;
        info_.attribute_min = cloud.attribute_min;
        info_.attribute_max = cloud.attribute_max;
        info_.quantization = cloud.quantization;
        info_.quantization.offset = cloud.source_quantization.world_from_quanta(cloud.min_quanta);
        if (cloud.points > 0) {
            info_.bounds.extend(info_.quantization.offset);
            info_.bounds.extend(cloud.source_quantization.world_from_quanta(cloud.max_quanta));
        }
        side_ = cloud.cube_side;
        spacing_ = cloud.spacing;
    }

    void encode(std::span<const std::byte> records, uint32_t, std::vector<std::byte>& out) const override {
        out.insert(out.end(), records.begin(), records.end());
    }

    void append(std::span<const BuiltNode> nodes, std::span<const std::byte> bytes) override {
        for (const BuiltNode& node : nodes) built_.push_back({node, pieces_.size()});
        pieces_.emplace_back(bytes.begin(), bytes.end());
    }

    void finish() override {
        std::sort(built_.begin(), built_.end(), [](const Built& a, const Built& b) {
            const NodeKey &p = a.node.key, &q = b.node.key;
            return p.level != q.level ? p.level < q.level : octant_order(p, q);
        });
        for (const Built& built : built_) add_node(built);
        built_ = {};
        for (LayeredNode& node : nodes_)
            if (node.child_count > 0) node.error = node.spacing;
    }

    void set_format(const std::string& format) { info_.format = format; }

private:
    struct Built {
        BuiltNode node;
        size_t piece;
    };

    // By level and octant order: the children of a node follow each other, and parents come before.
    void add_node(const Built& built) {
        const NodeKey& key = built.node.key;
        LayeredNode node;
        node.key = key;
        node.spacing = std::ldexp(spacing_, -int(key.level));
        node.points = built.node.points;
        node.byte_offset = built.node.byte_offset;
        node.byte_size = built.node.byte_size;
        const double side = std::ldexp(side_, -int(key.level));
        node.bounds.min = info_.quantization.offset + Vec3d(key.x, key.y, key.z) * side;
        node.bounds.max = node.bounds.min.array() + side;
        const NodeId id = NodeId(nodes_.size());
        if (key.level > 0) {
            while (nodes_[last_parent_].key != key.parent()) ++last_parent_;
            node.parent = last_parent_;
            LayeredNode& parent = nodes_[last_parent_];
            if (parent.child_count++ == 0) parent.first_child = id;
        }
        nodes_.push_back(node);
        node_piece_.push_back(built.piece);
    }

    CloudInfo info_;
    double side_ = 1.0, spacing_ = 1.0;
    std::vector<Built> built_;
    std::vector<std::vector<std::byte>> pieces_;  // as appended
    std::vector<LayeredNode> nodes_;
    std::vector<size_t> node_piece_;  // [nodes_]
    NodeId last_parent_ = 0;
};

}  // namespace

std::unique_ptr<LayeredCloud> build_memory_cloud(const PointSource& source, const BuildSettings& settings) {
    auto cloud = std::make_unique<MemoryCloud>();
    BuildSettings half = settings;
    half.memory_bytes = settings.memory_bytes / 2;  // the other half takes the nodes
    build_octree(source, half, nullptr, *cloud);
    cloud->set_format(source.info().format);
    return cloud;
}

}  // namespace strata
