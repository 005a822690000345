// Primary rays, 1024 x 1024, of surfaces at a resolution of 1024, beside NanoVDB's HDDA on the same voxels and the same rays.
// strata_bench --benchmark_filter=rays --benchmark_counters_tabular=true
#include <benchmark/benchmark.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <numbers>

#include "core/parallel.h"
#include "core/voxel/ray_cast.h"
#include "core/voxel/voxel_tree_builder.h"

#if __has_include(<nanovdb/NanoVDB.h>)
#define STRATA_HAS_NANOVDB 1
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // in DDA, for axes that the ray does not move along
#include <nanovdb/util/GridBuilder.h>
#include <nanovdb/util/HDDA.h>
#include <nanovdb/util/Ray.h>
#pragma GCC diagnostic pop
#endif

namespace strata {
namespace {

constexpr int kLevels = 5;
constexpr double kSide = 1024;
constexpr int kPixels = 1024, kTile = 16, kThreads = 2;

// Distances from surfaces, in voxels, about the middle of the cube; a gyroid's is a lower bound.
double sphere(const Vec3d& p) { return p.norm() - 0.49 * kSide; }
double torus(const Vec3d& p) { return std::hypot(std::hypot(p.x(), p.z()) - 0.34 * kSide, p.y()) - 0.14 * kSide; }
double gyroid(const Vec3d& p) {
    const Vec3d q = p * (2 * std::numbers::pi * 4 / kSide);
    const double sheet = std::sin(q.x()) * std::cos(q.y()) + std::sin(q.y()) * std::cos(q.z()) + std::sin(q.z()) * std::cos(q.x());
    return std::max(std::abs(sheet) / (std::sqrt(3.0) * 2 * std::numbers::pi * 4 / kSide) - 3.0, sphere(p));
}

struct Model {
    VoxelTree tree;
    uint64_t voxels = 0;
#ifdef STRATA_HAS_NANOVDB
    nanovdb::GridHandle<> mask, level_set;
#endif
};

// The voxels through whose box the surface passes, seen from its corners.
void add_blocks(const std::function<double(const Vec3d&)>& distance, uint64_t code, int height, VoxelBatch& batch,
                std::vector<std::array<uint32_t, 3>>& band) {
    const auto cell = coordinates_of_code(code);
    const double cell_side = double(uint64_t{1} << 2 * (height + 1));
    const auto corner = [&](double x, double y, double z) { return Vec3d(x - kSide / 2, y - kSide / 2, z - kSide / 2); };
    const Vec3d middle = corner((cell[0] + 0.5) * cell_side, (cell[1] + 0.5) * cell_side, (cell[2] + 0.5) * cell_side);
    if (std::abs(distance(middle)) > cell_side * 0.87 + 4) return;
    if (height > 0) {
        for (uint64_t i = 0; i < 64; ++i) add_blocks(distance, code << 6 | i, height - 1, batch, band);
        return;
    }
    bool below[5][5][5];
    for (uint32_t x = 0; x < 5; ++x)
        for (uint32_t y = 0; y < 5; ++y)
            for (uint32_t z = 0; z < 5; ++z) below[x][y][z] = distance(corner(4 * cell[0] + x, 4 * cell[1] + y, 4 * cell[2] + z)) < 0;
    VoxelBlock block{.code = code};
    for (uint32_t bit = 0; bit < 64; ++bit) {
        const auto [x, y, z] = coordinates_of_code(bit);
        int inside = 0;
        for (uint32_t i = 0; i < 8; ++i) inside += below[x + (i >> 2)][y + (i >> 1 & 1)][z + (i & 1)];
        if (inside > 0 && inside < 8) block.mask |= uint64_t{1} << bit;
    }
    if (block.mask != 0) batch.blocks.push_back(block);
    band.push_back({4 * cell[0], 4 * cell[1], 4 * cell[2]});
}

const Model& model(const std::string& name) {
    static std::map<std::string, std::unique_ptr<Model>> models;
    auto& model = models[name];
    if (model) return *model;
    model = std::make_unique<Model>();
    const std::function<double(const Vec3d&)> distance = name == "sphere" ? sphere : name == "torus" ? torus : gyroid;
    VoxelBatch batch;
    std::vector<std::array<uint32_t, 3>> band;
    add_blocks(distance, 0, kLevels - 1, batch, band);
    const VoxelFrame frame{.levels = kLevels};
    VoxelTreeInMemory memory(frame, {});
    VoxelTreeBuilder builder(frame, {}, memory);
    builder.add(batch);
    builder.finish();
    model->tree = memory.take();
    model->voxels = count_voxels(model->tree);
#ifdef STRATA_HAS_NANOVDB
    nanovdb::GridBuilder<float> mask(0.0f);
    auto mask_accessor = mask.getAccessor();
    for (const VoxelBlock& block : batch.blocks)
        for (uint32_t bit = 0; bit < 64; ++bit)
            if (block.mask >> bit & 1) {
                const auto [x, y, z] = coordinates_of_code(block.code << 6 | bit);
                mask_accessor.setValue(nanovdb::Coord(int(x), int(y), int(z)), 1.0f);
            }
    model->mask = mask.getHandle<>();
    nanovdb::GridBuilder<float> level_set(3.0f, nanovdb::GridClass::LevelSet);
    auto accessor = level_set.getAccessor();
    for (const auto& corner : band)
        for (uint32_t bit = 0; bit < 64; ++bit) {
            const auto [x, y, z] = coordinates_of_code(bit);
            const double d = distance(Vec3d(corner[0] + x + 0.5, corner[1] + y + 0.5, corner[2] + z + 0.5).array() - kSide / 2);
            if (std::abs(d) < 3) accessor.setValue(nanovdb::Coord(int(corner[0] + x), int(corner[1] + y), int(corner[2] + z)), float(d));
        }
    level_set.sdfToLevelSet();
    model->level_set = level_set.getHandle<>();
#endif
    return *model;
}

// Looks at the middle from above, a little aside; the surface fills the picture. Directions are of length 1.
VoxelTile whole_picture() {
    const Vec3d eye(1.25 * kSide, 1.05 * kSide, -0.55 * kSide), target(kSide / 2, kSide / 2, kSide / 2);
    const Vec3d ahead = (target - eye).normalized(), right = ahead.cross(Vec3d::UnitY()).normalized(), down = ahead.cross(right);
    const double half = std::tan(0.4);
    VoxelTile picture{.first = {eye, ahead}, .width = kPixels, .height = kPixels};
    picture.direction_per_x = right * (2 * half / kPixels);
    picture.direction_per_y = down * (2 * half / kPixels);
    picture.first.direction += (0.5 - kPixels / 2) * (picture.direction_per_x + picture.direction_per_y);
    return picture;
}

VoxelTile tile_of(const VoxelTile& picture, int x, int y, int side) {
    VoxelTile tile = picture;
    tile.first = picture.ray(x, y);
    tile.width = tile.height = side;
    return tile;
}

// Calls draw(x, y) for the corners of tiles, on two threads.
template <class Draw>
void for_tiles(int tile, const Draw& draw) {
    const size_t per_row = size_t(kPixels / tile);
    parallel_blocks(kThreads, per_row * per_row, 4, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) draw(int(i % per_row) * tile, int(i / per_row) * tile);
    });
}

