#pragma once

#include <cstddef>
#include <functional>

#include "core/voxel/voxel_block.h"

namespace strata {

/// Makes one batch of each of `jobs` jobs in parallel and hands them on in the order of the jobs.
/// make  called on any thread; worker: 0 ... threads - 1, for buffers; the batch comes empty
/// take  called by one thread at a time
/// throws  what they throw, once all that runs has ended
void batches_in_order(int threads, size_t jobs, const std::function<void(int worker, size_t job, VoxelBatch&)>& make,
                      const std::function<void(size_t job, const VoxelBatch&)>& take);

}  // namespace strata
