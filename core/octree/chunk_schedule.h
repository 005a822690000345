#pragma once

#include <cstdint>
#include <vector>

#include "core/octree/partition.h"

namespace strata {

/// The order in which chunks are built, fixed by the partition alone. A chunk plants seeds from adjacent chunks of lower
/// rank, so it waits for those; ranks go by colour of a 2^3 checkerboard first, so that neighbours in rank are rarely
/// adjacent and threads seldom wait.
struct ChunkSchedule {
    std::vector<uint32_t> order;                      // [rank] chunk
    std::vector<uint32_t> rank;                       // [chunk]
    std::vector<std::vector<uint32_t>> waits_for;     // [chunk] adjacent chunks of lower rank

    explicit ChunkSchedule(const Partition& partition);
};

}  // namespace strata