void report(benchmark::State& state, const Model& m, int64_t hits) {
    state.counters["Mrays/s"] =
        benchmark::Counter(double(kPixels) * kPixels * 1e-6 * double(state.iterations()), benchmark::Counter::kIsRate);
    state.counters["hits"] = double(hits);
    state.counters["voxels"] = double(m.voxels);
}

void rays_tiles(benchmark::State& state, const std::string& name, int tile, bool lod) {
    const Model& m = model(name);
    const VoxelTile picture = whole_picture();
    const RayLimits limits{.spread = lod ? picture.direction_per_x.norm() : 0.0};
    std::atomic<int64_t> hits = 0;
    for (auto _ : state) {
        hits = 0;
        for_tiles(tile, [&](int x, int y) {
            std::vector<VoxelHit> found(size_t(tile) * size_t(tile));
            cast_tile(m.tree, tile_of(picture, x, y, tile), limits, found);
            hits += std::count_if(found.begin(), found.end(), [](const VoxelHit& hit) { return hit.depth > 0; });
        });
    }
    report(state, m, hits);
}

void rays_single(benchmark::State& state, const std::string& name) {
    const Model& m = model(name);
    const VoxelTile picture = whole_picture();
    std::atomic<int64_t> hits = 0;
    for (auto _ : state) {
        hits = 0;
        for_tiles(kTile, [&](int x0, int y0) {
            int64_t found = 0;
            for (int y = y0; y < y0 + kTile; ++y)
                for (int x = x0; x < x0 + kTile; ++x) found += cast_ray(m.tree, picture.ray(x, y)).has_value();
            hits += found;
        });
    }
    report(state, m, hits);
}

