#pragma once

#include <functional>
#include <map>
#include <span>
#include <vector>

#include "core/octree/node_sink.h"
#include "core/octree/octree_frame.h"
#include "core/octree/partition.h"
#include "core/octree/scratch_store.h"
#include "core/octree/subtree_builder.h"

namespace strata {

/// What finished nodes keep until their parents have chosen from it.
class Promoted {
public:
    /// scratch  nullptr: in memory; else from byte `begin` of it
    Promoted(ScratchStore* scratch, uint64_t begin) : scratch_(scratch), end_(begin) {}

    void add(const NodeKey& key, std::span<const std::byte> records);
    /// The records of a node; afterwards it holds them no more.
    std::vector<std::byte> take(const NodeKey& key);

private:
    struct Entry {
        std::vector<std::byte> records;
        uint64_t offset = 0, size = 0;
    };
    ScratchStore* scratch_;
    uint64_t end_;
    std::map<NodeKey, Entry> entries_;
};

/// Samples the nodes above the chunks, level by level from below, and stores them and the chunks' roots.
/// promoted   what the chunks' roots keep
/// border_of  what a chunk keeps near its faces
/// store      takes finished nodes, in an order that depends on the points alone
void merge_top(const Partition& partition, const OctreeFrame& frame, size_t record_size, int threads, Promoted& promoted,
               const std::function<std::span<const BorderPoint>(uint32_t chunk)>& border_of, const NodeSink& sink,
               const std::function<void(std::span<const BuiltNode>, std::span<const std::byte>)>& store);

}  // namespace strata
