#include "io/potree/potree_cloud.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <shared_mutex>
#include <unordered_map>

#include "core/error.h"
#include "io/claimed_ranges.h"
#include "io/potree/potree_hierarchy.h"
#include "io/potree/potree_metadata.h"
#include "io/potree/potree_node.h"

namespace strata {
namespace {

constexpr uint64_t kMostChunkBytes = uint64_t{16} << 20;  // 760,000 nodes; a chunk of 4 levels has at most 4681

struct ChunkRange {
    uint64_t offset = 0, size = 0;
};

struct PotreePage : HierarchyPage {
    std::vector<ChunkNode> chunk;
    std::vector<HierarchyRecord> proxied;  // the real records of the chunk's proxies, in their order
};

class PotreeCloud : public LayeredCloud {
public:
    PotreeCloud(std::unique_ptr<ByteSource> metadata, std::unique_ptr<ByteSource> hierarchy,
                std::unique_ptr<ByteSource> octree)
        : hierarchy_(std::move(hierarchy)), octree_(std::move(octree)) {
        read_metadata(*metadata);
        const ChunkRange first{0, metadata_.first_chunk_bytes};
        check_range(first, NodeKey());
        claim_chunk(first, NodeKey());
        const PotreePage page = read_chunk(first, NodeKey());
        LayeredNode root = layered_node(NodeKey(), page.chunk.front().record);
        points_listed_ = root.points;
        nodes_.push_back(root);
        pending_.emplace(0, first);
        adopt_chunk(0, page);
    }

    const CloudInfo& info() const override { return info_; }
    size_t node_count() const override { return nodes_.size(); }
    const LayeredNode& node(NodeId id) const override { return nodes_[id]; }

    std::unique_ptr<HierarchyPage> read_page(NodeId id) const override {
        ChunkRange range;
        NodeKey key;
        {
            const std::shared_lock lock(nodes_mutex_);
            const auto found = pending_.find(id);
            if (found == pending_.end()) return nullptr;
            range = found->second;
            key = nodes_[id].key;
        }
        return std::make_unique<PotreePage>(read_chunk(range, key));
    }

    void add_page(NodeId id, const HierarchyPage& page) override {
        if (pending_.contains(id)) adopt_chunk(id, static_cast<const PotreePage&>(page));
    }

    void read_node(NodeId id, std::span<const int> wanted, PointBatch& out) const override {
        const LayeredNode source = [&] {
            const std::shared_lock lock(nodes_mutex_);
            return nodes_[id];
        }();
        if (source.points == 0) return resize_batch(out, 0, info_.attributes, wanted);
        const auto stored = std::make_unique_for_overwrite<std::byte[]>(size_t(source.byte_size));
        const std::span<std::byte> bytes(stored.get(), size_t(source.byte_size));
        octree_->read(source.byte_offset, bytes);
        try {
            decode_potree_node(metadata_, bytes, source.points, wanted, out);
        } catch (const Error& error) {
            throw error.within(octree_->name() + ": node " + node_name(source.key));
        }
    }

private:
    void read_metadata(const ByteSource& source) {
        if (source.size() > kMostMetadataBytes)
            throw Error(ErrorKind::limit, source.name() + ": at most " + std::to_string(kMostMetadataBytes) +
                                              " bytes are expected, " + std::to_string(source.size()) + " found");
        std::vector<std::byte> text(size_t(source.size()));
        source.read(0, text);
        try {
            metadata_ = parse_potree_metadata(text);
        } catch (const Error& error) {
            throw error.within(source.name());
        }
        info_.format = metadata_.encoding == PotreeEncoding::plain ? "potree 2.0, DEFAULT" : "potree 2.0, BROTLI";
        info_.points = metadata_.points;
        info_.bounds = metadata_.tight;
        info_.quantization = metadata_.quantization;
        info_.attributes = metadata_.attributes;
        info_.attribute_min = metadata_.attribute_min;
        info_.attribute_max = metadata_.attribute_max;
        info_.crs = metadata_.projection;
    }

    Error at_node(const NodeKey& key, const std::string& message) const {
        return {ErrorKind::malformed, hierarchy_->name() + ": node " + node_name(key) + ": " + message};
    }

