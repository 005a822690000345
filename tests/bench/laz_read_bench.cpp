// LAZ to columns: all attributes, and positions alone, of which layered points (format 7) need few of their layers.
// Files: those that STRATA_LAZ lists, with colons between; else two of the folder STRATA_DATA.
#include <benchmark/benchmark.h>

#include <atomic>
#include <cstdlib>
#include <numeric>
#include <sstream>

#include "core/parallel.h"
#include "io/las/laz_source.h"

namespace strata {
namespace {

std::vector<std::string> files() {
    std::vector<std::string> paths;
    if (const char* const list = std::getenv("STRATA_LAZ")) {
        std::stringstream text(list);
        for (std::string path; std::getline(text, path, ':');) paths.push_back(path);
    } else if (const char* const data = std::getenv("STRATA_DATA")) {
        for (const char* const file : {"/laz/example_data.laz", "/copc/lion_takanawa.copc.laz"}) paths.push_back(std::string(data) + file);
    }
    return paths;
}

int64_t sum_of_x(const LazSource& source, std::span<const int> wanted, int threads) {
    std::atomic<int64_t> sum = 0;
    parallel_blocks(threads, size_t(source.batch_count()), 1, [&](size_t begin, size_t end) {
        thread_local PointBatch batch;
        for (size_t i = begin; i < end; ++i) {
            source.read_batch(i, wanted, batch);
            sum += std::accumulate(batch.x.begin(), batch.x.end(), int64_t{0});
        }
    });
    return sum;
}

void decode(benchmark::State& state, const std::string& path, bool all) {
    const LazSource source(open_file(path));
    std::vector<int> wanted(all ? source.info().attributes.size() : 0);
    std::iota(wanted.begin(), wanted.end(), 0);
    const int64_t expected = sum_of_x(source, {}, 1);
    for (auto _ : state)
        if (sum_of_x(source, wanted, int(state.range(0))) != expected) state.SkipWithError("wrong points");
    state.counters["points/s"] = benchmark::Counter(double(source.info().points) * double(state.iterations()), benchmark::Counter::kIsRate);
}

const bool kRegistered = [] {
    for (const std::string& path : files())
        for (const bool all : {true, false})
            benchmark::RegisterBenchmark(("laz/" + path.substr(path.rfind('/') + 1) + (all ? "/all" : "/positions")).c_str(), decode, path, all)
                ->Arg(1)
                ->Arg(2)
                ->UseRealTime()
                ->Unit(benchmark::kMillisecond);
    return true;
}();

}  // namespace
}  // namespace strata
