#include "core/idle_pool.h"

#include <gtest/gtest.h>

#include <atomic>

#include "core/parallel.h"

namespace strata {
namespace {

// As many are made as were ever in use at once, and none serves two.
TEST(IdlePool, ObjectsAreUsedAgainByOneThreadAtATime) {
    struct Counter {
        std::atomic<int> users = 0;
        int uses = 0;
    };
    IdlePool<Counter> pool;
    std::atomic<int> made = 0, shared = 0;
    parallel_workers(4, [&](int) {
        for (int i = 0; i < 1000; ++i) {
            std::unique_ptr<Counter> counter = pool.take([&] {
                ++made;
                return std::make_unique<Counter>();
            });
            shared += counter->users++;
            ++counter->uses;
            --counter->users;
            pool.give_back(std::move(counter));
        }
    });
    EXPECT_EQ(shared, 0);
    EXPECT_LE(made, 4);
    int uses = 0;
    for (const auto& counter : pool.idle()) uses += counter->uses;
    EXPECT_EQ(uses, 4000);
    EXPECT_EQ(pool.idle().size(), size_t(made));
}

}  // namespace
}  // namespace strata
