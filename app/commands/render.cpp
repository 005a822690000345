// strata render: opens, asks the renderer for one frame, streams it to files, reports.
#include <sys/resource.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/commands/commands.h"
#include "app/commands/render_options.h"
#include "core/error.h"
#include "core/octree/memory_cloud.h"
#include "io/format.h"
#include "io/output_file.h"
#include "io/png/png_writer.h"

namespace strata {
namespace {

std::unique_ptr<LayeredCloud> open_cloud(const Options& options) {
    const std::vector<std::string>& paths = options.positional;
    if (identify_format(paths[0]).kind == FormatKind::layered) {
        if (paths.size() > 1)
            throw Error(ErrorKind::usage, "render: one level-of-detail data set at a time, or several plain files");
        return open_layered(paths[0]);
    }
    const std::unique_ptr<PointSource> source = open_points(paths);
    BuildSettings settings;
    settings.threads = thread_count(options);
    settings.memory_bytes = memory_cap(options);
    return build_memory_cloud(*source, settings);
}

std::string_view bound_name(BoundBy bound) {
    switch (bound) {
        case BoundBy::error: return "error";
        case BoundBy::budget: return "budget";
        case BoundBy::memory: return "memory";
    }
    return "";
}

nlohmann::ordered_json vector_json(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }

void print_stats(const RenderRequest& request, const RenderReport& report) {
    const RenderSettings& settings = request.settings;
    nlohmann::ordered_json stats = {{"points_drawn", report.points_drawn},
                                    {"nodes_drawn", report.nodes_drawn},
                                    {"error_px", report.error_px},
                                    {"bound_by", bound_name(report.bound_by)},
                                    {"rasterizer", "cpu"},
                                    {"gl_renderer", report.gl_renderer},
                                    {"frame_ms", report.frame_ms},
                                    {"pass_ms", nlohmann::ordered_json::object()},
                                    {"size", {settings.width, settings.height}},
                                    {"color", settings.color.name}};
    for (const auto& [name, ms] : report.pass_ms) stats["pass_ms"][name] = ms;
    std::printf("%s\n", stats.dump(2).c_str());
}

int run(const Options& options) {
    check_render_options(options);
    // Before any work: an output in the way would make it vain.
    check_output_path(options.text("--output"), options.given("--overwrite"));
    const std::unique_ptr<LayeredCloud> cloud = open_cloud(options);
    const RenderRequest request = make_render_request(options, *cloud);
    const RenderSettings& settings = request.settings;

    PngWriter::Options png_options;
    png_options.alpha = alpha_of(settings.background) == 255 ? PngWriter::Alpha::dropped : PngWriter::Alpha::kept;
    png_options.overwrite = request.overwrite;
    png_options.threads = settings.threads;
    PngWriter png(request.output, settings.width, settings.height, png_options);
    Renderer renderer;
    const RenderReport report = renderer.render_frame(*cloud, request.camera, settings,
                                                      [&](const RenderedRows& rows) { png.write_rows(rows.colors); });
    if (report.failures.count > 0)
        throw Error(ErrorKind::malformed, std::to_string(report.failures.count) + " nodes cannot be read, no picture written; first: " +
                                              report.failures.first);
    png.finish();
    if (request.stats) print_stats(request, report);
    return 0;
}

}  // namespace

Command render_command() {
    return {.name = "render",
            .summary = "a headless picture of anything strata opens",
            .positional = "PATH...",
            .least_positional = 1,
            .rows = render_option_rows(),
            .run = run};
}

}  // namespace strata