    void check_range(const ChunkRange& range, const NodeKey& key) const {
        const uint64_t file_bytes = hierarchy_->size();
        if (range.offset > file_bytes || range.size > file_bytes - range.offset)
            throw at_node(key, "its chunk of " + std::to_string(range.size) + " bytes at " + std::to_string(range.offset) +
                                   " lies beyond the file's " + std::to_string(file_bytes) + " bytes");
        if (range.size < kHierarchyRecordBytes || range.size > kMostChunkBytes || range.size % kHierarchyRecordBytes != 0)
            throw at_node(key, "a chunk of 22-byte records, at most 16 MiB, is expected, " + std::to_string(range.size) +
                                   " bytes found");
    }

    /// A chunk belongs to one proxy, and no byte to two chunks.
    void claim_chunk(const ChunkRange& range, const NodeKey& key) {
        if (!claimed_.claim(range.offset, range.size))
            throw at_node(key, "its chunk at byte " + std::to_string(range.offset) + " is part of another");
    }

    PotreePage read_chunk(const ChunkRange& range, const NodeKey& root) const {
        std::vector<std::byte> bytes(static_cast<size_t>(range.size));
        hierarchy_->read(range.offset, bytes);
        PotreePage page;
        try {
            page.chunk = parse_hierarchy_chunk(bytes, root);
            if (page.chunk.front().record.type == PotreeNodeType::proxy)
                throw Error(ErrorKind::malformed, "node " + node_name(root) + ": a chunk that begins with a proxy");
        } catch (const Error& error) {
            throw error.within(hierarchy_->name());
        }
        page.proxied = read_proxied(proxies_of(page.chunk));
        return page;
    }

    /// A node as its real record describes it, without place among its relatives.
    LayeredNode layered_node(const NodeKey& key, const HierarchyRecord& record) const {
        if (record.points > 0 &&
            (record.byte_offset > octree_->size() || record.byte_size > octree_->size() - record.byte_offset))
            throw at_node(key, "its " + std::to_string(record.byte_size) + " bytes at " +
                                   std::to_string(record.byte_offset) + " lie beyond the " +
                                   std::to_string(octree_->size()) + " bytes of " + octree_->name());
        if (metadata_.encoding == PotreeEncoding::plain && record.points > 0 &&
            record.byte_size != uint64_t{record.points} * metadata_.record_bytes)
            throw at_node(key, std::to_string(record.points) + " points of " + std::to_string(metadata_.record_bytes) +
                                   " bytes expected, " + std::to_string(record.byte_size) + " bytes stated");
        LayeredNode node;
        // From level and index, not by halving again and again: neighbors share the same border.
        const Vec3d side = metadata_.cube.size() * std::ldexp(1.0, -int(key.level));
        node.bounds.min = metadata_.cube.min + side.cwiseProduct(Vec3d(key.x, key.y, key.z));
        node.bounds.max = metadata_.cube.min + side.cwiseProduct(Vec3d(key.x + 1.0, key.y + 1.0, key.z + 1.0));
        node.spacing = std::ldexp(metadata_.spacing, -int(key.level));
        node.error = record.child_mask != 0 ? node.spacing : 0.0;
        node.points = record.points;
        node.byte_offset = record.points > 0 ? record.byte_offset : 0;
        node.byte_size = record.points > 0 ? record.byte_size : 0;
        node.key = key;
        return node;
    }

    static std::vector<ChunkNode> proxies_of(const std::vector<ChunkNode>& chunk) {
        std::vector<ChunkNode> proxies;
        for (const ChunkNode& entry : chunk)
            if (entry.record.type == PotreeNodeType::proxy) proxies.push_back(entry);
        return proxies;
    }

    /// The real records of the nodes that a chunk's proxies stand for: the first of each one's own chunk.
    std::vector<HierarchyRecord> read_proxied(std::span<const ChunkNode> proxies) const {
        std::vector<std::array<std::byte, kHierarchyRecordBytes>> bytes(proxies.size());
        std::vector<ByteRange> ranges;
        for (size_t i = 0; i < proxies.size(); ++i) {
            check_range({proxies[i].record.byte_offset, proxies[i].record.byte_size}, proxies[i].key);
            ranges.push_back({proxies[i].record.byte_offset, bytes[i]});
        }
        hierarchy_->read_many(ranges);
        std::vector<HierarchyRecord> records;
        for (size_t i = 0; i < proxies.size(); ++i) {
            const NodeKey& key = proxies[i].key;
            try {
                records.push_back(parse_hierarchy_record(bytes[i]));
            } catch (const Error& error) {
                throw at_node(key, error.what());
            }
            if (records.back().type == PotreeNodeType::proxy) throw at_node(key, "a chunk that begins with a proxy");
        }
        return records;
    }

