#include "core/voxel/ordered_batches.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <vector>

#include "core/parallel.h"

namespace strata {

void batches_in_order(int threads, size_t jobs, const std::function<void(int, size_t, VoxelBatch&)>& make,
                      const std::function<void(size_t, const VoxelBatch&)>& take) {
    threads = int(std::clamp<size_t>(size_t(std::max(threads, 1)), 1, std::max<size_t>(jobs, 1)));
    struct Slot {
        VoxelBatch batch;
        bool made = false;
    };
    // Batches that wait for an earlier one: enough that a long job does not stop the others at once.
    std::vector<Slot> slots(threads == 1 ? 1 : 4 * size_t(threads));
    std::mutex mutex;
    std::condition_variable changed;
    size_t next = 0, taken = 0;
    bool taking = false, failed = false;
    parallel_workers(threads, [&](int worker) {
        std::unique_lock lock(mutex);
        try {
            while (true) {
                changed.wait(lock, [&] { return failed || next >= jobs || next < taken + slots.size(); });
                if (failed || next >= jobs) return;
                const size_t job = next++;
                Slot& slot = slots[job % slots.size()];
                lock.unlock();
                slot.batch.clear();
                make(worker, job, slot.batch);
                lock.lock();
                slot.made = true;
                if (taking) continue;
                taking = true;
                while (!failed && slots[taken % slots.size()].made) {
                    Slot& first = slots[taken % slots.size()];
                    lock.unlock();
                    take(taken, first.batch);
                    lock.lock();
                    first.made = false;
                    ++taken;
                    changed.notify_all();
                }
                taking = false;
            }
        } catch (...) {
            if (!lock.owns_lock()) lock.lock();
            failed = true;
            changed.notify_all();
            throw;
        }
    });
}

}  // namespace strata
