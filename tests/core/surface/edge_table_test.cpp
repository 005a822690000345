#include "core/surface/edge_table.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/store_in_memory.h"

namespace strata {
namespace {

// Quads with corners of their own: every edge stays open. One of late costs 32 bytes, its vertex's, an earlier one a half-full slot of 9
// bytes or a quarter-full one; the first runs are all of late.
TEST(EdgeTable, TakesAtMostFourSlotsForAnOpenEdge) {
    EdgeTable edges(false);
    double most = 0.0;
    constexpr uint32_t kQuads = 500'000;
    for (uint32_t first = 0; first < 4 * kQuads;) {
        edges.add_vertices(4'000);
        for (const uint32_t end = first + 4'000; first < end; first += 4) {
            for (uint32_t i = 0; i < 4; ++i) edges.add(first + i, first + (i + 1) % 4);
            edges.face_done();
        }
        if (first >= 600'000) most = std::max(most, double(edges.memory_bytes()) / first);
    }
    EXPECT_GT(most, 0.75 * 24.0);  // of a star for one or two edges
    EXPECT_LE(most, 36.0);
    const EdgeCounts counts = edges.count();
    EXPECT_EQ(counts.edges, 4u * kQuads);
    EXPECT_EQ(counts.boundary, 4u * kQuads);
    EXPECT_EQ(counts.open, 4u * kQuads);
}

// Quads with corners of their own: every edge stays open, and what does not fit is put away.
TEST(EdgeTable, KeepsToItsMemory) {
    test::StoreInMemory scratch;
    ScratchRoom room(scratch);
    constexpr uint64_t kMemory = 1 << 20;
    EdgeTable edges(false, &room, kMemory);
    constexpr uint32_t kQuads = 200'000, kPiece = 400;
    for (uint32_t first = 0; first < 4 * kQuads;) {
        edges.add_vertices(kPiece);
        for (const uint32_t end = first + kPiece; first < end; first += 4) {
            for (uint32_t i = 0; i < 4; ++i) edges.add(first + i, first + (i + 1) % 4);
            edges.face_done();
        }
        ASSERT_LE(edges.memory_bytes(), kMemory + 2 * 32 * kPiece);
    }
    const EdgeCounts counts = edges.count();
    EXPECT_EQ(counts.edges, 4u * kQuads);
    EXPECT_EQ(counts.boundary, 4u * kQuads);
    EXPECT_EQ(counts.open, 4u * kQuads);
    EXPECT_EQ(scratch.size(), 9u * 4 * kQuads);  // each once
}

}  // namespace
}  // namespace strata
