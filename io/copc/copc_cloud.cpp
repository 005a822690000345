#include "io/copc/copc_cloud.h"

#include <array>
#include <cmath>
#include <mutex>
#include <shared_mutex>
#include <string>
#include <unordered_map>
#include <utility>

#include "core/error.h"
#include "io/claimed_ranges.h"
#include "io/copc/copc_hierarchy.h"
#include "io/las/las_extra_bytes.h"
#include "io/las/las_info.h"
#include "io/las/laz_chunk_reader.h"

namespace strata {
namespace {

using copc::Entry;
using copc::Page;

// What lies below a node whose children's entries are partly in pages of their own: those pages, by octant.
struct CopcPages : HierarchyPage {
    std::array<std::shared_ptr<const Page>, 8> of_octant;
};

las::Header read_copc_header(const ByteSource& bytes) {
    las::Header header = las::read_header(bytes);
    if (!header.compressed || header.point_format < 6 || header.point_format > 8)
        throw Error(ErrorKind::malformed, bytes.name() + ": COPC has compressed points of format 6, 7 or 8, " + std::to_string(header.point_format) +
                                              (header.compressed ? "" : ", not compressed,") + " found");
    return header;
}

class CopcCloud : public LayeredCloud {
public:
    explicit CopcCloud(std::unique_ptr<ByteSource> bytes)
        : bytes_(std::move(bytes)),
          header_(read_copc_header(*bytes_)),
          copc_(copc::read_info(*bytes_, header_)),
          laz_(las::read_laz_header(*bytes_, header_)),
          notes_(header_.notes),
          columns_(header_.point_format, header_.record_size, las::read_extra_bytes(*bytes_, header_, notes_)),
          chunks_(*bytes_, header_, laz_, columns_) {
        info_ = las::cloud_info(*bytes_, header_, columns_, "copc 1.0, laz", std::move(notes_));
        const Vec3d half = Vec3d::Constant(copc_.half_size);
        const Box3d cube = {.min = copc_.center - half, .max = copc_.center + half};
        const Vec3d least = cube.min - 0.01 * half, most = cube.max + 0.01 * half;  // writers round
        if (header_.points > 0 && !((info_.bounds.min.array() >= least.array()).all() && (info_.bounds.max.array() <= most.array()).all())) {
            info_.bounds = cube;
            info_.notes.push_back("the header's box reaches beyond the octree's cube, which is taken for it");
        }
        const auto page = std::make_shared<const Page>(*bytes_, NodeKey(), copc_.root_offset, copc_.root_bytes);
        if (page->size() == 0) {
            if (header_.points > 0) throw Error(ErrorKind::malformed, bytes_->name() + ": hierarchy: the root's page is empty");
            return;
        }
        claim(NodeKey(), copc_.root_offset, copc_.root_bytes);
        Growth growth(*this);
        growth.append(*page->find(NodeKey()), kNoNode, page);
        expand_all(growth);
        keep(growth);
    }

    const CloudInfo& info() const override { return info_; }
    size_t node_count() const override { return nodes_.size(); }
    const LayeredNode& node(NodeId id) const override { return nodes_[id]; }

    std::unique_ptr<HierarchyPage> read_page(NodeId id) const override {
        NodeKey key;
        std::shared_ptr<const Page> page;
        {
            const std::shared_lock lock(nodes_mutex_);
            const auto found = pending_.find(id);
            if (found == pending_.end()) return nullptr;
            page = found->second;
            key = nodes_[id].key;
        }
        auto pages = std::make_unique<CopcPages>();
        for (int octant = 0; octant < 8; ++octant) {
            const NodeKey child = key.child(octant);
            if (const Entry* const entry = page->find(child); entry != nullptr && entry->is_page) {
                pages->of_octant[size_t(octant)] = std::make_shared<const Page>(*bytes_, child, entry->offset, entry->bytes);
                if (pages->of_octant[size_t(octant)]->size() == 0) throw at_node(child, "it is missing from its page");
            }
        }
        return pages;
    }

    void add_page(NodeId id, const HierarchyPage& page) override {
        const auto found = pending_.find(id);
        if (found == pending_.end()) return;
        Growth growth(*this);
        LayeredNode node = nodes_[id];
        expand(node, id, found->second, static_cast<const CopcPages&>(page).of_octant, growth);
        expand_all(growth);
        const std::unique_lock lock(nodes_mutex_);
        nodes_[id] = node;
        pending_.erase(id);
        keep(growth);
    }

    void read_node(NodeId id, std::span<const int> wanted, PointBatch& out) const override {
        const LayeredNode source = [&] {
            const std::shared_lock lock(nodes_mutex_);
            return nodes_[id];
        }();
        if (source.points == 0) return resize_batch(out, 0, info_.attributes, wanted);
        try {
            chunks_.read({source.byte_offset, source.byte_size, source.points, false}, wanted, out);
        } catch (const Error& error) {
            if (error.kind == ErrorKind::malformed) throw error.within(bytes_->name() + ": node " + copc::entry_name(source.key));
            throw;
        }
    }

private:
    Error at_node(const NodeKey& key, const std::string& message) const {
        return {ErrorKind::malformed, bytes_->name() + ": hierarchy: node " + copc::entry_name(key) + ": " + message};
    }

