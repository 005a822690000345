#pragma once

#include <cstddef>
#include <functional>

namespace strata {

/// Calls body(begin, end) for blocks of at most `block` that cover [0, n), on at most `threads` threads.
/// Which thread runs a block, and when, is not defined, so results must not depend on it.
/// throws  whatever a body throws (one of them, once every started block has ended)
void parallel_blocks(int threads, size_t n, size_t block, const std::function<void(size_t begin, size_t end)>& body);

/// Runs body(worker) once on each of `threads` threads, worker = 0 ... threads - 1, and waits for all.
/// For work that hands itself out, such as an ordered queue: where the machine refuses a thread, there are fewer workers.
/// throws  what a body throws, once all have ended
void parallel_workers(int threads, const std::function<void(int worker)>& body);

/// The number of threads to use when the user did not say: those the process may run on.
int default_thread_count();

}  // namespace strata
