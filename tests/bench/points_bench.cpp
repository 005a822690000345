// The rasterizers, beside GL_POINTS on the same machine and beside reading the points' bytes and nothing more; whole frames; and a
// flight under a cap of memory. STRATA_BENCH_SET names a Potree set: strata sample scan.las --points 50000000, strata convert scan.las set.
// At 1920 x 1080, its usual view.
#include <benchmark/benchmark.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>

#include "core/octree/node_selection.h"
#include "core/parallel.h"
#include "io/format.h"
#include "render/gl/egl_context.h"
#include "render/named_view.h"
#include "render/pass/edl_kernel.h"
#include "render/pass/edl_pass.h"
#include "render/pass/points_gl_pass.h"
#include "render/pass/points_kernel.h"
#include "render/pass/points_pass.h"
#include "render/renderer.h"
#include "render/stream/resident_cloud.h"
#include "render/stream/shape_field.h"

namespace strata {
namespace {

constexpr uint32_t kWidth = 1920, kHeight = 1080;

// Nodes of one view, loaded and ready to draw.
struct View {
    std::unique_ptr<LayeredCloud> cloud;
    Camera camera;
    std::unique_ptr<ResidentCloud> resident;
    std::vector<PointNode> nodes;
    uint64_t count = 0;

    View(const char* path, double error_px, uint64_t budget) : cloud(open_layered(path)) {
        camera = named_view("iso", Projection::perspective, 0.785398, sample_positions(*cloud), double(kWidth) / kHeight);
        fit_depth_range(camera, cloud->info().bounds);
        const SelectionSettings limits = {.error_px = error_px, .point_budget = budget};
        const int threads = default_thread_count();
        resident = std::make_unique<ResidentCloud>(
            *cloud, ResidencySettings{.color = find_color_channel(cloud->info(), "lod"), .threads = threads});
        const FrameNodes frame = resident->gather(select_nodes(*cloud, camera, kWidth, kHeight, limits), limits, ~uint64_t{0},
                                                  NodeCache::Clock::time_point::max());
        update_shapes(*cloud, frame.ids, frame.points, threads);
        for (const ResidentNode* points : frame.points) {
            nodes.push_back({points, uint32_t(count), 0.0f, float(kHeight)});
            count += points->size();
        }
    }

