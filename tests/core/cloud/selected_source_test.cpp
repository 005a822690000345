#include "core/cloud/selected_source.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/math/random.h"
#include "tests/support/memory_source.h"

namespace strata {
namespace {

std::vector<Vec3i> scattered(size_t count) {
    Random random(11);
    std::vector<Vec3i> quanta;
    for (size_t i = 0; i < count; ++i) quanta.emplace_back(int(random.uniform(0, 10'000)), int(random.uniform(0, 10'000)), int(random.uniform(0, 10'000)));
    return quanta;
}

std::vector<uint32_t> indices_of(const PointSource& source) {
    std::vector<uint32_t> indices;
    PointBatch batch;
    const int wanted = 0;
    for (uint64_t i = 0; i < source.batch_count(); ++i) {
        source.read_batch(i, {&wanted, 1}, batch);
        EXPECT_EQ(batch.x.size(), batch.size);
        const auto column = batch.column<uint32_t>(0);
        indices.insert(indices.end(), column.begin(), column.end());
    }
    return indices;
}

// A box, a range of indices and every third, over several batches, against a plain loop; whatever the threads.
TEST(SelectedSource, TakesWhatAPlainLoopTakes) {
    const std::vector<Vec3i> quanta = scattered(35'000);
    for (const uint64_t every : {1, 3})
        for (const int threads : {1, 3}) {
            auto source = std::make_unique<MemorySource>(quanta);
            const Vec3d offset = source->info().quantization.offset;
            PointSelection selection;
            selection.clips = {{.box = {.min = offset + Vec3d(2, 0, 0), .max = offset + Vec3d(7, 9, 10)}}};
            selection.filter = PointFilter(source->info(), std::vector<FilterTerm>{{"index", {{1'000, 29'999}}}});
            selection.every = every;
            const SelectedSource selected(std::move(source), std::move(selection), threads);
            std::vector<uint32_t> expected;
            Box3d bounds;
            uint64_t rank = 0;
            for (uint32_t i = 1'000; i < 30'000; ++i) {
                const Vec3i& p = quanta[i];
                if (p.x() < 2'000 || p.x() > 7'000 || p.y() > 9'000) continue;
                bounds.extend(selected.info().quantization.world_from_quanta(p));
                if (rank++ % every == 0) expected.push_back(i);
            }
            EXPECT_GT(expected.size(), 3'000u);
            EXPECT_EQ(indices_of(selected), expected);
            EXPECT_EQ(selected.info().points, expected.size());
            EXPECT_EQ(selected.info().bounds.min, bounds.min);
            EXPECT_EQ(selected.info().bounds.max, bounds.max);
        }
}

TEST(SelectedSource, ColumnsThatOnlyTheFilterReadsStayUnread) {
    auto source = std::make_unique<MemorySource>(scattered(100));
    PointSelection selection;
    selection.filter = PointFilter(source->info(), std::vector<FilterTerm>{{"index", {{10, 19}}}});
    const SelectedSource selected(std::move(source), std::move(selection), 1);
    PointBatch batch;
    selected.read_batch(0, {}, batch);
    EXPECT_EQ(batch.size, 10u);
    EXPECT_TRUE(batch.columns[0].empty());
}

TEST(SelectedSource, NothingIsACloudWithoutPoints) {
    PointSelection selection;
    selection.clips = {{.box = {.min = Vec3d::Constant(-2), .max = Vec3d::Constant(-1)}}};
    const SelectedSource selected(std::make_unique<MemorySource>(scattered(100)), std::move(selection), 2);
    EXPECT_EQ(selected.info().points, 0u);
    EXPECT_TRUE(selected.info().bounds.empty());
    EXPECT_TRUE(indices_of(selected).empty());
}

}  // namespace
}  // namespace strata
