#include "app/bench/speed.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <numeric>
#include <optional>

#include "app/bench/measured_frame.h"
#include "app/bench/splat_kinds.h"
#include "core/error.h"
#include "core/octree/node_selection.h"
#include "core/parallel.h"
#include "io/format.h"

namespace strata {
namespace {

constexpr double kSizes[] = {1, 2, 4, 8, 16};  // diameters, pixels

/// What a step took, and of what.
struct StepTime {
    double ms = 0.0;
    double items = 0.0;  // that the step went through
    std::string_view unit = "points";
};

class SpeedBench {
public:
    SpeedBench(BenchScene& bench_scene, const BenchSettings& settings)
        : scene(bench_scene), bench(settings), camera(camera_of(kBenchViews[0], scene.cloud())),
          frame_settings(bench_frame_settings(settings, scene.cloud())) {}

    // Median wall time of a step, after one run that warms up.
    template <typename Step>
    double time_ms(Step&& step) const {
        std::vector<double> ms;
        for (int run = 0; run <= bench.runs; ++run) {
            const auto start = std::chrono::steady_clock::now();
            step();
            if (run > 0) ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
        }
        return median(std::move(ms));
    }
    // A pass of a frame with these settings.
    StepTime time_pass(const RenderSettings& settings, std::string_view pass) const {
        const MeasuredFrame frame = measure_frame(scene.cloud(), camera, settings, bench.runs);
        return {frame.pass_ms(pass), double(frame.report.points_drawn)};
    }
    double pixels() const { return double(bench.width) * bench.height; }

