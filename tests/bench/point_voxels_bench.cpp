// Points to voxels: STRATA_BENCH_SCAN names a scan (strata sample SCAN.las --points 50000000), in the page cache. Argument: threads.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <string>

#include "core/parallel.h"
#include "core/voxel/point_voxels.h"
#include "io/format.h"
#include "io/scratch_file.h"

namespace strata {
namespace {

struct Case {
    VoxelAttributes attributes;
    uint32_t resolution = 8192;
    uint64_t memory_bytes = uint64_t{8} << 30;
    bool scratch = false;
};

void voxelize(benchmark::State& state, const Case& what) {
    const char* const scan = std::getenv("STRATA_BENCH_SCAN");
    if (!scan) return state.SkipWithError("STRATA_BENCH_SCAN names no scan");
    const std::string path = scan;
    const auto source = open_points({&path, 1});
    const VoxelFrame frame = frame_of_resolution(source->info().bounds, what.resolution);
    PointVoxelReport report;
    uint64_t voxels = 0, points = 0;
    for (auto _ : state) {
        const auto scratch = what.scratch ? make_scratch_file("/tmp") : nullptr;
        PointVoxelSettings settings;
        settings.attributes = what.attributes;
        settings.threads = int(state.range(0));
        settings.memory_bytes = what.memory_bytes;
        settings.scratch = scratch.get();
        voxels = points = 0;
        report = voxelize_points(*source, frame, settings, [&](const VoxelBatch& batch) {
            for (const VoxelBlock& block : batch.blocks) voxels += uint64_t(std::popcount(block.mask));
            for (const uint32_t count : batch.counts) points += count;
        });
        if (voxels != report.voxels || report.points != source->info().points) state.SkipWithError("voxels were lost");
        if (what.attributes.count && points + report.outside != report.points) state.SkipWithError("points were lost");
    }
    state.counters["points/s"] = benchmark::Counter(double(report.points) * double(state.iterations()), benchmark::Counter::kIsRate);
    state.counters["voxels"] = double(report.voxels);
    state.counters["scratch_MB"] = double(report.scratch_bytes) * 1e-6;
}

// 100 million points in one place.
class SpotSource : public PointSource {
public:
    static constexpr uint64_t kBatch = 65'536, kPoints = 100'000'000;

    SpotSource() {
        info_.points = kPoints;
        info_.attributes = {{.name = "rgb", .type = ScalarType::uint16, .components = 3}};
    }
    const CloudInfo& info() const override { return info_; }
    uint64_t batch_count() const override { return (kPoints + kBatch - 1) / kBatch; }
    void read_batch(uint64_t index, std::span<const int> wanted, PointBatch& out) const override {
        resize_batch(out, size_t(std::min(kBatch, kPoints - index * kBatch)), info_.attributes, wanted);
        for (std::vector<int32_t>* axis : {&out.x, &out.y, &out.z}) std::fill(axis->begin(), axis->end(), 1000);
    }

private:
    CloudInfo info_;
};

void one_spot(benchmark::State& state) {
    const SpotSource source;
    PointVoxelReport report;
    for (auto _ : state) {
        const auto scratch = make_scratch_file("/tmp");
        PointVoxelSettings settings;
        settings.attributes = {.count = true, .color = true};
        settings.threads = int(state.range(0));
        settings.memory_bytes = 64 << 20;
        settings.scratch = scratch.get();
        uint64_t points = 0;
        report = voxelize_points(source, {.levels = 10}, settings, [&](const VoxelBatch& batch) {
            for (const uint32_t count : batch.counts) points += count;
        });
        if (points != SpotSource::kPoints || report.voxels != 1) state.SkipWithError("points were lost");
    }
    state.counters["points/s"] = benchmark::Counter(double(report.points) * double(state.iterations()), benchmark::Counter::kIsRate);
    state.counters["scratch_MB"] = double(report.scratch_bytes) * 1e-6;
}

void read_only(benchmark::State& state, bool color) {
    const char* const scan = std::getenv("STRATA_BENCH_SCAN");
    if (!scan) return state.SkipWithError("STRATA_BENCH_SCAN names no scan");
    const std::string path = scan;
    const auto source = open_points({&path, 1});
    std::vector<int> wanted;
    if (color) wanted.push_back(find_attribute(source->info().attributes, attribute_name::kRgb));
    for (auto _ : state)
        parallel_blocks(int(state.range(0)), size_t(source->batch_count()), 1, [&](size_t begin, size_t) {
            thread_local PointBatch batch;
            source->read_batch(begin, wanted, batch);
            benchmark::DoNotOptimize(batch.x.data());
        });
    state.counters["points/s"] =
        benchmark::Counter(double(source->info().points) * double(state.iterations()), benchmark::Counter::kIsRate);
}

#define STRATA_VOXELIZE(name, ...) \
    BENCHMARK_CAPTURE(voxelize, name, Case __VA_ARGS__)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond)
BENCHMARK_CAPTURE(read_only, positions, false)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read_only, colors, true)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(one_spot)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
STRATA_VOXELIZE(occupancy, {});
STRATA_VOXELIZE(count_color, {.attributes = {.count = true, .color = true}});
STRATA_VOXELIZE(count_color_1024, {.attributes = {.count = true, .color = true}, .resolution = 1024});
STRATA_VOXELIZE(count_color_16384, {.attributes = {.count = true, .color = true}, .resolution = 16384});
STRATA_VOXELIZE(count_color_16384_512M,
                {.attributes = {.count = true, .color = true}, .resolution = 16384, .memory_bytes = uint64_t{512} << 20, .scratch = true});
STRATA_VOXELIZE(count_color_512M, {.attributes = {.count = true, .color = true}, .memory_bytes = uint64_t{512} << 20, .scratch = true});

}  // namespace
}  // namespace strata
