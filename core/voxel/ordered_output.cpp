#include "core/voxel/ordered_output.h"

#include <utility>

namespace strata {

bool OrderedOutput::begin(uint64_t task) {
    std::unique_lock lock(mutex_);
    moved_.wait(lock, [&] { return failed_ || task < next_ + window_; });
    return !failed_;
}

VoxelBatch OrderedOutput::batch() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return {};
    VoxelBatch batch = std::move(idle_.back());
    idle_.pop_back();
    batch.clear();
    return batch;
}

void OrderedOutput::deliver(uint64_t task, VoxelBatch&& batch) {
    std::unique_lock lock(mutex_);
    ready_.emplace(task, std::move(batch));
    put_ready(lock);
}

bool OrderedOutput::wait_for_turn(uint64_t task) {
    std::unique_lock lock(mutex_);
    moved_.wait(lock, [&] { return failed_ || (next_ == task && !putting_); });
    return !failed_;
}

void OrderedOutput::end_turn() {
    std::unique_lock lock(mutex_);
    ++next_;
    moved_.notify_all();
    put_ready(lock);
}

void OrderedOutput::fail() {
    const std::lock_guard lock(mutex_);
    failed_ = true;
    moved_.notify_all();
}

// One thread puts out for all, while the others work.
void OrderedOutput::put_ready(std::unique_lock<std::mutex>& lock) {
    while (!putting_ && !failed_ && !ready_.empty() && ready_.begin()->first == next_) {
        putting_ = true;
        VoxelBatch batch = std::move(ready_.begin()->second);
        ready_.erase(ready_.begin());
        lock.unlock();
        put(batch);  // where it throws, the caller calls fail()
        lock.lock();
        putting_ = false;
        ++next_;
        idle_.push_back(std::move(batch));
        moved_.notify_all();
    }
}

}  // namespace strata
