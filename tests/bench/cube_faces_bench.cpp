// Faces of cubes merged into rectangles: bricks of 62^3 cells within empty ones, so that the binary greedy mesher, which takes so many,
// finds the same faces. Where CMake knows its header (STRATA_BINARY_GREEDY_MESHER), it runs on the same cells and its counts stand beside.
// strata_bench --benchmark_filter=cube_faces --benchmark_counters_tabular=true
// Whole models: STRATA_DATA names the folder of scans.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>

#include "core/math/random.h"
#include "core/parallel.h"
#include "core/surface/cube_faces.h"
#include "core/surface/cube_surface.h"
#include "core/surface/tree_bricks.h"
#include "core/voxel/mesh_voxels.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/mesh/mesh_reader.h"

#ifdef STRATA_BINARY_GREEDY_MESHER
#define BM_IMPLEMENTATION
#include "mesher.h"
#endif

namespace strata {
namespace {

constexpr int kSide = kCubeBrickSide;

// Materials of cells, 0 is empty; those at the sides are.
struct Cells {
    std::vector<uint8_t> materials = std::vector<uint8_t>(size_t(kSide) * kSide * kSide);
    uint8_t& at(int x, int y, int z) { return materials[size_t((x * kSide + y) * kSide + z)]; }
};

// A lattice of random numbers, smoothly between them; octaves of half the size and weight.
double smooth_noise(double x, double y, double z, int octaves) {
    const auto lattice = [](int i, int j, int k) {
        uint32_t h = uint32_t(i) * 374761393u + uint32_t(j) * 668265263u + uint32_t(k) * 2246822519u;
        h = (h ^ h >> 13) * 1274126177u;
        return double((h ^ h >> 16) & 0xFFFFFF) / double(0x1000000);
    };
    const auto ease = [](double t) { return t * t * (3.0 - 2.0 * t); };
    double sum = 0.0, weights = 0.0;
    for (int octave = 0; octave < octaves; ++octave, x *= 2, y *= 2, z *= 2) {
        const double i = std::floor(x), j = std::floor(y), k = std::floor(z), u = ease(x - i), v = ease(y - j), w = ease(z - k);
        double value = 0.0;
        for (int corner = 0; corner < 8; ++corner) {
            const int a = corner >> 2, b = corner >> 1 & 1, c = corner & 1;
            value += lattice(int(i) + a, int(j) + b, int(k) + c) * (a ? u : 1 - u) * (b ? v : 1 - v) * (c ? w : 1 - w);
        }
        sum += std::ldexp(value, -octave);
        weights += std::ldexp(1.0, -octave);
    }
    return sum / weights;
}

// materials  1, or several: layers below the top, or at random
Cells cells_of(const std::string& kind, bool materials) {
    Random random(1);
    Cells cells;
    for (int x = 1; x < kSide - 1; ++x)
        for (int y = 1; y < kSide - 1; ++y)
            for (int z = kSide - 2; z > 0; --z) {
                const double i = x - 31.5, j = y - 31.5, k = z - 31.5;
                bool solid = false;
                if (kind == "terrain") solid = z < 16 + 32 * smooth_noise(x / 40.0, y / 40.0, 0, 5);
                else if (kind == "sphere") solid = i * i + j * j + k * k <= 30.5 * 30.5;
                else if (kind == "caves") solid = smooth_noise(x / 16.0, y / 16.0, z / 16.0, 5) > 0.5;
                else solid = random.uniform() < 0.5;
                uint8_t material = 1;
                if (materials && kind == "noise") material = uint8_t(1 + int(3.0 * random.uniform()));
                else if (materials) material = cells.at(x, y, z + 1) == 0 ? 2 : 1;
                if (solid) cells.at(x, y, z) = material;
            }
    return cells;
}

std::unique_ptr<CubeBrick> brick_of(Cells& cells, bool materials) {
    auto brick = std::make_unique<CubeBrick>();
    brick->allocate_materials();
    brick->one_material = !materials;
    for (int x = 0; x < kSide; ++x)
        for (int y = 0; y < kSide; ++y)
            for (int z = 0; z < kSide; ++z) {
                if (cells.at(x, y, z) == 0) continue;
                brick->occupied[CubeBrick::column(x, y)] |= uint64_t{1} << z;
                brick->materials[CubeBrick::cell(x, y, z)] = cells.at(x, y, z);
            }
    return brick;
}

VoxelTree tree_of(Cells& cells) {
    const VoxelFrame frame{.levels = 3};
    VoxelTreeInMemory memory(frame, {});
    VoxelTreeBuilder builder(frame, {}, memory);
    VoxelBatch batch;
    for (uint64_t code = 0; code < 4096; ++code) {
        const auto [bx, by, bz] = coordinates_of_code(code);
        VoxelBlock block{.code = code};
        for (uint64_t bit = 0; bit < 64; ++bit) {
            const auto [x, y, z] = coordinates_of_code(bit);
            if (cells.at(int(4 * bx + x), int(4 * by + y), int(4 * bz + z)) != 0) block.mask |= uint64_t{1} << bit;
        }
        if (block.mask != 0) batch.blocks.push_back(block);
    }
    builder.add(batch);
    builder.finish();
    return memory.take();
}

void set_counters(benchmark::State& state, uint64_t faces, uint64_t rectangles) {
    state.counters["faces"] = double(faces);
    state.counters["rectangles"] = double(rectangles);
}

// From masks and materials in memory to rectangles of 8 bytes.
void brick(benchmark::State& state, const std::string& kind, bool materials, SimdLevel level) {
    Cells cells = cells_of(kind, materials);
    const std::unique_ptr<CubeBrick> brick = brick_of(cells, materials);
    CubeFaceFinder finder(level);
    CubeRectangles rectangles;
    for (auto _ : state) finder.find(*brick, rectangles);
    uint64_t faces = 0;
    for (size_t i = 0; i < rectangles.size(); ++i) faces += rectangles.all[i].width() * rectangles.all[i].height();
    set_counters(state, faces, rectangles.size());
}

// The same from the octree.
void brick_of_tree(benchmark::State& state, const std::string& kind) {
    Cells cells = cells_of(kind, false);
    const VoxelTree tree = tree_of(cells);
    const TreeBricks bricks(tree, tree.depth());
    const auto brick = std::make_unique<CubeBrick>();
    CubeFaceFinder finder;
    CubeRectangles rectangles;
    for (auto _ : state) {
        bricks.gather(0, {}, *brick);
        finder.find(*brick, rectangles);
    }
    state.counters["rectangles"] = double(rectangles.size());
}

#ifdef STRATA_BINARY_GREEDY_MESHER
// From its masks and types in memory to its quads of 8 bytes.
void peer(benchmark::State& state, const std::string& kind, bool materials) {
    Cells cells = cells_of(kind, materials);
    std::vector<uint64_t> opaque(CS_P2), faces(CS_2 * 6), quads(1 << 20);
    std::vector<uint8_t> types(CS_P3), forward(CS_2), right(CS);
    for (int x = 0; x < kSide; ++x)
        for (int y = 0; y < kSide; ++y)
            for (int z = 0; z < kSide; ++z) {
                if (cells.at(x, y, z) == 0) continue;
                opaque[size_t(y * CS_P + x)] |= uint64_t{1} << z;
                types[size_t((y * CS_P + x) * CS_P + z)] = cells.at(x, y, z);
            }
    MeshData data;
    data.faceMasks = faces.data();
    data.opaqueMask = opaque.data();
    data.forwardMerged = forward.data();
    data.rightMerged = right.data();
    data.vertices = &quads;
    data.maxVertices = int(quads.size());
    for (auto _ : state) mesh(types.data(), data);
    uint64_t area = 0;
    for (int i = 0; i + 1 < data.vertexCount; ++i) area += (quads[size_t(i)] >> 18 & 63) * (quads[size_t(i)] >> 24 & 63);
    set_counters(state, area, uint64_t(data.vertexCount - 1));
}
#endif

// Counts and lets go.
class NoSink : public SurfaceSink {
public:
    void add(const SurfacePiece& piece) override { benchmark::DoNotOptimize(piece.positions.data()); }
};

void model(benchmark::State& state, VoxelKind kind, CubeSurfaceSettings::Joints joints) {
    const char* const folder = std::getenv("STRATA_DATA");
    if (folder == nullptr) return state.SkipWithError("STRATA_DATA names no folder of scans");
    const TriangleMesh mesh = read_mesh(std::string(folder) + "/obj/nefertiti.obj");
    const VoxelFrame frame = frame_of_resolution(mesh.bounds(), 1024);
    VoxelTreeInMemory memory(frame, {});
    VoxelTreeBuilder builder(frame, {}, memory);
    voxelize_mesh(mesh, frame, {.kind = kind, .threads = default_thread_count()}, [&](const VoxelBatch& batch) { builder.add(batch); });
    builder.finish();
    const VoxelTree tree = memory.take();
    NoSink sink;
    CubeSurfaceCounts counts;
    for (auto _ : state) counts = mesh_cubes(tree, {.joints = joints, .threads = int(state.range(0))}, sink);
    set_counters(state, counts.faces_culled, counts.rectangles);
    state.counters["voxels"] = double(counts.solid_voxels);
    state.counters["triangles"] = double(counts.triangles + 2 * counts.quads);
    const auto rate = [&](uint64_t count) {
        return benchmark::Counter(double(count) * double(state.iterations()), benchmark::Counter::kIsRate);
    };
    state.counters["voxels/s"] = rate(counts.solid_voxels);
    state.counters["faces/s"] = rate(counts.faces_culled);
}

const bool kRegistered = [] {
    for (const std::string kind : {"terrain", "sphere", "caves", "noise"})
        for (const bool materials : {false, true}) {
            const std::string name = "cube_faces/" + kind + (materials ? "_materials" : "");
            for (const SimdLevel level : simd_levels())
                benchmark::RegisterBenchmark((name + "/" + std::string(name_of(level))).c_str(), [=](benchmark::State& state) {
                    brick(state, kind, materials, level);
                })->Unit(benchmark::kMicrosecond);
#ifdef STRATA_BINARY_GREEDY_MESHER
            benchmark::RegisterBenchmark((name + "/binary_greedy_mesher").c_str(), [=](benchmark::State& state) {
                peer(state, kind, materials);
            })->Unit(benchmark::kMicrosecond);
#endif
            if (materials) continue;
            benchmark::RegisterBenchmark((name + "/from_octree").c_str(), [=](benchmark::State& state) {
                brick_of_tree(state, kind);
            })->Unit(benchmark::kMicrosecond);
        }
    using Joints = CubeSurfaceSettings::Joints;
    for (const auto& [name, kind] : {std::pair{"conservative", VoxelKind::conservative}, {"solid", VoxelKind::solid}})
        for (const auto& [joints_name, joints] : {std::pair{"closed", Joints::closed}, {"separate", Joints::separate}})
            benchmark::RegisterBenchmark((std::string("cube_faces/nefertiti_1024_") + name + "/" + joints_name).c_str(),
                                         [kind = kind, joints = joints](benchmark::State& state) { model(state, kind, joints); })
                ->ArgName("threads")
                ->Arg(1)
                ->Arg(2)
                ->UseRealTime()
                ->Unit(benchmark::kMillisecond);
    return true;
}();

}  // namespace
}  // namespace strata