    /// Adds the nodes of a chunk below `root_id`, or throws and changes nothing.
    void adopt_chunk(NodeId root_id, const PotreePage& page) {
        const std::vector<ChunkNode> proxies = proxies_of(page.chunk);
        size_t claims = 0;
        try {
            for (; claims < proxies.size(); ++claims)
                claim_chunk({proxies[claims].record.byte_offset, proxies[claims].record.byte_size}, proxies[claims].key);
            add_nodes(root_id, page);
        } catch (...) {
            while (claims > 0) claimed_.release(proxies[--claims].record.byte_offset);
            throw;
        }
    }

    void add_nodes(NodeId root_id, const PotreePage& page) {
        const std::vector<ChunkNode>& chunk = page.chunk;
        // The chunk's root is a node already; its other records follow the nodes known so far.
        const size_t first_id = nodes_.size() - 1;
        if (first_id + chunk.size() >= kNoNode) throw at_node(chunk.front().key, "more nodes than can be numbered");
        std::vector<LayeredNode> added;
        added.reserve(chunk.size());
        std::vector<std::pair<NodeId, ChunkRange>> pending;
        size_t proxies_met = 0;
        uint64_t points_listed = points_listed_;
        for (const ChunkNode& entry : chunk) {
            const bool is_proxy = entry.record.type == PotreeNodeType::proxy;
            const HierarchyRecord& record = is_proxy ? page.proxied[proxies_met++] : entry.record;
            if (is_proxy && record.child_mask == 0 && entry.record.byte_size != kHierarchyRecordBytes)
                throw at_node(entry.key, "its chunk holds more than a node without children");
            LayeredNode node = layered_node(entry.key, record);
            if (is_proxy && record.child_mask != 0) {
                node.children_pending = true;
                pending.push_back({NodeId(first_id + added.size()), {entry.record.byte_offset, entry.record.byte_size}});
            } else if (entry.child_count > 0) {
                node.first_child = NodeId(first_id + entry.first_child);
                node.child_count = entry.child_count;
            }
            if (!added.empty()) points_listed += node.points;
            if (points_listed > metadata_.points)
                throw at_node(entry.key, "the nodes hold more than the " + std::to_string(metadata_.points) +
                                             " points of metadata.json");
            added.push_back(node);
        }
        for (size_t i = 0; i < chunk.size(); ++i)
            for (uint32_t child = 0; child < chunk[i].child_count; ++child)
                added[chunk[i].first_child + child].parent = i == 0 ? root_id : NodeId(first_id + i);
        added.front().parent = nodes_[root_id].parent;

        const std::unique_lock lock(nodes_mutex_);
        nodes_[root_id] = added.front();
        nodes_.insert(nodes_.end(), added.begin() + 1, added.end());
        pending_.erase(root_id);
        pending_.insert(pending.begin(), pending.end());
        points_listed_ = points_listed;
    }

    std::unique_ptr<ByteSource> hierarchy_, octree_;
    PotreeMetadata metadata_;
    CloudInfo info_;
    std::vector<LayeredNode> nodes_;
    mutable std::shared_mutex nodes_mutex_;  // between read_node and the one thread that adds nodes and needs none to read them
    std::unordered_map<NodeId, ChunkRange> pending_;  // nodes whose children are in a chunk not read yet
    ClaimedRanges claimed_;                           // the chunks that some proxy names
    uint64_t points_listed_ = 0;  // of all nodes so far; never more than metadata.json states
};

}  // namespace

std::unique_ptr<LayeredCloud> open_potree(std::unique_ptr<ByteSource> metadata, std::unique_ptr<ByteSource> hierarchy,
                                          std::unique_ptr<ByteSource> octree) {
    return std::make_unique<PotreeCloud>(std::move(metadata), std::move(hierarchy), std::move(octree));
}

std::unique_ptr<LayeredCloud> open_potree(const std::string& path) {
    constexpr std::string_view kMetadataName = "metadata.json";
    std::string folder = path.ends_with(kMetadataName) ? path.substr(0, path.size() - kMetadataName.size()) : path;
    if (!folder.empty() && !folder.ends_with('/')) folder += '/';
    auto metadata = open_file(folder + std::string(kMetadataName));
    auto hierarchy = open_file(folder + "hierarchy.bin");
    return open_potree(std::move(metadata), std::move(hierarchy), open_file(folder + "octree.bin"));
}

}  // namespace strata
