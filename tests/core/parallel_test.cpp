#include "core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace strata {
namespace {

class OnThreads : public testing::TestWithParam<int> {};

// Every index in exactly one block, no block above the size asked for, whatever the number of threads.
TEST_P(OnThreads, BlocksCoverTheRangeOnce) {
    for (const size_t n : {0, 1, 2, 63, 64, 65, 1000}) {
        for (const size_t block : {0, 1, 7, 64, 5000}) {
            std::vector<std::atomic<int>> visits(n);
            std::atomic<size_t> longest = 0, empty = 0;
            parallel_blocks(GetParam(), n, block, [&](size_t begin, size_t end) {
                empty += begin >= end;
                for (size_t seen = longest; seen < end - begin && !longest.compare_exchange_weak(seen, end - begin);) {
                }
                for (size_t i = begin; i < end; ++i) ++visits.at(i);
            });
            for (size_t i = 0; i < n; ++i)
                ASSERT_EQ(visits[i], 1) << "index " << i << " of " << n << " in blocks of " << block;
            EXPECT_EQ(empty, 0u);
            EXPECT_LE(longest, std::max<size_t>(block, 1));
        }
    }
}

// Blocks begin at multiples of the block size, so that results kept by block do not depend on the threads.
TEST_P(OnThreads, BlocksBeginAtMultiples) {
    std::vector<std::atomic<size_t>> ends(10);
    parallel_blocks(GetParam(), 95, 10,
                    [&](size_t begin, size_t end) { ends.at(begin / 10) = begin % 10 == 0 ? end : 0; });
    for (size_t i = 0; i < 9; ++i) EXPECT_EQ(ends[i], (i + 1) * 10);
    EXPECT_EQ(ends[9], 95u);
}

TEST_P(OnThreads, WhatABlockThrowsArrivesOnceAllHaveEnded) {
    std::atomic<int> running = 0;
    try {
        parallel_blocks(GetParam(), 1000, 1, [&](size_t begin, size_t) {
            ++running;
            if (begin == 500) {
                --running;
                throw std::runtime_error("block 500");
            }
            --running;
        });
        FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "block 500");
    }
    EXPECT_EQ(running, 0);
    size_t sum = 0;  // and the threads are fit for more work
    parallel_blocks(GetParam(), 1, 1, [&](size_t, size_t end) { sum += end; });
    EXPECT_EQ(sum, 1u);
}

TEST_P(OnThreads, BlocksNest) {
    std::atomic<size_t> visits = 0;
    parallel_blocks(GetParam(), 8, 1, [&](size_t, size_t) {
        parallel_blocks(GetParam(), 100, 9, [&](size_t begin, size_t end) { visits += end - begin; });
    });
    EXPECT_EQ(visits, 800u);
}

// Workers run at the same time: each waits here until all have come.
TEST_P(OnThreads, WorkersRunTogetherUnderTheirOwnNumbers) {
    const int threads = GetParam();
    std::vector<std::atomic<int>> runs(threads);
    std::vector<std::thread::id> ids(threads);
    std::atomic<int> arrived = 0;
    parallel_workers(threads, [&](int worker) {
        ++runs.at(size_t(worker));
        ids[size_t(worker)] = std::this_thread::get_id();
        ++arrived;
        while (arrived < threads) std::this_thread::yield();
    });
    for (const auto& count : runs) EXPECT_EQ(count, 1);
    EXPECT_EQ(std::set<std::thread::id>(ids.begin(), ids.end()).size(), size_t(threads));
}

TEST_P(OnThreads, WhatAWorkerThrowsArrivesOnceAllHaveEnded) {
    std::atomic<int> ended = 0;
    EXPECT_THROW(parallel_workers(GetParam(),
                                  [&](int worker) {
                                      ++ended;
                                      if (worker == GetParam() - 1) throw std::logic_error("the last worker");
                                  }),
                 std::logic_error);
    EXPECT_EQ(ended, GetParam());
}

INSTANTIATE_TEST_SUITE_P(Parallel, OnThreads, testing::Values(1, 2, 7),
                         [](const auto& threads) { return std::to_string(threads.param); });

TEST(Parallel, TheDefaultIsAtLeastOneThread) { EXPECT_GE(default_thread_count(), 1); }

}  // namespace
}  // namespace strata
