#include "core/cloud/point_rounds.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/support/memory_source.h"

namespace strata {
namespace {

MemorySource numbered(int points) {
    std::vector<Vec3i> positions;
    for (int i = 0; i < points; ++i) positions.emplace_back(i, 0, 0);
    return MemorySource(std::move(positions));
}

// Batches of a MemorySource have 10,000 points.
TEST(PointRounds, EveryPointComesOnceAndInOrder) {
    const MemorySource source = numbered(95'001);
    for (const int threads : {1, 3})
        for (const auto& [round_points, most_batches] : {std::pair<uint64_t, size_t>(0, 1), {30'000, 3}, {1'000'000, 10}}) {
            uint32_t next = 0;
            read_in_rounds(source, threads, round_points, [&](std::span<const PointBatch> batches) {
                EXPECT_LE(batches.size(), most_batches);
                for (const PointBatch& batch : batches)
                    for (size_t i = 0; i < batch.size; ++i) {
                        ASSERT_EQ(batch.column<uint32_t>(0)[i], next);
                        ASSERT_EQ(batch.x[i], int32_t(next++));
                    }
            });
            EXPECT_EQ(next, 95'001u);
        }
    read_in_rounds(numbered(0), 2, 1000, [](std::span<const PointBatch>) { ADD_FAILURE() << "there is nothing to take"; });
}

TEST(PointRounds, WhatTheTakerThrowsArrives) {
    EXPECT_THROW(read_in_rounds(numbered(30'000), 2, 1, [](std::span<const PointBatch>) { throw std::runtime_error("full"); }),
                 std::runtime_error);
}

TEST(PointRounds, RoundsFitIntoMemory) {
    EXPECT_EQ(points_of_round(2, uint64_t{1} << 40, 100), points_of_round(1, uint64_t{1} << 40, 100) * 2);
    EXPECT_EQ(points_of_round(8, 1'000'000, 100), 10'000u);
}

}  // namespace
}  // namespace strata
