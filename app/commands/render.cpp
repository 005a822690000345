// strata render: opens, asks the renderer for one frame, streams it to files, reports.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <set>

#include "app/commands/commands.h"
#include "app/commands/render_options.h"
#include "app/commands/scene_files.h"
#include "app/commands/spared_inputs.h"
#include "app/quantity_text.h"
#include "core/error.h"
#include "io/output_file.h"
#include "io/pfm/pfm_writer.h"
#include "io/png/png_writer.h"
#include "io/world_file.h"
#include "render/image_compare.h"

namespace strata {
namespace {

std::string_view bound_name(BoundBy bound) {
    switch (bound) {
        case BoundBy::error: return "error";
        case BoundBy::budget: return "budget";
        case BoundBy::memory: return "memory";
        case BoundBy::time: return "time";
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

// Fields that several surfaces share count once.
nlohmann::ordered_json isosurfaces_json(const Scene& scene, const RenderReport& report) {
    std::set<const FieldBricks*> fields;
    nlohmann::ordered_json isovalues = nlohmann::ordered_json::array();
    uint64_t bricks = 0, bytes = 0, cells = 0;
    for (const IsosurfaceModel& model : scene.isosurfaces) {
        isovalues.push_back(model.surface.level.isovalue);
        cells += count_voxels(model.surface.cells);
        bytes += size_bytes(model.surface.cells);
        if (!fields.insert(model.surface.field).second) continue;
        bricks += model.surface.field->stored_bricks();
        bytes += model.surface.field->size_bytes();
    }
    return {{"isovalues", isovalues}, {"bricks", bricks},          {"bytes", bytes},
            {"cells", cells},         {"rays", report.isosurface_rays}, {"hits", report.isosurface_hits}};
}

nlohmann::ordered_json stats_json(const RenderRequest& request, const RenderReport& report) {
    const RenderSettings& settings = request.settings;
    nlohmann::ordered_json stats = {{"points_drawn", report.points_drawn},
                                    {"nodes_drawn", report.nodes_drawn},
                                    {"voxel_depth", report.voxel_depth},
                                    {"triangles_drawn", report.triangles_drawn},
                                    {"error_px", report.error_px},
                                    {"bound_by", bound_name(report.bound_by)},
                                    {"rasterizer", report.rasterizer == Rasterizer::gpu ? "gpu" : "cpu"},
                                    {"uploaded_bytes", report.uploaded_bytes},
                                    {"gl_renderer", report.gl_renderer},
                                    {"edl_by", report.edl_by},
                                    {"frame_ms", report.frame_ms},
                                    {"pass_ms", nlohmann::ordered_json::object()},
                                    {"size", {settings.width, settings.height}},
                                    {"color", request.color_name},
                                    {"camera", camera_json(request.camera)}};
    for (const auto& [name, ms] : report.pass_ms) stats["pass_ms"][name] = ms;
    if (!request.scene.isosurfaces.empty()) stats["isosurfaces"] = isosurfaces_json(request.scene, report);
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

std::string difference_path(const std::string& path) { return path.substr(0, path.size() - 4) + ".difference.png"; }

// Read before the work: where it is missing or of another size there is nothing to compare.
Image read_reference(const RenderRequest& request) {
    Image reference = read_png(request.reference);
    const RenderSettings& settings = request.settings;
    if (reference.width != settings.width || reference.height != settings.height)
        throw Error(ErrorKind::malformed, request.reference + ": a picture of " + std::to_string(settings.width) + " x " +
                                              std::to_string(settings.height) + " pixels is expected, this one has " +
                                              std::to_string(reference.width) + " x " + std::to_string(reference.height));
    return reference;
}

nlohmann::ordered_json difference_json(const ImageDifference& difference, double threshold) {
    return {{"worst_tile", difference.worst_tile}, {"max_channel", difference.max_channel},
            {"rms", difference.rms},               {"psnr_db", difference.psnr_db},
            {"ssim", difference.ssim},             {"threshold", threshold}};
}

// Says where the picture lies on the map or, for one that lies nowhere, takes away what an earlier picture of that name said:
// a GIS would believe it.
void write_place(const std::string& path, const std::optional<PictureGeoreference>& place, bool overwrite) {
    if (place)
        write_world_file(path, *place, overwrite);
    else if (std::filesystem::exists(path))
        std::filesystem::remove(check_output_path(path, overwrite));
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

// "N of M points "; "voxels down to depth D of E "; "N triangles "
std::string what_was_drawn(const SceneFiles& files, const RenderReport& report) {
    std::string text;
    if (files.cloud) text += with_commas(report.points_drawn) + " of " + with_commas(files.cloud->info().points) + " points ";
    if (!files.voxels.empty()) {
        int finest = 0;
        for (const OpenedVoxels& model : files.voxels) finest = std::max(finest, model.tree->frame.depth());
        text += std::string(text.empty() ? "" : "and ") + "voxels down to depth " + std::to_string(report.voxel_depth) + " of " + std::to_string(finest) + " ";
    }
    if (!files.meshes.empty()) text += std::string(text.empty() ? "" : "and ") + with_commas(report.triangles_drawn) + " triangles ";
    size_t surfaces = 0;
    for (const OpenedField& field : files.fields) surfaces += field.surfaces.size();
    if (surfaces > 0) text += std::string(text.empty() ? "" : "and ") + std::to_string(surfaces) + (surfaces == 1 ? " isosurface " : " isosurfaces ");
    return text;
}

int run(const Options& options) {
    check_render_options(options);
    // Before any work: an output in the way would make it vain.
    for (const std::string_view flag : {"--output", "--depth"}) {
        if (!options.given(flag)) continue;
        check_output_path(options.text(flag), options.given("--overwrite"));
        check_inputs_spared(options.text(flag), files_read(options));
    }
    SceneFiles files = open_scene_files(options);
    const RenderRequest request = make_render_request(options, files);
    const RenderSettings& settings = request.settings;

    PngWriter::Options png_options;
    png_options.alpha = alpha_of(settings.background) == 255 ? PngWriter::Alpha::dropped : PngWriter::Alpha::kept;
    png_options.overwrite = request.overwrite;
    png_options.threads = settings.threads;
    PngWriter png(request.output, settings.width, settings.height, png_options);
    std::optional<PfmWriter> depth;
    if (!request.depth_output.empty()) depth.emplace(request.depth_output, settings.width, settings.height, request.overwrite);
    Image picture, reference;  // whole only where they are compared
    if (!request.reference.empty()) {
        reference = read_reference(request);
        picture = Image(settings.width, settings.height);
    }
    const std::optional<PictureGeoreference> place =
        files.crs().empty() ? std::nullopt : georeference(request.camera, settings);
    const std::string place_path = world_file_path(request.output);
    check_output_path(place_path, request.overwrite);

    Renderer renderer;
    const RenderReport report = renderer.render_frame(request.scene, request.camera, settings, [&](const RenderedRows& rows) {
        png.write_rows(rows.colors);
        if (depth) depth->write_rows(rows.first_row, rows.depths);
        if (!request.reference.empty())
            std::copy(rows.colors.begin(), rows.colors.end(), picture.pixels.begin() + ptrdiff_t(rows.first_row) * settings.width);
    });
    if (report.failures.count > 0)
        throw Error(ErrorKind::malformed, std::to_string(report.failures.count) + " nodes cannot be read, so there is no picture; first: " +
                                              report.failures.first);
    const bool no_surface = std::all_of(request.scene.isosurfaces.begin(), request.scene.isosurfaces.end(), [](const IsosurfaceModel& model) { return model.bounds.empty(); });
    const bool empty = files.meshes.empty() && no_surface && (!files.cloud || files.cloud->info().points == 0) &&
                       std::all_of(files.voxels.begin(), files.voxels.end(), [](const OpenedVoxels& model) { return model.tree->empty(); });
    if (report.points_drawn == 0 && report.voxel_depth == 0 && report.triangles_drawn == 0 && report.isosurface_hits == 0 && !empty && !request.quiet)
        std::fprintf(stderr, "note: %s: nothing is in sight: the view, --clip or --filter leave nothing\n", request.output.c_str());
    write_place(place_path, place, request.overwrite);
    if (depth) depth->finish();
    png.finish();

    nlohmann::ordered_json stats = stats_json(request, report);
    std::optional<ImageDifference> difference;
    if (!request.reference.empty()) {
        difference = compare_images(picture, reference, settings.threads);
        stats["difference"] = difference_json(*difference, request.threshold);
    }
    if (request.stats)
        std::printf("%s\n", stats.dump(2).c_str());
    else if (!request.quiet)
        std::fprintf(stderr, "%s: %u x %u, %sin %.2f s, error %.2f px%s\n", request.output.c_str(), settings.width, settings.height,
                     what_was_drawn(files, report).c_str(), 1e-3 * report.frame_ms, report.error_px,
                     report.bound_by == BoundBy::error ? "" : (" (" + std::string(bound_name(report.bound_by)) + " reached)").c_str());
    if (!difference || difference->worst_tile <= request.threshold) return 0;
    const std::string difference_file = difference_path(request.output);
    write_png(difference_file, difference_picture(picture, reference, *difference), true, settings.threads);
    std::fprintf(stderr, "strata: %s: differs from %s by %.2f near pixel %u,%u; at most %g allowed; see %s\n",
                 request.output.c_str(), request.reference.c_str(), difference->worst_tile, difference->worst_tile_x,
                 difference->worst_tile_y, request.threshold, difference_file.c_str());
    return 1;
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
