#include "render/stream/node_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <semaphore>
#include <stdexcept>

#include "core/error.h"
#include "core/math/random.h"

namespace strata {
namespace {

constexpr uint64_t kNodeBytes = 100;  // of each node of these tests, unless they say otherwise

// A node whose points say which it is.
ResidentNode node_of(const NodeRequest& request) {
    ResidentNode node;
    node.x = {int32_t(request.id)};
    return node;
}

std::vector<NodeRequest> requests(std::initializer_list<NodeId> ids, double error_px = 100.0) {
    std::vector<NodeRequest> list;
    for (const NodeId id : ids) list.push_back({.id = id, .error_px = error_px--, .bytes = kNodeBytes});
    return list;
}

std::vector<NodeId> present(NodeCache& cache, NodeId ids) {
    std::vector<NodeId> list;
    for (NodeId id = 0; id < ids; ++id)
        if (cache.find(id) != nullptr) list.push_back(id);
    return list;
}

using Ids = std::vector<NodeId>;

TEST(NodeCache, ReadsWhatIsMissingTheMostWantedFirst) {
    Ids order;
    NodeCache cache(1, [&](const NodeRequest& request) {
        order.push_back(request.id);
        return node_of(request);
    });
    std::vector<NodeRequest> wanted = requests({4, 2, 7});
    std::reverse(wanted.begin(), wanted.end());
    cache.begin_frame(wanted, 1000);
    EXPECT_TRUE(cache.wait());
    // The one thread may have taken the first request before the others were there, never a lesser one: they come together.
    EXPECT_EQ(order, (Ids{4, 2, 7}));
    cache.begin_frame(requests({2, 5, 4}), 1000);
    EXPECT_TRUE(cache.wait());
    EXPECT_EQ(order, (Ids{4, 2, 7, 5}));
    EXPECT_EQ(cache.reads_begun(), 4u);
    for (const NodeId id : {2u, 4u, 5u, 7u}) EXPECT_EQ(cache.find(id)->x[0], int32_t(id));
    EXPECT_EQ(cache.find(3), nullptr);
}

// Room goes from those wanted longest ago to the latest; of one frame's, the least wanted goes first.
TEST(NodeCache, EvictsTheLeastRecentlyWantedAndChildrenBeforeParents) {
    NodeCache cache(2, node_of);
    const auto frame = [&](std::initializer_list<NodeId> ids) {
        cache.begin_frame(requests(ids), 4 * kNodeBytes);
        ASSERT_TRUE(cache.wait());
    };
    frame({0, 1, 2, 3});
    frame({0, 1});
    frame({0, 4});  // 3 is as old as 2, and less wanted
    EXPECT_EQ(present(cache, 8), (Ids{0, 1, 2, 4}));
    frame({0, 5});
    EXPECT_EQ(present(cache, 8), (Ids{0, 1, 4, 5}));
    frame({0, 6, 7});
    EXPECT_EQ(present(cache, 8), (Ids{0, 5, 6, 7}));
    EXPECT_EQ(cache.used_bytes(), 4 * kNodeBytes);
}

// What a frame draws stays, whatever else it wants; what finds no room is left out.
TEST(NodeCache, NeverEvictsWhatTheFrameWants) {
    NodeCache cache(2, node_of);
    cache.begin_frame(requests({0, 1, 2}), 3 * kNodeBytes);
    ASSERT_TRUE(cache.wait());
    cache.begin_frame(requests({0, 1, 2, 3, 4}), 4 * kNodeBytes);
    ASSERT_TRUE(cache.wait());
    EXPECT_EQ(present(cache, 8), (Ids{0, 1, 2, 3}));
    cache.begin_frame(requests({0, 1, 2}), 2 * kNodeBytes);  // a smaller cap waits for frames that want less
    EXPECT_EQ(present(cache, 8), (Ids{0, 1, 2}));
    cache.begin_frame(requests({0, 1}), 2 * kNodeBytes);
    EXPECT_EQ(present(cache, 8), (Ids{0, 1}));
}

// A single node larger than the cap has its way: the root is always drawn.
TEST(NodeCache, ANodeLargerThanTheCapComesAlone) {
    NodeCache cache(1, node_of);
    cache.begin_frame(requests({1, 2}), 1000);
    ASSERT_TRUE(cache.wait());
    cache.begin_frame(std::vector<NodeRequest>{{.id = 0, .error_px = 1.0, .bytes = 5000}}, 1000);
    ASSERT_TRUE(cache.wait());
    EXPECT_EQ(present(cache, 8), Ids{0});
    EXPECT_EQ(cache.used_bytes(), 5000u);
}

// A loader that stops inside each read until it is let go.
struct Gate {
    std::counting_semaphore<64> open{0}, entered{0};