    PointProjection projection() const { return {camera, cloud->info().quantization, kWidth, kHeight}; }
};

// few: what a frame draws at an error of 1 px; else 10 million points
const View* view(benchmark::State& state, bool few) {
    const char* const path = std::getenv("STRATA_BENCH_SET");
    if (path == nullptr) {
        state.SkipWithError("STRATA_BENCH_SET names no Potree set");
        return nullptr;
    }
    static std::unique_ptr<View> views[2];
    if (!views[few]) views[few] = std::make_unique<View>(path, few ? 1.0 : 0.01, few ? ~uint64_t{0} : 10'000'000);
    return views[few].get();
}

void report(benchmark::State& state, const View& view) {
    state.counters["points"] = double(view.count);
    state.counters["points/s"] = benchmark::Counter(double(view.count) * double(state.iterations()), benchmark::Counter::kIsRate);
}

// The bound: the 12 bytes of each point, once.
void read_positions(benchmark::State& state) {
    const View* const v = view(state, false);
    if (v == nullptr) return;
    for (auto _ : state) {
        std::atomic<uint32_t> sum = 0;
        parallel_blocks(int(state.range(0)), v->nodes.size(), 1, [&](size_t begin, size_t end) {
            uint32_t part = 0;
            for (size_t i = begin; i < end; ++i)
                for (const auto* column : {&v->nodes[i].points->x, &v->nodes[i].points->y, &v->nodes[i].points->z})
                    for (const int32_t q : *column) part += uint32_t(q);
            sum += part;
        });
        benchmark::DoNotOptimize(sum.load());
    }
    report(state, *v);
}
BENCHMARK(read_positions)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

void clear_words(benchmark::State& state) {
    PointsPass pass;
    for (auto _ : state) pass.clear(kWidth, 0, kHeight, int(state.range(0)));
}
BENCHMARK(clear_words)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

// Every bench's picture is that of the plainest kernel on one thread.
uint64_t checksum(const GBuffer& picture) {
    uint64_t sum = 14695981039346656037u;
    for (size_t i = 0; i < picture.depths.size(); ++i)
        sum = (sum ^ std::bit_cast<uint32_t>(picture.depths[i]) ^ picture.ids[i]) * 1099511628211u;
    return sum;
}

void draw(benchmark::State& state, bool few, SplatStyle style, SimdLevel level) {
    const View* const v = view(state, few);
    if (v == nullptr) return;
    if (level > best_simd_level()) return state.SkipWithError("not on this processor");
    const int threads = int(state.range(0));
    const PointProjection projection = v->projection();
    PointsPass pass;
    for (auto _ : state) {
        state.PauseTiming();
        pass.clear(kWidth, 0, kHeight, threads);
        state.ResumeTiming();
        pass.draw(v->nodes, projection, style, threads, level);
    }
    report(state, *v);
    GBuffer drawn, expected;
    pass.resolve(v->nodes, projection, style, {.ids = true}, threads, drawn);
    pass.clear(kWidth, 0, kHeight, 1);
    pass.draw(v->nodes, projection, style, 1, SimdLevel::baseline);
    pass.resolve(v->nodes, projection, style, {.ids = true}, 1, expected);
    if (checksum(drawn) != checksum(expected)) state.SkipWithError("another picture");
}

// By the compute shader on whatever GL there is, with emptying the words and reading them back. Points are in its memory before.
void draw_gpu(benchmark::State& state, bool few, SplatStyle style) {
    const View* const v = view(state, few);
    if (v == nullptr) return;
    const int threads = default_thread_count();
    const PointProjection projection = v->projection();
    const EglContext context(threads);
    state.SetLabel(context.renderer());
    PointsGlPass gpu(context);
    PointsPass pass;
    const WordRows words = pass.resize(kWidth, 0, kHeight);
    const auto draw_all = [&] { gpu.draw(words, nullptr, v->nodes, projection, style, uint64_t{1} << 30); };
    draw_all();  // compiles, and brings the points
    const uint64_t uploaded = gpu.uploaded_bytes();
    for (auto _ : state) draw_all();
    report(state, *v);
    if (gpu.uploaded_bytes() != uploaded) return state.SkipWithError("points are brought again");
    GBuffer drawn, expected;
    pass.resolve(v->nodes, projection, style, {.ids = true}, threads, drawn);
    pass.clear(kWidth, 0, kHeight, threads);
    pass.draw(v->nodes, projection, style, threads);
    pass.resolve(v->nodes, projection, style, {.ids = true}, threads, expected);
    if (context.is_software() && checksum(drawn) != checksum(expected)) state.SkipWithError("another picture");
}

void resolve(benchmark::State& state, bool splat_px) {
    const View* const v = view(state, true);
    if (v == nullptr) return;
    const int threads = int(state.range(0));
    const PointProjection projection = v->projection();
    PointsPass pass;
    pass.clear(kWidth, 0, kHeight, threads);
    pass.draw(v->nodes, projection, {}, threads);
    GBuffer out;
    for (auto _ : state) pass.resolve(v->nodes, projection, {}, {.splat_px = splat_px}, threads, out);
}
BENCHMARK_CAPTURE(resolve, plain, false)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(resolve, with_sizes, true)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

// Eye-dome lighting by the kernel, and by GL with the copies there and back that it takes.
void edl(benchmark::State& state, bool gl) {
    const View* const v = view(state, true);
    if (v == nullptr) return;
    const int threads = int(state.range(0));
    const PointProjection projection = v->projection();
    PointsPass points;
    points.clear(kWidth, 0, kHeight, threads);
    points.draw(v->nodes, projection, {}, threads);
    GBuffer picture;
    points.resolve(v->nodes, projection, {}, {.splat_px = true}, threads, picture);
    std::vector<Rgba8> expected(picture.colors.size()), shaded(picture.colors.size());
    shade_edl(picture, {}, v->camera, kHeight, 0, kHeight, 1, expected, SimdLevel::baseline);
    if (gl) {
        const EglContext context(threads);
        EdlPass pass(context);
        pass.shade(picture, {}, v->camera, kHeight, 0, kHeight, shaded);  // compiles
        for (auto _ : state) pass.shade(picture, {}, v->camera, kHeight, 0, kHeight, shaded);
    } else {
        for (auto _ : state) shade_edl(picture, {}, v->camera, kHeight, 0, kHeight, threads, shaded);
    }
    for (size_t i = 0; i < shaded.size(); ++i)
        for (const auto channel : {red_of, green_of, blue_of, alpha_of})
            if (std::abs(channel(shaded[i]) - channel(expected[i])) > int(gl)) return state.SkipWithError("other shades");
}
BENCHMARK_CAPTURE(edl, kernel, false)->ArgName("threads")->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(edl, gl, true)->ArgName("threads")->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

const int kRegistered = [] {
    const SplatStyle pixel = {.shape = SplatShape::square, .fixed_px = 1.0f}, disc = {.shape = SplatShape::disc, .fixed_px = 3.0f};
    for (const auto& [name, few, style] : {std::tuple("draw_gpu/1px", false, pixel), {"draw_gpu/discs_3px", false, disc}, {"draw_gpu/frame", true, SplatStyle{}}})
        benchmark::RegisterBenchmark(name, draw_gpu, few, style)->UseRealTime()->Unit(benchmark::kMillisecond);
    for (const SimdLevel level : {SimdLevel::baseline, SimdLevel::avx2, SimdLevel::avx512}) {
        const std::string with = "/" + std::string(name_of(level));
        for (const auto& [name, few, style] :
             {std::tuple("draw/1px", false, pixel), {"draw/discs_3px", false, disc}, {"draw/frame", true, SplatStyle{}}})
            benchmark::RegisterBenchmark((name + with).c_str(), draw, few, style, level)
                ->ArgName("threads")
                ->Arg(1)
                ->Arg(2)
                ->UseRealTime()
                ->Unit(benchmark::kMillisecond);
    }
    return 0;
}();

// The same points as GL_POINTS of one pixel with a depth test: floats relative to the eye, from a buffer made before.
class GlPoints {
public:
    explicit GlPoints(const View& view) : context_(default_thread_count()), count_(view.count) {
        const Quantization& quantization = view.cloud->info().quantization;
        std::vector<float> xyz;
        for (const PointNode& node : view.nodes)
            for (size_t i = 0; i < node.points->size(); ++i) {
                const Vec3i quanta(node.points->x[i], node.points->y[i], node.points->z[i]);
                const Vec3d p = view.camera.view_from_world * (quantization.world_from_quanta(quanta) - view.camera.eye);
                for (int axis = 0; axis < 3; ++axis) xyz.push_back(float(p[axis]));
            }
        glCreateBuffers(1, &buffer_);
        glNamedBufferStorage(buffer_, GLsizeiptr(xyz.size() * sizeof(float)), xyz.data(), 0);
        glCreateVertexArrays(1, &array_);
        glVertexArrayVertexBuffer(array_, 0, buffer_, 0, 3 * sizeof(float));
        glVertexArrayAttribFormat(array_, 0, 3, GL_FLOAT, GL_FALSE, 0);
        glEnableVertexArrayAttrib(array_, 0);
        glCreateRenderbuffers(2, targets_);
        glNamedRenderbufferStorage(targets_[0], GL_RGBA8, kWidth, kHeight);
        glNamedRenderbufferStorage(targets_[1], GL_DEPTH_COMPONENT32F, kWidth, kHeight);
        glCreateFramebuffers(1, &framebuffer_);
        glNamedFramebufferRenderbuffer(framebuffer_, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, targets_[0]);
        glNamedFramebufferRenderbuffer(framebuffer_, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, targets_[1]);
        const double scale = pixels_per_unit(view.camera, 1.0, kHeight);
        program_ = glCreateProgram();
        attach(GL_VERTEX_SHADER,
               "#version 450\nlayout(location=0) in vec3 p; layout(location=0) uniform vec3 s;"
               "void main() { gl_Position = vec4(p.xy * s.xy, -s.z, -p.z); }");
        attach(GL_FRAGMENT_SHADER, "#version 450\nlayout(location=0) out vec4 c; void main() { c = vec4(1.0); }");
        glLinkProgram(program_);
        glUseProgram(program_);
        glUniform3f(0, float(2.0 * scale / kWidth), float(2.0 * scale / kHeight), -float(view.camera.near_depth));
        glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
        glViewport(0, 0, kWidth, kHeight);
        glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
        glEnable(GL_DEPTH_TEST);
        glDepthFunc(GL_GREATER);
        glClearDepth(0.0);
        glBindVertexArray(array_);
    }
    GlPoints(const GlPoints&) = delete;
    GlPoints& operator=(const GlPoints&) = delete;
    // What it made goes with its context.

