#include "core/cloud/preview_source.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/memory_source.h"

namespace strata {
namespace {

MemorySource line(size_t count) {
    std::vector<Vec3i> quanta;
    for (size_t i = 0; i < count; ++i) quanta.emplace_back(int(i), 2 * int(i), 7);
    return MemorySource(std::move(quanta));  // batches of 10,000
}

std::vector<uint32_t> indices_of(const PointSource& source) {
    std::vector<uint32_t> indices;
    PointBatch batch;
    const int wanted = 0;
    for (uint64_t i = 0; i < source.batch_count(); ++i) {
        source.read_batch(i, {&wanted, 1}, batch);
        const auto column = batch.column<uint32_t>(0);
        indices.insert(indices.end(), column.begin(), column.end());
        for (size_t row = 0; row < batch.size; ++row) EXPECT_EQ(uint32_t(batch.x[row]), column[row]);
    }
    return indices;
}

TEST(PreviewSource, TakesTheFirstPointsOfEachBatch) {
    const MemorySource source = line(30'001);
    for (const int threads : {1, 3}) {
        const PreviewSource preview(source, 8, threads);
        EXPECT_EQ(indices_of(preview), (std::vector<uint32_t>{0, 1, 10'000, 10'001, 20'000, 20'001, 30'000}));  // the last batch has one
        EXPECT_EQ(preview.info().points, 7u);
        EXPECT_EQ(preview.info().bounds.max, preview.info().quantization.world_from_quanta({30'000, 60'000, 7}));
    }
}

TEST(PreviewSource, WithMoreBatchesThanPointsLeavesSomeOut) {
    EXPECT_EQ(indices_of(PreviewSource(line(40'000), 2, 2)), (std::vector<uint32_t>{0, 20'000}));
    EXPECT_EQ(indices_of(PreviewSource(line(40'000), 1, 2)), (std::vector<uint32_t>{0}));
}

TEST(PreviewSource, OfFewerPointsIsAllOfThem) {
    EXPECT_EQ(PreviewSource(line(12'345), 100'000, 2).info().points, 12'345u);
    EXPECT_EQ(PreviewSource(line(0), 100, 2).info().points, 0u);
}

}  // namespace
}  // namespace strata
