#include "core/parallel.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#ifndef STRATA_STD_THREADS
#include <tbb/blocked_range.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#endif

namespace strata {

void parallel_workers(int threads, const std::function<void(int worker)>& body) {
    std::exception_ptr failure;
    std::mutex failure_mutex;
    const auto guarded = [&](int worker) {
        try {
            body(worker);
        } catch (...) {
            const std::lock_guard lock(failure_mutex);
            if (!failure) failure = std::current_exception();
        }
    };
    {
        std::vector<std::jthread> team;
        team.reserve(size_t(std::max(threads, 1)));
        try {
            for (int worker = 1; worker < threads; ++worker) team.emplace_back(guarded, worker);
        } catch (const std::exception&) {
            // The machine has no more threads to give: those that run do all the work.
        }
        guarded(0);
    }
    if (failure) std::rethrow_exception(failure);
}

void parallel_blocks(int threads, size_t n, size_t block, const std::function<void(size_t, size_t)>& body) {
    block = std::max<size_t>(block, 1);
    const size_t blocks = (n + block - 1) / block;
    if (threads <= 1 || blocks <= 1) {
        for (size_t begin = 0; begin < n; begin += block) body(begin, std::min(n, begin + block));
        return;
    }
#ifndef STRATA_STD_THREADS
    // It has no more threads to give than there are processors, and prints a warning when asked for them.
    tbb::task_arena arena(std::min(threads, tbb::info::default_concurrency()));
    arena.execute([&] {
        tbb::parallel_for(
            tbb::blocked_range<size_t>(0, blocks, 1),
            [&](const tbb::blocked_range<size_t>& range) {
                for (size_t i = range.begin(); i != range.end(); ++i) body(i * block, std::min(n, (i + 1) * block));
            },
            tbb::simple_partitioner());
    });
#else  // ThreadSanitizer cannot see into the packaged TBB
    std::atomic<size_t> next = 0;
    std::atomic<bool> failed = false;
    parallel_workers(int(std::min<size_t>(size_t(threads), blocks)), [&](int) {
        for (size_t i; !failed && (i = next++) < blocks;) {
            try {
                body(i * block, std::min(n, (i + 1) * block));
            } catch (...) {
                failed = true;
                throw;
            }
        }
    });
#endif
}

int default_thread_count() {
    cpu_set_t allowed;
    if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) return std::max(1, CPU_COUNT(&allowed));
    return std::max(1u, std::thread::hardware_concurrency());
}

}  // namespace strata