    void draw() {
        glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
        glDrawArrays(GL_POINTS, 0, GLsizei(count_));
        glFinish();
    }

    size_t drawn() {
        std::vector<Rgba8> pixels(size_t(kWidth) * kHeight);
        glReadPixels(0, 0, kWidth, kHeight, GL_RGBA, GL_UNSIGNED_BYTE, pixels.data());
        return size_t(std::count_if(pixels.begin(), pixels.end(), [](Rgba8 pixel) { return pixel != 0; }));
    }

private:
    void attach(GLenum stage, const char* text) {
        const GLuint shader = glCreateShader(stage);
        glShaderSource(shader, 1, &text, nullptr);
        glCompileShader(shader);
        glAttachShader(program_, shader);
    }

    EglContext context_;
    uint64_t count_;
    GLuint buffer_ = 0, array_ = 0, framebuffer_ = 0, program_ = 0, targets_[2] = {};
};

void gl_points(benchmark::State& state) {
    const View* const v = view(state, false);
    if (v == nullptr) return;
    GlPoints points(*v);
    points.draw();  // compiles
    for (auto _ : state) points.draw();
    report(state, *v);
    // As many pixels as the CPU rasterizer covers, but for points on the border of two.
    PointsPass pass;
    const SplatStyle style = {.shape = SplatShape::square, .fixed_px = 1.0f};
    pass.clear(kWidth, 0, kHeight, 2);
    pass.draw(v->nodes, v->projection(), style, 2);
    GBuffer drawn;
    pass.resolve(v->nodes, v->projection(), style, {}, 2, drawn);
    const size_t expected = size_t(std::count_if(drawn.depths.begin(), drawn.depths.end(), [](float depth) { return depth != kNoDepth; }));
    if (std::max(expected, points.drawn()) - std::min(expected, points.drawn()) > expected / 1000) state.SkipWithError("other pixels");
}
// Whole warm frames at an error of 1 px, as `strata render` draws them: adaptive paraboloids or discs under eye-dome lighting, also with
// ambient occlusion and filled holes.
RenderSettings frame_settings(const LayeredCloud& cloud, SplatShape shape, bool all_passes) {
    RenderSettings settings;
    settings.width = kWidth;
    settings.height = kHeight;
    settings.color = find_color_channel(cloud.info(), "rgb");
    settings.splat.shape = shape;
    settings.threads = default_thread_count();
    settings.edl = EdlSettings();
    if (!all_passes) return settings;
    settings.ssao.radius = 2.0f;
    settings.fill.gap_px = FillSettings::kWidestGap;
    return settings;
}

void frame(benchmark::State& state, SplatShape shape, bool all_passes) {
    const View* const v = view(state, true);
    if (v == nullptr) return;
    const RenderSettings settings = frame_settings(*v->cloud, shape, all_passes);
    Renderer renderer;
    RenderReport last;
    const auto draw_frame = [&] { last = renderer.render_frame(*v->cloud, v->camera, settings, [](const RenderedRows&) {}); };
    draw_frame();  // reads
    std::map<std::string, double> passes;
    for (auto _ : state) {
        draw_frame();
        for (const auto& [pass, ms] : last.pass_ms) passes[pass] += ms / double(state.max_iterations);
    }
    state.counters["points"] = double(last.points_drawn);
    for (const auto& [pass, ms] : passes) state.counters[pass + "_ms"] = ms;
    if (last.nodes_missing > 0 || last.bound_by != BoundBy::error) state.SkipWithError("another picture");
}
BENCHMARK_CAPTURE(frame, paraboloid, SplatShape::paraboloid, false)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frame, disc, SplatShape::disc, false)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frame, paraboloid_all_passes, SplatShape::paraboloid, true)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(frame, disc_all_passes, SplatShape::disc, true)->UseRealTime()->Unit(benchmark::kMillisecond);

