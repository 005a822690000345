// strata render: opens, asks the renderer for one frame, streams it to files, reports.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "app/commands/commands.h"
#include "app/commands/render_options.h"
#include "app/commands/spared_inputs.h"
#include "core/error.h"
#include "core/octree/memory_cloud.h"
#include "io/format.h"
#include "io/output_file.h"
#include "io/pfm/pfm_writer.h"
#include "io/png/png_writer.h"
#include "io/world_file.h"
#include "render/image_compare.h"

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

// As --camera reads it back.
nlohmann::ordered_json camera_json(const Camera& camera) {
    const double reach = std::max(camera.far_depth, camera.near_depth);
    nlohmann::ordered_json json = {{"eye", vector_json(camera.eye)},
                                   {"target", vector_json(camera.eye + reach * camera.forward())},
                                   {"up", vector_json(camera.up())}};
    if (camera.projection == Projection::orthographic)
        json["ortho_height"] = camera.height;
    else
        json["fov"] = camera.fov_rad * 180.0 / std::numbers::pi;
    return json;
}

nlohmann::ordered_json stats_json(const RenderRequest& request, const RenderReport& report) {
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
                                    {"color", settings.color.name},
                                    {"camera", camera_json(request.camera)}};
    for (const auto& [name, ms] : report.pass_ms) stats["pass_ms"][name] = ms;
    return stats;
}

// A picture straight down has a place on the map.
std::optional<PictureGeoreference> georeference(const Camera& camera, const RenderSettings& settings) {
    if (camera.projection != Projection::orthographic || !(camera.forward().z() < -1.0 + 1e-12)) return std::nullopt;
    const double unit = camera.height / settings.height;
    const Vec2d right = unit * camera.right().head<2>(), down = -unit * camera.up().head<2>();
    return PictureGeoreference{right, down,
                               camera.eye.head<2>() + (0.5 - 0.5 * settings.width) * right + (0.5 - 0.5 * settings.height) * down};
}

std::string difference_path(const std::string& path) {
    return (path.ends_with(".png") ? path.substr(0, path.size() - 4) : path) + ".difference.png";
}

// returns  the exit code
int compare_with_reference(const RenderRequest& request, const Image& picture, nlohmann::ordered_json& stats) {
    const Image reference = read_png(request.reference);
    const ImageDifference difference = compare_images(picture, reference, request.settings.threads);
    stats["difference"] = {{"worst_tile", difference.worst_tile}, {"max_channel", difference.max_channel},
                           {"rms", difference.rms},               {"psnr_db", difference.psnr_db},
                           {"ssim", difference.ssim},             {"threshold", request.threshold}};
    if (difference.worst_tile <= request.threshold) return 0;
    const std::string path = difference_path(request.output);
    write_png(path, difference_picture(picture, reference, difference), true, request.settings.threads);
    std::fprintf(stderr, "strata: %s: differs from %s by %.2f near pixel %u,%u; at most %g allowed; see %s\n",
                 request.output.c_str(), request.reference.c_str(), difference.worst_tile, difference.worst_tile_x,
                 difference.worst_tile_y, request.threshold, path.c_str());
    return 1;
}

// What a picture is made from. Pictures that lie in the folder of a data set are none of it.
std::vector<std::string> files_read(const Options& options) {
    std::vector<std::string> files = options.positional;
    for (const std::string_view flag : {"--camera", "--reference"})
        if (options.given(flag)) files.push_back(options.text(flag));
    std::error_code problem;
    for (const std::string& path : options.positional)
        for (std::filesystem::directory_iterator entry(path, problem), end; !problem && entry != end; entry.increment(problem))
            if (const std::string ending = entry->path().extension(); ending != ".png" && ending != ".pfm" && ending != ".pgw")
                files.push_back(entry->path().string());
    return files;
}

int run(const Options& options) {
    check_render_options(options);
    // Before any work: an output in the way would make it vain.
    for (const std::string_view flag : {"--output", "--depth"}) {
        if (!options.given(flag)) continue;
        check_output_path(options.text(flag), options.given("--overwrite"));
        check_inputs_spared(options.text(flag), files_read(options));
    }
    const std::unique_ptr<LayeredCloud> cloud = open_cloud(options);
    const RenderRequest request = make_render_request(options, *cloud);
    const RenderSettings& settings = request.settings;

    PngWriter::Options png_options;
    png_options.alpha = alpha_of(settings.background) == 255 ? PngWriter::Alpha::dropped : PngWriter::Alpha::kept;
    png_options.overwrite = request.overwrite;
    png_options.threads = settings.threads;
    PngWriter png(request.output, settings.width, settings.height, png_options);
    std::optional<PfmWriter> depth;
    if (!request.depth_output.empty()) depth.emplace(request.depth_output, settings.width, settings.height, request.overwrite);
    Image picture;  // whole only where it is compared
    if (!request.reference.empty()) picture = Image(settings.width, settings.height);

    Renderer renderer;
    const RenderReport report = renderer.render_frame(*cloud, request.camera, settings, [&](const RenderedRows& rows) {
        png.write_rows(rows.colors);
        if (depth) depth->write_rows(rows.first_row, rows.depths);
        if (!request.reference.empty())
            std::copy(rows.colors.begin(), rows.colors.end(), picture.pixels.begin() + ptrdiff_t(rows.first_row) * settings.width);
    });
    if (report.failures.count > 0)
        throw Error(ErrorKind::malformed, std::to_string(report.failures.count) + " nodes cannot be read, so there is no picture; first: " +
                                              report.failures.first);
    const std::optional<PictureGeoreference> place =
        cloud->info().crs.empty() ? std::nullopt : georeference(request.camera, settings);
    if (place) write_world_file(world_file_path(request.output), *place, request.overwrite);
    if (depth) depth->finish();
    png.finish();

    nlohmann::ordered_json stats = stats_json(request, report);
    const int exit_code = request.reference.empty() ? 0 : compare_with_reference(request, picture, stats);
    if (request.stats)
        std::printf("%s\n", stats.dump(2).c_str());
    else if (!request.quiet)
        std::fprintf(stderr, "%s: %u x %u, %llu of %llu points in %.2f s, error %.2f px%s\n", request.output.c_str(), settings.width,
                     settings.height, static_cast<unsigned long long>(report.points_drawn),
                     static_cast<unsigned long long>(cloud->info().points), 1e-3 * report.frame_ms, report.error_px,
                     report.bound_by == BoundBy::error ? "" : (" (" + std::string(bound_name(report.bound_by)) + " reached)").c_str());
    return exit_code;
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