    BenchScene& scene;
    const BenchSettings& bench;
    Camera camera;
    RenderSettings frame_settings;
};

StepTime time_convert(SpeedBench& bench) {
    return {bench.time_ms([&] { bench.scene.convert(bench.bench); }), double(bench.bench.points)};
}

StepTime time_las_columns(SpeedBench& bench) {
    const std::string path = bench.scene.las_path();
    const std::unique_ptr<PointSource> source = open_points(std::span(&path, 1));
    std::vector<int> all(source->info().attributes.size());
    std::iota(all.begin(), all.end(), 0);
    const double ms = bench.time_ms([&] {
        std::atomic<uint64_t> points = 0;
        parallel_blocks(bench.bench.threads, size_t(source->batch_count()), 1, [&](size_t begin, size_t end) {
            thread_local PointBatch batch;
            for (size_t i = begin; i < end; ++i) {
                source->read_batch(i, all, batch);
                points += batch.size;
            }
        });
        if (points != bench.bench.points) throw Error(ErrorKind::malformed, path + ": points are missing");
    });
    return {ms, double(bench.bench.points)};
}

StepTime time_select(SpeedBench& bench) {
    Selection selection;
    const double ms = bench.time_ms([&] {
        selection = select_nodes(bench.scene.cloud(), bench.camera, bench.bench.width, bench.bench.height, bench.frame_settings.selection);
    });
    return {ms, double(selection.nodes.size()), "nodes"};
}

// From files in the page cache: each run by a renderer and a cloud that know nothing yet.
StepTime time_load(SpeedBench& bench) {
    std::vector<double> ms;
    double points = 0.0;
    for (int run = 0; run < bench.bench.runs; ++run) {
        const std::unique_ptr<LayeredCloud> cloud = bench.scene.reopen();
        Renderer renderer;
        const RenderReport report = renderer.render_frame(*cloud, bench.camera, bench.frame_settings, [](const RenderedRows&) {});
        for (const auto& [pass, pass_ms] : report.pass_ms)
            if (pass == "load") ms.push_back(pass_ms);
        points = double(report.points_drawn);
    }
    return {median(std::move(ms)), points};
}

StepTime time_edl(SpeedBench& bench) {
    RenderSettings settings = bench.frame_settings;
    settings.edl = EdlSettings();
    return {bench.time_pass(settings, "edl").ms, bench.pixels(), "pixels"};
}

StepTime time_png(SpeedBench& bench) {
    const MeasuredFrame frame = measure_frame(bench.scene.cloud(), bench.camera, bench.frame_settings, 1);
    const std::string path = bench.scene.las_path() + ".png";
    return {bench.time_ms([&] { write_png(path, frame.image, true, bench.bench.threads); }), bench.pixels(), "pixels"};
}

struct Step {
    std::string_view name, says;
    StepTime (*time)(SpeedBench&);
};
constexpr Step kSteps[] = {
    {"convert", "LAS to a Potree folder (not synced)", time_convert},
    {"las", "LAS to columns (all attributes)", time_las_columns},
    {"select", "choosing the nodes of a view", time_select},
    {"load", "reading and coloring them (first frame)", time_load},
    {"edl", "eye-dome lighting", time_edl},
    {"png", "writing the picture", time_png},
};

std::optional<BenchSection> run_steps(SpeedBench& bench) {
    BenchSection section{.name = "steps", .title = "Steps from file to picture", .words = {}, .table = {}, .plots = {}};
    section.words = "View far, " + std::to_string(bench.bench.width) + " x " + std::to_string(bench.bench.height) +
                    " pixels, error target 1 px; files are in the page cache. Higher rates are better.";
    section.table.columns = {{"case", "case"}, {"step", "step"}, {"ms", "ms", 2}, {"items", "of", 0}, {"unit", "what"}, {"mega_per_s", "M/s", 2}};
    for (const Step& step : kSteps) {
        if (!bench.bench.wants(step.name)) continue;
        try {
            const StepTime time = step.time(bench);
            section.table.rows.push_back({std::string(step.name), std::string(step.says), time.ms, time.items, std::string(time.unit),
                                          1e-3 * time.items / time.ms});
            char text[96];
            std::snprintf(text, sizeof text, "%-24s %10.2f ms %9.2f M %s/s", std::string(step.name).c_str(), time.ms, 1e-3 * time.items / time.ms,
                          std::string(time.unit).c_str());
            bench.bench.log(text);
        } catch (const Error& error) {
            if (error.kind != ErrorKind::device) throw;
            bench.bench.log(std::string(step.name) + ": left out: " + error.what());
        }
    }
    if (section.table.rows.empty()) return std::nullopt;
    return section;
}

std::optional<BenchSection> run_points(SpeedBench& bench) {
    BenchSection section{.name = "points", .title = "The points pass by splat kind and size", .words = {}, .table = {}, .plots = {}};
    section.words = "Rasterizing alone, the same view; adaptive sizes are those of `strata render` by default.";
    section.table.columns = {{"case", "case"}, {"kind", "splat"}, {"size_px", "diameter, px"}, {"points_ms", "pass, ms", 2},
                             {"points_drawn", "points drawn", 0}, {"mega_per_s", "M points/s", 1}};
    Plot plot{"Points pass: lower is better", {"diameter, px", true}, {"ns a point", true}, {}};
    const auto add = [&](const SplatKind& kind, double size) -> double {
        char size_text[16] = "adaptive";
        if (size > 0.0) std::snprintf(size_text, sizeof size_text, "%g", size);
        const std::string name = "points/" + std::string(kind.name) + "/" + size_text;
        if (!bench.bench.wants(name)) return 0.0;
        RenderSettings settings = bench.frame_settings;
        kind.apply(settings);
        settings.splat.fixed_px = float(size);
        const StepTime time = bench.time_pass(settings, "points");
        section.table.rows.push_back({name, std::string(kind.name), std::string(size_text), time.ms, time.items, 1e-3 * time.items / time.ms});
        bench.bench.log(name);
        return 1e6 * time.ms / time.items;
    };
    for (const SplatKind& kind : kSplatKinds) {
        add(kind, 0.0);
        PlotSeries series{std::string(kind.name), {}};
        for (const double size : kSizes)
            if (const double ns = add(kind, size); ns > 0.0) series.points.emplace_back(size, ns);
        if (!series.points.empty()) plot.series.push_back(series);
    }
    if (section.table.rows.empty()) return std::nullopt;
    if (!plot.series.empty()) section.plots.push_back({"size", plot});
    return section;
}

}  // namespace

BenchReport run_speed(BenchScene& scene, const BenchSettings& settings) {
    BenchReport report{"speed", "Speed", machine_words(settings) + "\n" + scene_words(settings), {}};
    SpeedBench bench(scene, settings);
    if (auto section = run_steps(bench)) report.sections.push_back(std::move(*section));
    if (auto section = run_points(bench)) report.sections.push_back(std::move(*section));
    if (report.sections.empty()) throw Error(ErrorKind::usage, "--only: no case's name contains '" + settings.only + "'");
    return report;
}

}  // namespace strata