    /// No byte belongs to two chunks or pages, so that no point comes twice.
    void claim(const NodeKey& key, uint64_t offset, uint64_t size) {
        if (!claimed_.claim(offset, size)) throw at_node(key, "its bytes at " + std::to_string(offset) + " are part of another node or page");
    }

    LayeredNode layered_node(const Entry& entry, NodeId parent) const {
        LayeredNode node;
        // From level and index, not by halving again and again: neighbors share the same border.
        const double side = std::ldexp(2.0 * copc_.half_size, -int(entry.key.level));
        const Vec3d low = copc_.center - Vec3d::Constant(copc_.half_size);
        node.bounds.min = low + side * Vec3d(entry.key.x, entry.key.y, entry.key.z);
        node.bounds.max = low + side * Vec3d(entry.key.x + 1.0, entry.key.y + 1.0, entry.key.z + 1.0);
        node.spacing = std::ldexp(copc_.spacing, -int(entry.key.level));
        node.points = entry.points;
        node.byte_offset = entry.offset;
        node.byte_size = entry.bytes;
        node.key = entry.key;
        node.parent = parent;
        return node;
    }

    // A node on its way into the cloud, and the page that lists its children.
    struct NewNode {
        LayeredNode node;
        std::shared_ptr<const Page> page;
    };
    using PagesOfOctants = std::array<std::shared_ptr<const Page>, 8>;

    /// What comes behind the nodes known so far. Claims are given up again unless it is kept.
    struct Growth {
        explicit Growth(CopcCloud& grown) : cloud(grown), first_id(NodeId(grown.nodes_.size())), points_listed(grown.points_listed_) {}
        Growth(const Growth&) = delete;
        Growth& operator=(const Growth&) = delete;
        ~Growth() {
            for (const uint64_t offset : claims) cloud.claimed_.release(offset);
        }

        void claim(const Entry& entry) {
            if (entry.bytes == 0) return;
            cloud.claim(entry.key, entry.offset, entry.bytes);
            claims.push_back(entry.offset);
        }
        void append(const Entry& entry, NodeId parent, std::shared_ptr<const Page> page) {
            claim(entry);
            points_listed += entry.points;
            if (points_listed > cloud.header_.points)
                throw cloud.at_node(entry.key, "the nodes hold more than the " + std::to_string(cloud.header_.points) + " points of the header");
            if (first_id + nodes.size() + 1 >= kNoNode) throw cloud.at_node(entry.key, "more nodes than can be numbered");
            nodes.push_back({cloud.layered_node(entry, parent), std::move(page)});
        }

        CopcCloud& cloud;
        NodeId first_id;
        std::vector<NewNode> nodes;
        uint64_t points_listed;
        std::vector<uint64_t> claims;
    };

    /// Appends a node's children, which come one behind the other, unless entries of theirs are on pages that are not at hand.
    void expand(LayeredNode& node, NodeId id, const std::shared_ptr<const Page>& page, const PagesOfOctants& of_octant, Growth& growth) const {
        std::array<const Entry*, 8> children;
        bool is_inner = false;
        node.children_pending = false;
        for (size_t octant = 0; octant < 8; ++octant) {
            children[octant] = page->find(node.key.child(int(octant)));
            is_inner |= children[octant] != nullptr;
            node.children_pending |= children[octant] != nullptr && children[octant]->is_page && of_octant[octant] == nullptr;
        }
        node.error = is_inner ? node.spacing : 0.0;
        if (!is_inner || node.children_pending) return;
        node.first_child = growth.first_id + NodeId(growth.nodes.size());
        for (size_t octant = 0; octant < 8; ++octant) {
            const Entry* const child = children[octant];
            if (child == nullptr) continue;
            ++node.child_count;
            if (child->is_page) growth.claim(*child);
            const std::shared_ptr<const Page>& own = child->is_page ? of_octant[octant] : page;
            growth.append(*own->find(child->key), id, own);
        }
    }

    void expand_all(Growth& growth) const {
        for (size_t i = 0; i < growth.nodes.size(); ++i) {
            NewNode next = growth.nodes[i];
            expand(next.node, growth.first_id + NodeId(i), next.page, {}, growth);
            growth.nodes[i] = std::move(next);
        }
    }

    void keep(Growth& growth) {
        for (NewNode& next : growth.nodes) {
            if (next.node.children_pending) pending_.emplace(NodeId(nodes_.size()), std::move(next.page));
            nodes_.push_back(next.node);
        }
        points_listed_ = growth.points_listed;
        growth.claims.clear();
    }

    std::unique_ptr<ByteSource> bytes_;
    las::Header header_;
    copc::Info copc_;
    las::LazHeader laz_;
    std::vector<std::string> notes_;
    las::Columns columns_;
    las::LazChunkReader chunks_;
    CloudInfo info_;
    std::vector<LayeredNode> nodes_;
    mutable std::shared_mutex nodes_mutex_;  // between readers and the one thread that adds nodes and needs none to read them
    std::unordered_map<NodeId, std::shared_ptr<const Page>> pending_;  // nodes some of whose children are on pages not read yet, and the page that says so
    ClaimedRanges claimed_;                 // the pages and chunks that a node names
    uint64_t points_listed_ = 0;            // of all nodes so far; never more than the header states
};

}  // namespace

std::unique_ptr<LayeredCloud> open_copc(std::unique_ptr<ByteSource> bytes) { return std::make_unique<CopcCloud>(std::move(bytes)); }

}  // namespace strata
