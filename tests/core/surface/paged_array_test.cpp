#include "core/surface/paged_array.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/math/random.h"
#include "tests/support/store_in_memory.h"

namespace strata {
namespace {

// Four pages are in memory, of some thirty: whatever is set, grown and asked for, and in which order, is as in a vector.
TEST(PagedArray, IsAsAVectorWithFourPagesInMemory) {
    constexpr size_t kPage = 64;
    test::StoreInMemory scratch;
    ScratchRoom room(scratch);
    const uint64_t taken = room.take(100);  // another's
    PagedArray<uint32_t, kPage> paged(&room, 0);
    std::vector<uint32_t> plain;
    Random random(11);
    uint32_t next = 1;
    for (int step = 0; step < 20'000; ++step) {
        const double choice = random.uniform();
        if (plain.empty() || (choice < 0.02 && plain.size() < 30 * kPage)) {
            const auto most = uint64_t(random.uniform(1.0, 150.0));
            const std::span<uint32_t> fresh = paged.grow(most);
            ASSERT_GE(fresh.size(), 1u);
            ASSERT_LE(fresh.size(), most);
            for (uint32_t& value : fresh) plain.push_back(value = next++);
            ASSERT_EQ(paged.size(), plain.size());
            continue;
        }
        // Near the end, or anywhere.
        const auto at = choice < 0.5 ? plain.size() - 1 - size_t(random.uniform() * double(std::min<size_t>(plain.size(), 80))) : size_t(random.uniform() * double(plain.size()));
        if (choice < 0.3 || choice > 0.9) {
            plain[at] = next;
            paged.set(at, next++);
        }
        ASSERT_EQ(paged[at], plain[at]) << step << ": " << at;
    }
    EXPECT_GE(plain.size(), 30 * kPage);
    for (size_t at = 0; at < plain.size(); ++at) ASSERT_EQ(paged[at], plain[at]) << at;
    EXPECT_EQ(taken, 0u);
    // Pages have a place of their own each, however often they go there.
    const uint64_t pages = (plain.size() + kPage - 1) / kPage;
    EXPECT_GE(scratch.size(), 100 + (pages - 4) * kPage * sizeof(uint32_t));
    EXPECT_LE(scratch.size(), 100 + pages * kPage * sizeof(uint32_t));
}

TEST(PagedArray, StaysInMemoryWithoutAStore) {
    PagedArray<uint32_t, 16> paged(nullptr, 0);
    while (paged.size() < 1000) {
        const auto first = uint32_t(paged.size());
        const std::span<uint32_t> fresh = paged.grow(1000 - first);
        for (size_t n = 0; n < fresh.size(); ++n) fresh[n] = 3 * (first + uint32_t(n));
    }
    for (uint32_t at = 0; at < 1000; ++at) ASSERT_EQ(paged[at], 3 * at);
}

}  // namespace
}  // namespace strata
