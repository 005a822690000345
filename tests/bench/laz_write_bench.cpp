// Records to LAZ: chunks of 50,000 points, each encoded by itself, in memory. Files as in laz_read_bench.cpp.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <sstream>

#include "core/parallel.h"
#include "io/las/laz_encoder.h"
#include "io/las/laz_source.h"

namespace strata {
namespace {

constexpr size_t kChunkPoints = 50'000;

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

/// Encodes all chunks and returns how many bytes they have.
uint64_t encode_all(const las::Header& header, std::span<const std::byte> records, int threads) {
    const size_t chunk_bytes = kChunkPoints * header.record_size, chunks = (records.size() + chunk_bytes - 1) / chunk_bytes;
    std::atomic<uint64_t> bytes = 0;
    parallel_blocks(threads, chunks, (chunks + size_t(threads) - 1) / size_t(threads), [&](size_t begin, size_t end) {
        const auto encoder = las::make_laz_encoder(header.point_format, header.record_size);
        std::vector<std::byte> out;
        for (size_t i = begin; i < end; ++i) {
            out.clear();
            encoder->encode(records.subspan(i * chunk_bytes, std::min(chunk_bytes, records.size() - i * chunk_bytes)), out);
            bytes += out.size();
        }
    });
    return bytes;
}

void encode(benchmark::State& state, const std::string& path) {
    const LazSource source(open_file(path));
    std::vector<std::byte> records;
    for (uint64_t i = 0; i < source.batch_count(); ++i) {
        const std::vector<std::byte> batch = source.read_records(i);
        records.insert(records.end(), batch.begin(), batch.end());
    }
    const uint64_t expected = encode_all(source.header(), records, 1);
    for (auto _ : state)
        if (encode_all(source.header(), records, int(state.range(0))) != expected) state.SkipWithError("other bytes");
    const double points = double(source.info().points);
    state.counters["points/s"] = benchmark::Counter(points * double(state.iterations()), benchmark::Counter::kIsRate);
    state.counters["bytes/point"] = double(expected) / points;
}

const bool kRegistered = [] {
    for (const std::string& path : files())
        benchmark::RegisterBenchmark(("laz_write/" + path.substr(path.rfind('/') + 1)).c_str(), encode, path)
            ->Arg(1)
            ->Arg(2)
            ->UseRealTime()
            ->Unit(benchmark::kMillisecond);
    return true;
}();

}  // namespace
}  // namespace strata
