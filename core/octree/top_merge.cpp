#include "core/octree/top_merge.h"

#include <algorithm>
#include <array>

#include "core/octree/record_layout.h"
#include "core/parallel.h"

namespace strata {
namespace {

struct NodeRecords {
    NodeKey key;
    std::vector<std::byte> records;
};

// Encodes nodes on all threads and stores them in order.
void store_nodes(std::vector<NodeRecords>& nodes, size_t record_size, int threads, const NodeSink& sink,
                 const std::function<void(std::span<const BuiltNode>, std::span<const std::byte>)>& store) {
    std::vector<std::vector<std::byte>> encoded(nodes.size());
    std::vector<BuiltNode> built(nodes.size());
    parallel_blocks(threads, nodes.size(), 1, [&](size_t i, size_t) {
        const uint32_t points = uint32_t(nodes[i].records.size() / record_size);
        if (points > 0) sink.encode(nodes[i].records, points, encoded[i]);
        built[i] = {nodes[i].key, points, 0, encoded[i].size()};
    });
    nodes.clear();
    for (size_t i = 0; i < built.size(); ++i) store({&built[i], 1}, encoded[i]);
}

}  // namespace

void Promoted::add(const NodeKey& key, std::span<const std::byte> records) {
    Entry entry;
    entry.size = records.size();
    if (scratch_) {
        entry.offset = end_;
        scratch_->write(end_, records);
        end_ += records.size();
    } else {
        entry.records.assign(records.begin(), records.end());
    }
    entries_.emplace(key, std::move(entry));
}

std::vector<std::byte> Promoted::take(const NodeKey& key) {
    const auto found = entries_.find(key);
    std::vector<std::byte> records = std::move(found->second.records);
    if (scratch_) {
        records.resize(found->second.size);
        scratch_->read(found->second.offset, records);
        scratch_->discard(found->second.offset, found->second.size);
    }
    entries_.erase(found);
    return records;
}

void merge_top(const Partition& partition, const OctreeFrame& frame, size_t record_size, int threads, Promoted& promoted,
               const std::function<std::span<const BorderPoint>(uint32_t chunk)>& border_of, const NodeSink& sink,
               const std::function<void(std::span<const BuiltNode>, std::span<const std::byte>)>& store) {
    std::vector<NodeRecords> waiting;  // to be encoded together
    if (partition.root() < 0) {
        waiting.emplace_back();
        return store_nodes(waiting, record_size, 1, sink, store);
    }
    std::vector<const Partition::Node*> inner;
    for (const Partition::Node& node : partition.nodes())
        if (node.chunk < 0) inner.push_back(&node);
    std::sort(inner.begin(), inner.end(), [](const Partition::Node* a, const Partition::Node* b) {
        return a->key.level != b->key.level ? a->key.level > b->key.level : octant_order(a->key, b->key);
    });

    NodeSampler sampler(frame);
    std::map<NodeKey, std::vector<Vec3i>> borders;  // of finished nodes, near their faces
    for (const Partition::Node* node : inner) {
        std::vector<NodeRecords> children;
        std::array<std::vector<int32_t>, 3> candidates;
        for (const int32_t child : node->children) {
            if (child < 0) continue;
            const NodeKey& key = partition.nodes()[size_t(child)].key;
            children.push_back({key, promoted.take(key)});
            const std::vector<std::byte>& records = children.back().records;
            for (size_t at = 0; at < records.size(); at += record_size)
                for (int axis = 0; axis < 3; ++axis) candidates[size_t(axis)].push_back(record_position(&records[at])[axis]);
        }
        sampler.start(node->key);
        for_each_neighbour(node->key, [&](const NodeKey& key) {
            if (const auto found = borders.find(key); found != borders.end()) {
                for (const Vec3i& p_quanta : found->second) sampler.add_seed(p_quanta, key.level);
            } else if (const auto chunk = partition.chunk_above(key)) {
                for (const BorderPoint& point : border_of(*chunk))
                    if (point.level <= key.level) sampler.add_seed(point.p_quanta, key.level);
            }
        });
        std::vector<uint32_t> picked;
        sampler.sample(candidates[0], candidates[1], candidates[2], picked);

        std::vector<std::byte> kept;
        std::vector<Vec3i>& border = borders[node->key];
        size_t next_picked = 0;
        uint32_t index = 0;
        for (NodeRecords& child : children) {
            std::vector<std::byte> left;
            for (size_t at = 0; at < child.records.size(); at += record_size, ++index) {
                const bool moves_up = next_picked < picked.size() && picked[next_picked] == index;
                std::vector<std::byte>& to = moves_up ? kept : left;
                to.insert(to.end(), child.records.begin() + ptrdiff_t(at), child.records.begin() + ptrdiff_t(at + record_size));
                if (!moves_up) continue;
                ++next_picked;
                const Vec3i p_quanta = record_position(&child.records[at]);
                if (sampler.near_faces(p_quanta)) border.push_back(p_quanta);
            }
            waiting.push_back({child.key, std::move(left)});
        }
        promoted.add(node->key, kept);
        if (waiting.size() >= size_t(4 * threads)) store_nodes(waiting, record_size, threads, sink, store);
    }
    const NodeKey& root = partition.nodes()[size_t(partition.root())].key;
    waiting.push_back({root, promoted.take(root)});
    store_nodes(waiting, record_size, threads, sink, store);
}

}  // namespace strata
