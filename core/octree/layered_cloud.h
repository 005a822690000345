#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/cloud/point_source.h"
#include "core/math/box.h"
#include "core/octree/node_key.h"

namespace strata {

using NodeId = uint32_t;
inline constexpr NodeId kNoNode = ~NodeId{0};

/// What a node adds to its parent when it is drawn.
enum class Refinement { add, replace };

/// One node of a level-of-detail cloud. Node ids are opaque to users; a node's children have consecutive ids.
struct LayeredNode {
    Box3d bounds;              // world; holds the points of the node and of everything below it
    double spacing = 0.0;      // world units; distance that the node's points keep from each other
    double error = 0.0;        // world units; how far a point left out may lie from a drawn one: spacing, 0 at leaves
    uint64_t points = 0;       // in this node alone
    uint64_t byte_offset = 0;  // where its data lies: one range, so that many can be fetched together
    uint64_t byte_size = 0;
    NodeKey key;               // orders nodes the same way in every run: ties in depth go to the lower (key, point index)
    NodeId parent = kNoNode;
    NodeId first_child = kNoNode;
    uint32_t child_count = 0;
    bool children_pending = false;  // children exist but are not loaded yet: call load_children
};

/// A part of a hierarchy that was read and is not part of the cloud yet. Each format has its own.
struct HierarchyPage {
    virtual ~HierarchyPage() = default;
};

/// What every level-of-detail format looks like to the renderer: Potree today; COPC, 3D Tiles, HTTP later.
/// Nodes are known from the hierarchy; points are read a node at a time, from any thread.
class LayeredCloud {
public:
    virtual ~LayeredCloud() = default;

    virtual const CloudInfo& info() const = 0;
    virtual Refinement refinement() const { return Refinement::add; }
    virtual NodeId root() const { return 0; }
    virtual size_t node_count() const = 0;  // loaded so far
    /// The reference lasts until the next add_page or load_children.
    virtual const LayeredNode& node(NodeId id) const = 0;

    /// Reads the part of the hierarchy below a node whose children are pending. Safe to call from several threads
    /// at once, and during add_page.
    /// returns  null where no children are pending
    /// throws   Error{malformed, io}, naming the file and the node
    virtual std::unique_ptr<HierarchyPage> read_page(NodeId) const { return nullptr; }
    /// Makes a page that read_page gave for this node part of the cloud, or throws and changes nothing; does nothing where no
    /// children are pending any more. From the thread that asks for nodes, while others may be in read_page and read_node.
    /// throws  Error{malformed, limit}
    virtual void add_page(NodeId, const HierarchyPage&) {}
    /// Both at once.
    void load_children(NodeId id) {
        if (node(id).children_pending) add_page(id, *read_page(id));
    }

    /// Reads and decodes the points of one node. Safe to call from several threads at once, and during add_page.
    /// wanted  indices into info().attributes; positions (quanta of info().quantization) always come
    /// throws  Error{malformed, io}, naming the file, the node and the place
    virtual void read_node(NodeId id, std::span<const int> wanted, PointBatch& out) const = 0;
};

}  // namespace strata
