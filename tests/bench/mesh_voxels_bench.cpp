// Voxels of a mesh: STRATA_BENCH_MESH names its file (a scanned bust of 100,000 triangles), taken as it is and with each triangle
// divided into 16.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <map>

#include "core/parallel.h"
#include "core/voxel/mesh_voxels.h"
#include "io/mesh/mesh_reader.h"

namespace strata {
namespace {

TriangleMesh halved(const TriangleMesh& mesh) {
    TriangleMesh out;
    out.positions = mesh.positions;
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) {
        const auto [found, added] = middles.try_emplace(std::minmax(a, b), uint32_t(out.positions.size()));
        if (added) out.positions.push_back(0.5 * (mesh.positions[a] + mesh.positions[b]));
        return found->second;
    };
    for (const auto& [a, b, c] : mesh.triangles) {
        const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
        for (const auto& t : {std::array{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}}) out.triangles.push_back(t);
    }
    return out;
}

const TriangleMesh* bench_mesh(bool fine) {
    const char* const path = std::getenv("STRATA_BENCH_MESH");
    if (path == nullptr) return nullptr;
    static const TriangleMesh coarse = read_mesh(path), divided = halved(halved(coarse));
    return fine ? &divided : &coarse;
}

uint64_t count_of(const TriangleMesh& mesh, const VoxelFrame& frame, const MeshVoxelSettings& settings) {
    uint64_t count = 0;
    voxelize_mesh(mesh, frame, settings, [&](const VoxelBatch& batch) {
        for (const VoxelBlock& block : batch.blocks) count += uint64_t(std::popcount(block.mask)) << 6 * block.height;
    });
    return count;
}

void mesh_voxels(benchmark::State& state, VoxelKind kind, bool fine) {
    const TriangleMesh* const mesh = bench_mesh(fine);
    if (mesh == nullptr) return state.SkipWithError("STRATA_BENCH_MESH names no mesh");
    const VoxelFrame frame = frame_of_resolution(mesh->bounds(), uint32_t(state.range(0)));
    const int threads = int(state.range(1));
    uint64_t count = 0;
    for (auto _ : state) count = count_of(*mesh, frame, {.kind = kind, .threads = threads});
    state.counters["triangles"] = double(mesh->triangles.size());
    state.counters["voxels"] = double(count);
    state.counters["voxels/s"] = benchmark::Counter(double(count) * double(state.iterations()), benchmark::Counter::kIsRate);
    if (count != count_of(*mesh, frame, {.kind = kind, .threads = 3 - threads})) state.SkipWithError("other threads, other voxels");
}
#define STRATA_VOXELIZE(name, kind, fine)            \
    BENCHMARK_CAPTURE(mesh_voxels, name, kind, fine) \
        ->ArgNames({"resolution", "threads"})        \
        ->ArgsProduct({{1024, 4096}, {1, 2}})        \
        ->UseRealTime()                              \
        ->Unit(benchmark::kMillisecond)
STRATA_VOXELIZE(conservative_100k, VoxelKind::conservative, false);
STRATA_VOXELIZE(conservative_1600k, VoxelKind::conservative, true);
STRATA_VOXELIZE(thin_100k, VoxelKind::thin, false);
STRATA_VOXELIZE(thin_1600k, VoxelKind::thin, true);
STRATA_VOXELIZE(solid_100k, VoxelKind::solid, false);
STRATA_VOXELIZE(solid_1600k, VoxelKind::solid, true);

}  // namespace
}  // namespace strata
