#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "core/voxel/voxel_block.h"

namespace strata {

/// Brings the batches of tasks that threads do side by side into the order of the tasks, and reuses their memory.
/// Tasks are begun in ascending order, and every task begun ends with deliver or end_turn.
class OrderedOutput {
public:
    /// window  tasks that may be begun before an earlier one has ended: that many batches may wait
    OrderedOutput(const VoxelSink& sink, uint64_t window) : sink_(sink), window_(window) {}

    /// Waits until a task is near enough to the first that is not done. False: another thread has failed.
    bool begin(uint64_t task);
    /// An empty batch.
    VoxelBatch batch();
    /// The one batch of a task.
    void deliver(uint64_t task, VoxelBatch&& batch);

    /// For a task of many batches: waits until all before are out. False: another thread has failed.
    bool wait_for_turn(uint64_t task);
    /// Puts a batch out, in the task's turn.
    void put(const VoxelBatch& batch) const {
        if (!batch.blocks.empty()) sink_(batch);
    }
    void end_turn();

    /// This thread has failed: the others are not to wait for it.
    void fail();

private:
    void put_ready(std::unique_lock<std::mutex>& lock);

    const VoxelSink& sink_;
    uint64_t window_;
    std::mutex mutex_;
    std::condition_variable moved_;
    uint64_t next_ = 0;  // the first task that is not out
    bool putting_ = false, failed_ = false;
    std::map<uint64_t, VoxelBatch> ready_;
    std::vector<VoxelBatch> idle_;
};

}  // namespace strata
