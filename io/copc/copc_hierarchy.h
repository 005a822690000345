#pragma once

#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "core/octree/node_key.h"
#include "io/byte_source.h"
#include "io/las/las_header.h"

namespace strata::copc {

/// What a COPC file says of its octree: the record "copc", 1.
/// source  COPC Specification 1.0, "info VLR"
struct Info {
    Vec3d center;
    double half_size = 0.0;  // of the root's cube, world units
    double spacing = 0.0;    // of the root's points, world units; halves with each level
    uint64_t root_offset = 0, root_bytes = 0;  // of the root's page
};

/// throws  Error{malformed, unsupported, io}: file, place, expectation
Info read_info(const ByteSource& source, const las::Header& header);

/// One entry of a page: a node and its chunk of points, or the page that holds the node's entry and what lies below it.
struct Entry {
    NodeKey key;
    uint64_t offset = 0, bytes = 0;
    uint32_t points = 0;
    bool is_page = false;
};

/// A page of the hierarchy: a node and nodes below it, each with its parent.
class Page {
public:
    /// Reads and checks a page; nothing in it names bytes that the file does not have.
    /// root    the node whose entry and descendants the page holds
    /// throws  Error{malformed, limit, io}, naming file and node
    Page(const ByteSource& source, const NodeKey& root, uint64_t offset, uint64_t bytes);

    /// Null: not in the page.
    const Entry* find(const NodeKey& key) const;
    size_t size() const { return entries_.size(); }

private:
    std::vector<Entry> entries_;  // ascending by key
};

/// "level-x-y-z", as COPC's tools have it.
std::string entry_name(const NodeKey& key);

}  // namespace strata::copc
