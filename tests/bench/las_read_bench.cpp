// LAS to columns, beside the speed of reading the same bytes and doing nothing with them: the bound that pread sets.
// A file of 20 million points of format 2 (26 bytes), in the page cache.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <numeric>

#include "core/parallel.h"
#include "io/las/las_source.h"
#include "tests/support/las_file.h"

namespace strata {
namespace {

constexpr uint64_t kPoints = 20'000'000;
constexpr size_t kRecordBytes = 26;

// Made once a process, removed when it ends.
class SyntheticFile {
public:
    SyntheticFile() : path_((std::filesystem::temp_directory_path() / ("strata-bench-" + std::to_string(::getpid()) + ".las")).string()) {
        std::vector<std::byte> header = test::LasFile{.point_format = 2, .record_size = kRecordBytes}.bytes();
        test::poke<uint32_t>(header, 107, kPoints);
        std::ofstream out(path_, std::ios::binary);
        out.write(reinterpret_cast<const char*>(header.data()), std::streamsize(header.size()));
        constexpr uint64_t kBlock = 1 << 16;
        std::vector<std::byte> block;
        for (uint64_t first = 0; first < kPoints; first += kBlock) {
            block.clear();
            for (uint64_t i = first; i < std::min(first + kBlock, kPoints); ++i) {
                const auto record = test::las_record(2, {.x = int32_t(i), .y = -int32_t(i), .z = int32_t(i % 1000), .intensity = uint16_t(i),
                                                         .rgb = {uint16_t(i), uint16_t(i * 3), uint16_t(i * 7)}});
                block.insert(block.end(), record.begin(), record.end());
            }
            out.write(reinterpret_cast<const char*>(block.data()), std::streamsize(block.size()));
        }
    }
    SyntheticFile(const SyntheticFile&) = delete;
    SyntheticFile& operator=(const SyntheticFile&) = delete;
    ~SyntheticFile() { std::filesystem::remove(path_); }

    static const std::string& path() {
        static const SyntheticFile file;
        return file.path_;
    }

private:
    std::string path_;
};

void report(benchmark::State& state) {
    const double points = double(kPoints) * double(state.iterations());
    state.counters["points/s"] = benchmark::Counter(points, benchmark::Counter::kIsRate);
    state.counters["GB/s"] = benchmark::Counter(points * double(kRecordBytes) * 1e-9, benchmark::Counter::kIsRate);
}

void raw_pread(benchmark::State& state) {
    const auto bytes = open_file(SyntheticFile::path());
    constexpr size_t kBlock = 256 * 1024;
    for (auto _ : state)
        parallel_blocks(int(state.range(0)), size_t(bytes->size() / kBlock), 8, [&](size_t begin, size_t end) {
            thread_local std::vector<std::byte> buffer(kBlock);
            for (size_t i = begin; i < end; ++i) bytes->read(i * kBlock, buffer);
        });
    report(state);
}
BENCHMARK(raw_pread)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

void read_columns(benchmark::State& state, bool all) {
    const LasSource source(open_file(SyntheticFile::path()));
    std::vector<int> wanted(all ? source.info().attributes.size() : 0);
    std::iota(wanted.begin(), wanted.end(), 0);
    for (auto _ : state) {
        std::atomic<int64_t> sum = 0;
        parallel_blocks(int(state.range(0)), size_t(source.batch_count()), 4, [&](size_t begin, size_t end) {
            thread_local PointBatch batch;
            for (size_t i = begin; i < end; ++i) {
                source.read_batch(i, wanted, batch);
                sum += int64_t(batch.x.front()) + batch.x.back();
            }
        });
        int64_t expected = 0;
        for (uint64_t first = 0; first < kPoints; first += LasSource::kBatchPoints)
            expected += int64_t(first + std::min(first + LasSource::kBatchPoints, kPoints) - 1);
        if (sum != expected) state.SkipWithError("wrong points");
    }
    report(state);
}
BENCHMARK_CAPTURE(read_columns, all, true)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(read_columns, positions, false)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace strata