#ifdef STRATA_HAS_NANOVDB
using NanoRay = nanovdb::Ray<float>;

NanoRay nano_ray(const VoxelRay& ray) {
    const Vec3d direction = ray.direction.normalized();
    return NanoRay(nanovdb::Vec3f(float(ray.origin.x()), float(ray.origin.y()), float(ray.origin.z())),
                   nanovdb::Vec3f(float(direction.x()), float(direction.y()), float(direction.z())));
}

// The first active voxel by the leaves that a TreeMarcher finds and a DDA in each.
template <class Accessor>
bool march_tree(NanoRay ray, Accessor& accessor, nanovdb::Coord& voxel, float& t) {
    using Leaf = nanovdb::NanoLeaf<float>;
    nanovdb::TreeMarcher<Leaf, NanoRay, Accessor> marcher(accessor);
    if (!marcher.init(ray)) return false;
    const Leaf* leaf = nullptr;
    float t0 = 0, t1 = 0;
    while (marcher.step(&leaf, t0, t1)) {
        nanovdb::DDA<NanoRay> dda;
        dda.init(marcher.ray(), t0, t1);
        do {
            if ((dda.voxel() & ~7) == leaf->origin() && leaf->isActive(dda.voxel())) {
                voxel = dda.voxel();
                t = dda.time();
                return true;
            }
        } while (dda.step());
    }
    return false;
}

enum class Peer { first_active, tree_marcher, zero_crossing };

void rays_nanovdb(benchmark::State& state, const std::string& name, Peer peer) {
    const Model& m = model(name);
    const VoxelTile picture = whole_picture();
    const auto* mask = m.mask.grid<float>();
    const auto* level_set = m.level_set.grid<float>();
    std::atomic<int64_t> hits = 0, same = 0;
    const auto draw = [&](int x0, int y0, bool compare) {
        auto mask_accessor = mask->getAccessor();
        auto accessor = level_set->getAccessor();
        int64_t found = 0, agree = 0;
        for (int y = y0; y < y0 + kTile; ++y)
            for (int x = x0; x < x0 + kTile; ++x) {
                const VoxelRay ray = picture.ray(x, y);
                NanoRay nano = nano_ray(ray);
                nanovdb::Coord voxel;
                float t = 0, value = 0;
                const bool hit = peer == Peer::first_active   ? nanovdb::firstActive(nano, mask_accessor, voxel, t)
                                 : peer == Peer::tree_marcher ? march_tree(nano, mask_accessor, voxel, t)
                                                              : nanovdb::ZeroCrossing(nano, accessor, voxel, value, t);
                found += hit;
                if (!compare) continue;
                const auto ours = cast_ray(m.tree, ray);
                agree += ours.has_value() == hit &&
                         (!hit || (int(ours->cell[0]) == voxel[0] && int(ours->cell[1]) == voxel[1] && int(ours->cell[2]) == voxel[2]));
            }
        hits += found;
        same += agree;
    };
    for (auto _ : state) {
        hits = 0;
        for_tiles(kTile, [&](int x, int y) { draw(x, y, false); });
    }
    report(state, m, hits);
    for_tiles(kTile, [&](int x, int y) { draw(x, y, true); });
    state.counters["same"] = double(same) / (double(kPixels) * kPixels);  // share of the rays that find the same voxel
}
#endif

const bool kRegistered = [] {
    for (const std::string name : {"sphere", "torus", "gyroid"}) {
        const auto add = [&](const std::string& kind, auto&& run) {
            benchmark::RegisterBenchmark(("rays/" + name + "/" + kind).c_str(), run)->Unit(benchmark::kMillisecond)->UseRealTime();
        };
        for (const int tile : {8, 16, 32})
            add("tiles_of_" + std::to_string(tile), [=](benchmark::State& s) { rays_tiles(s, name, tile, false); });
        add("tiles_lod", [=](benchmark::State& s) { rays_tiles(s, name, kTile, true); });
        add("single", [=](benchmark::State& s) { rays_single(s, name); });
#ifdef STRATA_HAS_NANOVDB
        add("nanovdb_first_active", [=](benchmark::State& s) { rays_nanovdb(s, name, Peer::first_active); });
        add("nanovdb_tree_marcher", [=](benchmark::State& s) { rays_nanovdb(s, name, Peer::tree_marcher); });
        add("nanovdb_zero_crossing", [=](benchmark::State& s) { rays_nanovdb(s, name, Peer::zero_crossing); });
#endif
    }
    return true;
}();

}  // namespace
}  // namespace strata
