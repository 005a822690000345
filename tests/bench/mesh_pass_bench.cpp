// Meshes in a picture of 1920 x 1080: a bumpy ball of 1.6 M triangles, two of them a pixel, and one of 25 k, whose triangles are large.
#include <benchmark/benchmark.h>

#include <cmath>

#include "render/pass/mesh_pass.h"
#include "tests/support/test_meshes.h"

namespace strata {
namespace {

// n rings; 4 n^2 triangles.
TriangleMesh bumpy_ball(uint32_t n) {
    TriangleMesh mesh = sphere_mesh(Vec3d::Zero(), 1.0, n);
    for (Vec3d& p : mesh.positions) p *= 1.0 + 0.1 * std::sin(9.0 * p.x()) * std::sin(8.0 * p.y() + 1.0) * std::sin(7.0 * p.z() + 2.0);
    return mesh;
}

void draw_mesh(benchmark::State& state) {
    constexpr uint32_t kWidth = 1920, kHeight = 1080;
    const TriangleMesh mesh = bumpy_ball(uint32_t(state.range(0)));
    const int threads = int(state.range(1));
    const MeshStyle style = {state.range(2) == 0 ? MeshShading::flat : MeshShading::smooth};
    const MeshModel model(mesh, MeshColors(mesh, "plain", std::nullopt, {}), style, threads);
    Camera camera;
    camera.eye = {0.3, -2.6, 0.9};
    camera.view_from_world = look_along(-camera.eye, Vec3d::UnitZ());
    camera.fov_rad = 0.8;
    camera.near_depth = 0.1;
    const MeshView view = {camera, kWidth, kHeight, Vec2f::Zero(), {}, threads};
    MeshPass pass;
    GBuffer gbuffer;
    gbuffer.width = kWidth;
    gbuffer.rows = kHeight;
    gbuffer.colors.resize(size_t{kWidth} * kHeight);
    gbuffer.depths.resize(gbuffer.colors.size());
    size_t covered = 0;
    for (auto _ : state) {
        state.PauseTiming();
        std::fill(gbuffer.depths.begin(), gbuffer.depths.end(), kNoDepth);
        state.ResumeTiming();
        pass.draw(model, 1, view, gbuffer);
    }
    for (const float depth : gbuffer.depths) covered += depth != kNoDepth;
    // A ball of that radius, seen from there.
    if (covered < 600'000 || covered > 1'000'000) state.SkipWithError("the ball does not cover what it should");
    state.counters["triangles/s"] = benchmark::Counter(double(mesh.triangles.size()) * double(state.iterations()), benchmark::Counter::kIsRate);
    state.counters["pixels"] = double(covered);
}
BENCHMARK(draw_mesh)
    ->ArgNames({"rings", "threads", "smooth"})
    ->Args({632, 1, 1})
    ->Args({632, 2, 1})
    ->Args({632, 2, 0})
    ->Args({80, 1, 1})
    ->Args({80, 2, 1})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

void corner_normals_of_mesh(benchmark::State& state) {
    const TriangleMesh mesh = bumpy_ball(632);
    for (auto _ : state) benchmark::DoNotOptimize(MeshModel(mesh, MeshColors(mesh, "plain", std::nullopt, {}), {}, int(state.range(0))).corners.size());
    state.counters["triangles/s"] = benchmark::Counter(double(mesh.triangles.size()) * double(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(corner_normals_of_mesh)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace strata
