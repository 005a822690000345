#include "core/octree/chunk_schedule.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/octree/subtree_builder.h"

namespace strata {

ChunkSchedule::ChunkSchedule(const Partition& partition) {
    const std::vector<Partition::Chunk>& chunks = partition.chunks();
    order.resize(chunks.size());
    std::iota(order.begin(), order.end(), 0u);
    // Large ones first within a colour: what is left at the end is small.
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        const auto place = [&](uint32_t c) { return std::tuple(chunks[c].key.octant(), ~chunks[c].points, chunks[c].key); };
        return place(a) < place(b);
    });
    rank.resize(chunks.size());
    for (uint32_t r = 0; r < order.size(); ++r) rank[order[r]] = r;

    waits_for.resize(chunks.size());
    for (uint32_t chunk = 0; chunk < chunks.size(); ++chunk)
        for_each_neighbour(chunks[chunk].key, [&](const NodeKey& key) {
            const auto other = partition.chunk_above(key);
            if (!other || *other == chunk) return;
            const bool other_first = rank[*other] < rank[chunk];
            waits_for[other_first ? chunk : *other].push_back(other_first ? *other : chunk);
        });
    for (std::vector<uint32_t>& list : waits_for) {
        std::sort(list.begin(), list.end());
        list.erase(std::unique(list.begin(), list.end()), list.end());
    }
}

}  // namespace strata
