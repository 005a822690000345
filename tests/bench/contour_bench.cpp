// Marching cubes of a gyroid in a sphere: dense, with normals, and by slices.
// strata_bench --benchmark_filter=contour --benchmark_counters_tabular=true
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/parallel.h"
#include "core/surface/contour.h"

namespace strata {
namespace {

const ScalarGrid& gyroid_in_sphere(uint32_t side) {
    static std::map<uint32_t, ScalarGrid> grids;
    ScalarGrid& grid = grids[side];
    if (!grid.values.empty()) return grid;
    grid = {.placement = {}, .size = {side, side, side}, .values = std::vector<float>(size_t(side) * side * side)};
    const double scale = 2.0 * std::numbers::pi * 8.0 / side, half = 0.5 * (side - 1);
    parallel_blocks(default_thread_count(), side, 1, [&](size_t begin, size_t end) {
        for (size_t k = begin; k < end; ++k)
            for (size_t j = 0; j < side; ++j)
                for (size_t i = 0; i < side; ++i) {
                    const double x = double(i) - half, y = double(j) - half, z = double(k) - half;
                    const double sheet = std::sin(scale * x) * std::cos(scale * y) + std::sin(scale * y) * std::cos(scale * z) +
                                         std::sin(scale * z) * std::cos(scale * x);
                    grid.values[(k * side + j) * side + i] =
                        float(std::max(sheet / (1.2 * scale), std::sqrt(x * x + y * y + z * z) - 0.45 * side));
                }
    });
    return grid;
}

class Slices : public SliceSource {
public:
    explicit Slices(const ScalarGrid& grid) : grid_(grid) {}
    const GridPlacement& placement() const override { return grid_.placement; }
    std::array<uint32_t, 3> size() const override { return grid_.size; }
    void read(uint32_t, double, std::span<float> out) override {
        std::copy_n(grid_.values.data() + next_, out.size(), out.data());
        next_ += out.size();
    }

private:
    const ScalarGrid& grid_;
    size_t next_ = 0;
};

class Counter : public SurfaceSink {
public:
    void add(const SurfacePiece& piece) override { triangles += piece.triangles.size(); }
    uint64_t triangles = 0;
};

void report(benchmark::State& state, uint64_t triangles) {
    state.counters["Mtriangles"] = double(triangles) * 1e-6;
    state.counters["Mtriangles/s"] = benchmark::Counter(double(triangles) * 1e-6 * double(state.iterations()), benchmark::Counter::kIsRate);
}

void contour_dense(benchmark::State& state, bool normals) {
    const ScalarGrid& grid = gyroid_in_sphere(uint32_t(state.range(0)));
    uint64_t triangles = 0;
    for (auto _ : state) {
        ContourMesh mesh;
        triangles = contour_grid(grid.placement, grid.size, grid.values,
                                 {.inside = ContourInside::below, .normals = normals, .threads = int(state.range(1))}, mesh)
                        .triangles;
    }
    report(state, triangles);
}

void contour_by_slices(benchmark::State& state) {
    const ScalarGrid& grid = gyroid_in_sphere(uint32_t(state.range(0)));
    uint64_t triangles = 0;
    for (auto _ : state) {
        Slices slices(grid);
        Counter counter;
        contour_slices(slices, {.inside = ContourInside::below, .threads = int(state.range(1)), .memory_bytes = uint64_t{256} << 20},
                       counter);
        triangles = counter.triangles;
    }
    report(state, triangles);
}

const bool kRegistered = [] {
    const auto add = [](const char* name, auto&& run) {
        benchmark::RegisterBenchmark(name, run)
            ->ArgsProduct({{256, 512}, {1, 2}})
            ->ArgNames({"samples", "threads"})
            ->Unit(benchmark::kMillisecond)
            ->UseRealTime();
    };
    add("contour/dense", [](benchmark::State& s) { contour_dense(s, false); });
    add("contour/dense_normals", [](benchmark::State& s) { contour_dense(s, true); });
    add("contour/slices", contour_by_slices);
    return true;
}();

}  // namespace
}  // namespace strata
