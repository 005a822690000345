// Reprojection: PROJ alone on arrays in memory, and a source through it.
#include <benchmark/benchmark.h>
#include <proj.h>

#include <algorithm>
#include <random>

#include "core/parallel.h"
#include "io/crs/reprojected_source.h"
#include "tests/support/memory_source.h"

namespace strata {
namespace {

constexpr const char* kFrom = "EPSG:25832";
constexpr const char* kTo[] = {"EPSG:4326", "EPSG:4978", "EPSG:25833"};
constexpr size_t kBlock = 10'000;

std::vector<Vec3i> scan() {
    std::mt19937 random(7);
    std::vector<Vec3i> quanta(1'000'000);
    for (Vec3i& q : quanta) q = Vec3i(int(random() % 1'000'000), int(random() % 1'000'000), int(random() % 60'000));
    return quanta;
}

// The bound: nothing but PROJ, an object a thread.
void proj_alone(benchmark::State& state) {
    const std::vector<Vec3i> quanta = scan();
    const size_t share = quanta.size() / size_t(state.range(1));
    for (auto _ : state)
        parallel_workers(int(state.range(1)), [&](int worker) {
            PJ_CONTEXT* const context = proj_context_create();
            PJ* const way = proj_create_crs_to_crs(context, kFrom, kTo[state.range(0)], nullptr);
            std::vector<double> p(3 * kBlock);
            const size_t end = share * size_t(worker + 1);
            for (size_t i = share * size_t(worker); i < end; i += kBlock) {
                const size_t size = std::min(kBlock, end - i);
                for (size_t j = 0; j < size; ++j) {
                    p[j] = 690'000.0 + 0.001 * quanta[i + j].x();
                    p[kBlock + j] = 5'330'000.0 + 0.001 * quanta[i + j].y();
                    p[2 * kBlock + j] = 400.0 + 0.001 * quanta[i + j].z();
                }
                proj_trans_generic(way, PJ_FWD, p.data(), 8, size, &p[kBlock], 8, size, &p[2 * kBlock], 8, size, nullptr, 0, 0);
            }
            proj_destroy(way);
            proj_context_destroy(context);
        });
    state.SetItemsProcessed(int64_t(state.iterations()) * int64_t(quanta.size()));
}

void reprojected_source(benchmark::State& state) {
    auto memory = std::make_unique<MemorySource>(scan());
    memory->changeable_info().crs = kFrom;
    memory->changeable_info().quantization.offset = {690'000.0, 5'330'000.0, 400.0};
    const auto source = reproject_points(std::move(memory), kTo[state.range(0)], "scan", 1);
    for (auto _ : state)
        parallel_blocks(int(state.range(1)), source->batch_count(), 1, [&](size_t begin, size_t end) {
            PointBatch batch;
            for (size_t i = begin; i < end; ++i) source->read_batch(i, {}, batch);
        });
    state.SetItemsProcessed(int64_t(state.iterations()) * int64_t(source->info().points));
}

BENCHMARK(proj_alone)->ArgsProduct({{0, 1, 2}, {1, 2}})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(reprojected_source)->ArgsProduct({{0, 1, 2}, {1, 2}})->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace strata