// A flight down into the cloud and across it, under a cap of 256 MB, that never waits: each frame shows something, and neither nodes nor
// rows take more than the cap.
void flight(benchmark::State& state) {
    const View* const v = view(state, true);
    if (v == nullptr) return;
    constexpr int kFrames = 100;
    RenderSettings settings = frame_settings(*v->cloud, SplatShape::paraboloid, false);
    settings.memory_bytes = 256'000'000;
    settings.wait = false;
    const Box3d& box = v->cloud->info().bounds;
    Renderer renderer;
    double worst_ms = 0.0, most_bytes = 0.0, least_share = 1.0;
    uint64_t waiting = 0;
    for (auto _ : state)
        for (int i = 0; i < kFrames; ++i) {
            const double s = double(i) / kFrames, aside = std::sin(9.0 * s);
            Camera camera = v->camera;
            const Vec3d low(box.min.x() + (0.1 + 0.8 * s) * (box.max.x() - box.min.x()),
                            box.min.y() + (0.5 + 0.3 * aside) * (box.max.y() - box.min.y()), box.min.z() + 60.0);
            camera.eye = v->camera.eye + std::min(1.0, 4.0 * s) * (low - v->camera.eye);
            const double down = std::max(0.0, 1.0 - 4.0 * s);  // at first it looks as the usual view does
            camera.view_from_world =
                look_along(down * v->camera.forward() + (1.0 - down) * Vec3d(1.0, 0.7 * std::cos(9.0 * s), -0.4), Vec3d::UnitZ());
            fit_depth_range(camera, box);
            size_t shown = 0;
            const RenderReport drawn = renderer.render_frame(*v->cloud, camera, settings, [&](const RenderedRows& rows) {
                shown += size_t(std::count_if(rows.depths.begin(), rows.depths.end(), [](float depth) { return depth != kNoDepth; }));
            });
            worst_ms = std::max(worst_ms, drawn.frame_ms);
            most_bytes = std::max(most_bytes, double(renderer.resident_bytes()));
            least_share = std::min(least_share, double(shown) / (double(kWidth) * kHeight));
            waiting += drawn.nodes_missing > 0;
            if (renderer.resident_bytes() > settings.memory_bytes) state.SkipWithError("over the cap");
            if (shown == 0) state.SkipWithError("a frame without picture");
        }
    state.counters = {{"frames", kFrames},           {"worst_ms", worst_ms},       {"most_MB", 1e-6 * most_bytes},
                      {"least_pixels", least_share}, {"waiting", double(waiting)}, {"nodes_read", double(renderer.nodes_read())}};
}
BENCHMARK(flight)->Iterations(1)->UseRealTime()->Unit(benchmark::kMillisecond);

BENCHMARK(gl_points)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace strata
