#pragma once

#include <functional>
#include <span>

#include "core/cloud/point_source.h"

namespace strata {

/// Reads a source from its first point to its last, with all attributes: batches are read in parallel, a round of them at a
/// time, and taken in order.
/// round_points  about how many points a round holds; it has one batch or more
/// take          gets the batches of a round; it may use threads itself
/// throws        what the source or `take` throws
void read_in_rounds(const PointSource& source, int threads, uint64_t round_points,
                    const std::function<void(std::span<const PointBatch>)>& take);

/// The points of a round that keeps `threads` threads busy, and less where memory is short.
/// point_bytes  what a point takes on its way
uint64_t points_of_round(int threads, uint64_t memory_bytes, uint64_t point_bytes);

}  // namespace strata
