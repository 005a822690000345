// How much sharing identical subtrees saves, and how long it takes to find them: scans in the folder STRATA_DATA, and a block of flats.
// strata_bench --benchmark_filter=dag --benchmark_counters_tabular=true
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>

#include "core/parallel.h"
#include "core/voxel/mesh_voxels.h"
#include "core/voxel/voxel_dag.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/mesh/mesh_reader.h"

namespace strata {
namespace {

void add_box(TriangleMesh& mesh, const Vec3d& low, const Vec3d& high) {
    const auto first = uint32_t(mesh.positions.size());
    for (uint32_t i = 0; i < 8; ++i)
        mesh.positions.emplace_back((i & 4 ? high : low).x(), (i & 2 ? high : low).y(), (i & 1 ? high : low).z());
    constexpr uint32_t kSides[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    for (const auto& side : kSides) {
        mesh.triangles.push_back({first + side[0], first + side[1], first + side[2]});
        mesh.triangles.push_back({first + side[0], first + side[2], first + side[3]});
    }
}

// Metres. Eight floors of rooms; outer walls with a window a room, inner walls with doors, stairs in the middle.
TriangleMesh block_of_flats() {
    TriangleMesh mesh;
    const double room = 4.37, height = 2.83, wall = 0.31, slab = 0.27;
    const int rooms_x = 9, rooms_y = 4, floors = 8;
    for (int floor = 0; floor <= floors; ++floor)
        add_box(mesh, {0, 0, floor * height}, {rooms_x * room + wall, rooms_y * room + wall, floor * height + slab});
    for (int floor = 0; floor < floors; ++floor) {
        const double low = floor * height + slab, high = (floor + 1) * height;
        // A wall from one side of a room to the next, in two posts, a sill and a lintel. along: 0: x, 1: y
        const auto add_wall = [&](int along, double x, double y, double sill, double lintel) {
            const auto part = [&](double from, double to, double bottom, double top) {
                if (along == 0) add_box(mesh, {x + from, y, bottom}, {x + to, y + wall, top});
                else add_box(mesh, {x, y + from, bottom}, {x + wall, y + to, top});
            };
            part(0, 0.36 * room, low, high);
            part(0.66 * room, room, low, high);
            if (sill > 0) part(0.36 * room, 0.66 * room, low, low + sill);
            part(0.36 * room, 0.66 * room, low + lintel, high);
        };
        for (int i = 0; i < rooms_x; ++i)
            for (int j = 0; j <= rooms_y; ++j) add_wall(0, i * room, j * room, j == 0 || j == rooms_y ? 0.9 : 0.0, 2.1);
        for (int j = 0; j < rooms_y; ++j)
            for (int i = 0; i <= rooms_x; ++i) add_wall(1, i * room, j * room, i == 0 || i == rooms_x ? 0.9 : 0.0, 2.1);
        for (int step = 0; step < 15; ++step)
            add_box(mesh, {4 * room + 1 + 0.13 * step, 2 * room + 1, low + 0.17 * step},
                    {4 * room + 1 + 0.13 * (step + 1), 2 * room + 2.1, low + 0.17 * (step + 1)});
    }
    return mesh;
}

void dag(benchmark::State& state, const std::string& file, uint32_t resolution) {
    TriangleMesh mesh;
    if (file.empty()) {
        mesh = block_of_flats();
    } else {
        const char* const folder = std::getenv("STRATA_DATA");
        if (folder == nullptr) return state.SkipWithError("STRATA_DATA names no folder of scans");
        mesh = read_mesh(std::string(folder) + "/" + file);
    }
    const VoxelFrame frame = frame_of_resolution(mesh.bounds(), resolution);
    VoxelTreeInMemory memory(frame, {});
    VoxelTreeBuilder builder(frame, {}, memory);
    voxelize_mesh(mesh, frame, {.threads = default_thread_count()}, [&](const VoxelBatch& batch) { builder.add(batch); });
    builder.finish();
    const VoxelTree tree = memory.take();
    VoxelDag shared;
    for (auto _ : state) shared = dag_of(tree);
    double voxels = double(count_voxels(tree)), tree_bytes = 0, bytes = 0;
    for (const VoxelLevel& level : tree.levels) tree_bytes += 8.0 * double(level.masks.size() + level.full.size());
    std::string label;
    for (const DagLevelCounts& counts : count_dag(shared)) {
        bytes += double(counts.bytes);
        label += (label.empty() ? "" : ", ") + std::to_string(counts.tree_nodes) + ">" + std::to_string(counts.nodes);
    }
    state.SetLabel(label);
    state.counters["voxels"] = voxels;
    state.counters["tree_B/voxel"] = tree_bytes / voxels;
    state.counters["dag_B/voxel"] = bytes / voxels;
    state.counters["Mnodes/s"] = benchmark::Counter(double(tree_bytes) / 8e6 * double(state.iterations()), benchmark::Counter::kIsRate);
}

const bool kRegistered = [] {
    const std::pair<std::string, std::string> models[] = {{"nefertiti", "obj/nefertiti.obj"}, {"lucy", "ply/lucy.ply"}, {"flats", ""}};
    for (const auto& [name, file] : models)
        for (const uint32_t resolution : {1024u, 4096u})
            benchmark::RegisterBenchmark(("dag/" + name + "/" + std::to_string(resolution)).c_str(),
                                         [=, path = file](benchmark::State& state) { dag(state, path, resolution); })
                ->Unit(benchmark::kMillisecond)
                ->Iterations(1);
    return true;
}();

}  // namespace
}  // namespace strata