    ResidentNode pass(const NodeRequest& request) {
        entered.release();
        open.acquire();
        return node_of(request);
    }
};

TEST(NodeCache, DropsRequestsThatANewerFrameDoesNotWant) {
    Gate gate;
    NodeCache cache(1, [&](const NodeRequest& request) { return gate.pass(request); });
    cache.begin_frame(requests({1, 2, 3, 4}), 1000);
    gate.entered.acquire();  // 1 is being read, the others wait
    cache.begin_frame(requests({3, 5}), 1000);
    EXPECT_EQ(cache.used_bytes(), 3 * kNodeBytes);  // 1 on its way, 3 and 5
    gate.open.release(8);
    EXPECT_TRUE(cache.wait());
    EXPECT_EQ(present(cache, 8), (Ids{1, 3, 5}));  // what was read is kept
    EXPECT_EQ(cache.reads_begun(), 3u);
    cache.begin_frame(requests({6}), 3 * kNodeBytes);  // and goes first
    EXPECT_TRUE(cache.wait());
    EXPECT_EQ(present(cache, 8), (Ids{3, 5, 6}));
}

// A read under way that nobody wants any more holds its room; what needs it comes when it has ended.
TEST(NodeCache, WaitsForRoomThatAnOldReadHolds) {
    Gate gate;
    NodeCache cache(2, [&](const NodeRequest& request) { return gate.pass(request); });
    cache.begin_frame(requests({1, 2}), 2 * kNodeBytes);
    gate.entered.acquire();
    gate.entered.acquire();
    cache.begin_frame(requests({3, 4}), 2 * kNodeBytes);
    EXPECT_EQ(cache.used_bytes(), 2 * kNodeBytes);
    EXPECT_EQ(present(cache, 8), Ids());
    gate.open.release(8);
    EXPECT_TRUE(cache.wait());
    EXPECT_EQ(present(cache, 8), (Ids{3, 4}));
}

TEST(NodeCache, ADeadlineEndsTheWaiting) {
    Gate gate;
    NodeCache cache(1, [&](const NodeRequest& request) { return gate.pass(request); });
    cache.begin_frame(requests({1}), 1000);
    EXPECT_FALSE(cache.wait(NodeCache::Clock::time_point::min()));
    EXPECT_EQ(cache.find(1), nullptr);
    gate.open.release(8);
    EXPECT_TRUE(cache.wait());
    EXPECT_NE(cache.find(1), nullptr);
}

// A node that cannot be read is there without points, gives its room back, is reported once and never asked for again.
TEST(NodeCache, FailuresAreReportedOnce) {
    std::atomic<int> reads = 0;
    NodeCache cache(3, [&](const NodeRequest& request) {
        ++reads;
        if (request.id % 2 == 1) throw Error(ErrorKind::malformed, "node " + std::to_string(request.id));
        return node_of(request);
    });
    cache.begin_frame(requests({0, 5, 3, 2}), 1000);
    ASSERT_TRUE(cache.wait());
    EXPECT_EQ(cache.used_bytes(), 2 * kNodeBytes);
    const std::vector<LoadFailure> failures = cache.take_failures();
    ASSERT_EQ(failures.size(), 2u);
    EXPECT_EQ(failures[0].message, "node 3");
    EXPECT_EQ(failures[1].message, "node 5");
    ASSERT_NE(cache.find(5), nullptr);
    EXPECT_EQ(cache.find(5)->size(), 0u);
    cache.begin_frame(requests({0, 5, 3, 2}), 1000);
    ASSERT_TRUE(cache.wait());
    EXPECT_TRUE(cache.take_failures().empty());
    EXPECT_EQ(reads, 4);
}

TEST(NodeCache, WhatIsNoErrorIsThrownToTheFrame) {
    NodeCache cache(2, [](const NodeRequest&) -> ResidentNode { throw std::bad_alloc(); });
    cache.begin_frame(requests({1}), 1000);
    EXPECT_THROW(cache.wait(), std::bad_alloc);
}

// Frames along a random walk, some of which do not wait: the nodes there, by their own sizes, stay under the cap after every
// step, also while others are read; a frame that waits has all it wants.
TEST(NodeCache, TheCapHoldsOnARandomWalk) {
    for (const int threads : {1, 2, 7}) {
        Random random(19);
        constexpr NodeId kIds = 200;
        constexpr uint64_t kCap = 3000;
        const auto bytes_of = [](NodeId id) { return 40 + id * 7 % 160; };
        std::atomic<uint64_t> in_work = 0, most_in_work = 0;
        NodeCache cache(threads, [&](const NodeRequest& request) {
            const uint64_t now = in_work += request.bytes;
            for (uint64_t most = most_in_work; now > most && !most_in_work.compare_exchange_weak(most, now);) {
            }
            ResidentNode node = node_of(request);
            in_work -= request.bytes;
            return node;
        });
        const auto bytes_here = [&] {
            uint64_t sum = 0;
            for (const NodeId id : present(cache, kIds)) sum += bytes_of(id);
            return sum;
        };
        double place = 0.0;
        for (int frame = 0; frame < 400; ++frame) {
            place += random.uniform(-8, 10);
            std::vector<NodeRequest> wanted;
            uint64_t sum = 0;
            for (NodeId step = 0; sum < kCap - 200; ++step) {
                const NodeId id = NodeId(std::abs(place) + step) % kIds;
                wanted.push_back({.id = id, .error_px = 1000.0 - step, .bytes = bytes_of(id)});
                sum += bytes_of(id);
            }
            cache.begin_frame(wanted, kCap);
            ASSERT_LE(cache.used_bytes(), kCap);
            ASSERT_LE(bytes_here(), kCap);
            if (frame % 3 == 0) {
                ASSERT_TRUE(cache.wait());
                for (const NodeRequest& request : wanted) ASSERT_NE(cache.find(request.id), nullptr);
            }
            ASSERT_LE(bytes_here(), cache.used_bytes());
            ASSERT_LE(cache.used_bytes(), kCap);
        }
        EXPECT_LE(most_in_work, kCap);
        EXPECT_GT(cache.reads_begun(), 300u);
    }
}

}  // namespace
}  // namespace strata
