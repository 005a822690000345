// strata surface: volumes, grids, voxels and points to meshes.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "app/commands/camera_file.h"
#include "app/commands/command_report.h"
#include "app/commands/commands.h"
#include "app/commands/info_json.h"
#include "app/commands/spared_inputs.h"
#include "app/commands/isovalues.h"
#include "app/commands/render_options.h"
#include "app/commands/surface_input.h"
#include "app/peak_memory.h"
#include "app/quantity_text.h"
#include "core/error.h"
#include "core/surface/scalar_ranges.h"
#include "core/surface/surface_report.h"
#include "io/mesh/surface_writer.h"
#include "io/scratch_file.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

constexpr OptionRow kRows[] = {
    {"--output", "-o", "OUT", "", "the mesh to write: .ply, .obj, .stl or .glb"},
    {"--iso", "-i", "V,...", "", "isovalues: the surface where values cross V; several make one mesh of several colors. Needed for volumes and fog volumes; of a level set 0 if not given"},
    {"--method", "", "METHOD", "", "marching-cubes (where values cross --iso), cubes (faces of voxels or of the samples inside --iso, merged to rectangles), or of points smooth or balls; default: smooth of points, cubes of .svo files, marching-cubes of volumes and .vdb files"},
    {"--inside", "", "SIDE", "", "above or below: where values are greater or less than the isovalue the surface is solid; default: above, of a level set below"},
    {"--close", "", "", "", "of volumes: close the surface where it meets the boundary"},
    {"--normals", "-n", "", "", "normals of vertices, from the gradient of the values; of cubes those of faces, which then share vertices only where they look the same way"},
    {"--voxel-size", "-s", "UNITS", "", "of points and meshes: the side of the voxels to make, or what lies between samples, CRS units; of a .svo file the coarsest cells that are no larger"},
    {"--radius", "", "UNITS", "", "of points, smooth: how far a point has a say; default: 3 times what lies between points. With --method balls: of the balls"},
    {"--viewpoint", "", "X,Y,Z", "", "of points, for --method smooth: where the scanner stood, CRS units, so that normals look there; default: normals of the points, else as neighbors agree"},
    {"--error", "-e", "VOXELS|PXpx", "", "of a .svo file: the coarsest cells whose cubes lie within so many voxels of the finest, or, such as 1.5px, pixels of a picture"},
    {"--camera", "", "FILE.json", "", "of --error in pixels: the camera, as render has it; default: what render shows of all"},
    {"--size", "", "WIDTHxHEIGHT", "1920x1080", "of --error in pixels: of the picture"},
    {"--labels", "", "", "", "of volumes: cubes of each value that is not 0, a color and a value 'label' of vertices for each"},
    {"--quads", "", "", "", "of cubes: each rectangle with four corners of its own, not cut where others meet it; pixels between rectangles may stay open"},
    {"--transparent", "", "LIST", "", "of cubes: colors that can be seen through, as RRGGBB:OPACITY with commas, opacity 0 to 254; what lies behind them keeps its faces"},
    {"--attributes", "", "LIST", "", "values for the vertices, at most 16, with commas: of points attributes, of volumes other volume files, of a .vdb file other grids. .ply and .glb keep them"},
    {"--grid", "", "NAME", "", "of a .vdb file: the grid of that name; default: the first that can be read"},
    {"--dimensions", "", "XxYxZ", "", "IN is samples alone, so many along each axis, the first running fastest"},
    {"--type", "", "TYPE", "uint8", "of samples alone: int8 to int64, uint8 to uint64, float or double"},
    {"--endian", "", "ORDER", "little", "of samples alone: little or big"},
    {"--spacing", "", "X,Y,Z", "1,1,1", "of samples alone: distances along each axis"},
    {"--header-bytes", "", "N", "", "of samples alone: bytes before the first; default: the samples are the end of the file"},
    {"--no-sync", "", "", "", "do not wait until the output is on the disk; a power cut may lose it"},
    shared_option::kMemory,
    shared_option::kThreads,
    shared_option::kOverwrite,
    shared_option::kJson,
    shared_option::kQuiet,
};

// "256x256x128"
std::array<uint32_t, 3> parse_dimensions(const std::string& text) {
    std::array<uint32_t, 3> sizes{};
    const char* at = text.data();
    const char* const end = at + text.size();
    for (size_t axis = 0; axis < 3; ++axis) {
        const auto [stop, problem] = std::from_chars(at, end, sizes[axis]);
        const bool separated = axis == 2 ? stop == end : stop != end && *stop == 'x';
        if (problem != std::errc() || sizes[axis] == 0 || !separated)
            throw Error(ErrorKind::usage, "--dimensions: expected three numbers of samples such as 256x256x128, got '" + text + "'");
        at = stop + 1;
    }
    return sizes;
}

std::optional<RawVolumeLayout> raw_layout(const Options& options) {
    if (!options.given("--dimensions")) {
        for (const char* const flag : {"--type", "--endian", "--spacing", "--header-bytes"})
            if (options.given(flag)) throw Error(ErrorKind::usage, std::string(flag) + " is for samples alone: --dimensions XxYxZ is expected with it");
        return std::nullopt;
    }
    RawVolumeLayout layout = {.size = parse_dimensions(options.text("--dimensions"))};
    const std::optional<SampleType> type = sample_type_named(options.text("--type"));
    if (!type) throw Error(ErrorKind::usage, "--type: expected int8, uint8, int16, uint16, int32, uint32, int64, uint64, float or double, got '" + options.text("--type") + "'");
    layout.type = *type;
    const std::string order = options.text("--endian");
    if (order != "little" && order != "big") throw Error(ErrorKind::usage, "--endian: expected little or big, got '" + order + "'");
    layout.is_big_endian = order == "big";
    const std::vector<double> spacing = options.numbers("--spacing", 3);
    layout.spacing = {spacing[0], spacing[1], spacing[2]};
    if (!(layout.spacing.minCoeff() > 0.0)) throw Error(ErrorKind::usage, "--spacing: expected three numbers above 0, got '" + options.text("--spacing") + "'");
    if (options.given("--header-bytes")) layout.offset = uint64_t(options.integer("--header-bytes", 0, std::numeric_limits<int64_t>::max()));
    return layout;
}

// "60a0ff:90,ffffff:40"
std::vector<std::pair<VoxelColor, uint8_t>> parse_transparent(const std::string& text) {
    std::vector<std::pair<VoxelColor, uint8_t>> colors;
    for (const std::string& text_of_one : split_list(text)) {
        const std::string_view item = text_of_one;
        const auto parse = [](std::string_view word, int base, uint32_t& number) {
            const auto [stop, problem] = std::from_chars(word.data(), word.data() + word.size(), number, base);
            return problem == std::errc() && stop == word.data() + word.size();
        };
        uint32_t color = 0, opacity = 255;
        if (item.find(':') != 6 || !parse(item.substr(0, 6), 16, color) || !parse(item.substr(7), 10, opacity) || opacity > 254)
            throw Error(ErrorKind::usage, "--transparent: expected colors such as 60a0ff:90, each with an opacity of 0 to 254, got '" + text_of_one + "'");
        colors.push_back({{uint8_t(color >> 16), uint8_t(color >> 8), uint8_t(color)}, uint8_t(opacity)});
    }
    return colors;
}

std::vector<std::string> parse_attributes(const std::string& text) {
    constexpr size_t kMost = 16;
    std::vector<std::string> names;
    for (const std::string& name : split_list(text)) {
        if (name.empty()) throw Error(ErrorKind::usage, "--attributes: expected names with commas between them, got '" + text + "'");
        if (std::find(names.begin(), names.end(), name) != names.end()) throw Error(ErrorKind::usage, "--attributes: '" + name + "' is there twice");
        names.push_back(name);
    }
    if (names.size() > kMost) throw Error(ErrorKind::usage, "--attributes: expected at most " + std::to_string(kMost) + " names, got " + std::to_string(names.size()));
    return names;
}

CellError parse_error(const Options& options) {
    std::string text = options.text("--error");
    CellError error = {.in_pixels = text.ends_with("px")};
    if (error.in_pixels) text.resize(text.size() - 2);
    error.most = parse_number("--error", text);
    if (error.most < 0.0) throw Error(ErrorKind::usage, "--error: expected a number of voxels or, with px, of pixels, 0 or more, got '" + options.text("--error") + "'");
    if (!error.in_pixels)
        for (const char* const flag : {"--camera", "--size"})
            if (options.given(flag)) throw Error(ErrorKind::usage, std::string(flag) + " is for --error in pixels, such as --error " + text + "px");
    if (options.given("--camera")) error.camera = camera_of(read_camera_file(options.text("--camera")));
    std::tie(error.width_px, error.height_px) = parse_size(options.text("--size"));
    return error;
}

const char* method_name(SurfaceMethod method) {
    switch (method) {
        case SurfaceMethod::marching_cubes: return "marching-cubes";
        case SurfaceMethod::cubes: return "cubes";
        case SurfaceMethod::smooth: return "smooth";
        case SurfaceMethod::balls: return "balls";
    }
    return "";
}

double positive(const Options& options, const char* flag) {
    const double value = options.number(flag);
    if (!(value > 0.0)) throw Error(ErrorKind::usage, std::string(flag) + ": expected a positive number, got '" + options.text(flag) + "'");
    return value;
}

SurfaceRequest request_of(const Options& options, const std::string& folder) {
    SurfaceRequest request = {.close = options.given("--close"),
                              .normals = options.given("--normals"),
                              .grid = options.text("--grid"),
                              .raw = raw_layout(options),
                              .threads = thread_count(options),
                              .memory_bytes = memory_cap(options),
                              .scratch_folder = folder};
    request.quads = options.given("--quads");
    request.labels = options.given("--labels");
    if (options.given("--attributes")) request.attributes = parse_attributes(options.text("--attributes"));
    if (options.given("--transparent")) request.transparent = parse_transparent(options.text("--transparent"));
    if (options.given("--iso")) request.isovalues = parse_isovalues(options.text("--iso"));
    if (options.given("--method")) {
        const std::string method = options.text("--method");
        for (const SurfaceMethod known : {SurfaceMethod::marching_cubes, SurfaceMethod::cubes, SurfaceMethod::smooth, SurfaceMethod::balls})
            if (method == method_name(known)) request.method = known;
        if (!request.method) throw Error(ErrorKind::usage, "--method: expected marching-cubes, cubes, smooth or balls, got '" + method + "'");
    }
    if (options.given("--inside")) {
        const std::string side = options.text("--inside");
        if (side != "above" && side != "below") throw Error(ErrorKind::usage, "--inside: expected above or below, got '" + side + "'");
        request.inside = side == "above" ? ContourInside::above : ContourInside::below;
    }
    if (options.given("--voxel-size")) request.voxel_size = positive(options, "--voxel-size");
    if (options.given("--radius")) request.radius = positive(options, "--radius");
    if (options.given("--viewpoint")) {
        const std::vector<double> place = options.numbers("--viewpoint", 3);
        request.viewpoint = Vec3d(place[0], place[1], place[2]);
    }
    if (options.given("--error")) request.error = parse_error(options);
    else for (const char* const flag : {"--camera", "--size"})
        if (options.given(flag)) throw Error(ErrorKind::usage, std::string(flag) + " is for --error in pixels, such as --error 1px");
    return request;
}

struct Written {
    SurfaceReport surface;
    uint64_t bytes = 0;
    double seconds = 0.0;
};

// Voxels enclose what they fill, although where their materials meet each has vertices of its own. What can be seen through is open there.
bool has_volume(const SurfaceReport& surface, SurfaceMethod method, const SurfaceRequest& request) {
    return surface.triangles + surface.quads > 0 && (surface.is_closed() || (method == SurfaceMethod::cubes && request.transparent.empty()));
}

nlohmann::ordered_json report_json(const std::string& path, const Written& written, const SurfaceInput& input, std::span<const ScalarRanges::Range> scalars, const SurfaceRequest& request) {
    const SurfaceReport& surface = written.surface;
    nlohmann::ordered_json report = {{"output", path}, {"method", method_name(input.method())}, {"vertices", surface.vertices}, {"triangles", surface.triangles}, {"quads", surface.quads}};
    add_surface(surface, has_volume(surface, input.method(), request), report);
    report["bounds"] = box_json(surface.bounds);
    input.add_to(report);
    report["attributes"] = nlohmann::ordered_json::array();
    for (const ScalarRanges::Range& range : scalars) {
        const auto number = [&](float value) { return range.known() ? nlohmann::ordered_json(value) : nlohmann::ordered_json(); };
        report["attributes"].push_back({{"name", range.name}, {"min", number(range.least)}, {"max", number(range.greatest)}, {"unknown", range.unknown}});
    }
    report.update({{"seconds", written.seconds}, {"peak_memory_bytes", peak_memory_bytes()}, {"output_bytes", written.bytes}, {"notes", input.notes}});
    return report;
}

void print_summary(const std::string& path, const Written& written, bool has_volume) {
    const SurfaceReport& surface = written.surface;
    std::string faces = with_commas(surface.triangles) + " triangles";
    if (surface.quads > 0) faces = with_commas(surface.quads) + " quads" + (surface.triangles > 0 ? ", " + faces : "");
    std::fprintf(stderr, "%s: %s, %s vertices, %s, %.1f s\n", path.c_str(), faces.c_str(), with_commas(surface.vertices).c_str(), size_text(written.bytes).c_str(), written.seconds);
    if (surface.triangles + surface.quads == 0) return;
    std::string edges = surface.is_closed() ? "closed" : with_commas(surface.boundary_edges) + " boundary edges";
    if (surface.nonmanifold_edges > 0) edges += ", " + with_commas(surface.nonmanifold_edges) + " edges of more than two faces";
    std::fprintf(stderr, "  %s %s, Euler characteristic %lld, %s, area %.6g", with_commas(surface.components).c_str(), surface.components == 1 ? "component" : "components",
                 static_cast<long long>(surface.euler_characteristic), edges.c_str(), surface.area);
    if (has_volume) std::fprintf(stderr, ", volume %.6g", surface.volume);
    std::fputc('\n', stderr);
}

int run(const Options& options) {
    const std::string path = options.text("--output");
    const bool json = options.given("--json"), quiet = options.given("--quiet") || json, overwrite = options.given("--overwrite");
    if (path.empty()) throw Error(ErrorKind::usage, "surface: --output OUT is expected, a name that ends in .ply, .obj, .stl or .glb");
    if (!is_surface_name(path)) throw Error(ErrorKind::usage, path + ": a name that ends in .ply, .obj, .stl or .glb is expected");
    const std::string folder = fs::absolute(path).parent_path().string();
    SurfaceRequest request = request_of(options, folder);
    check_inputs_spared(path, options.positional);
    check_inputs_spared(path, request.attributes);  // of volumes names of files
    check_output_path(path, overwrite);

    const auto start = std::chrono::steady_clock::now();
    ProgressLine progress(quiet);
    const uint64_t memory = request.memory_bytes;
    const std::unique_ptr<ScratchStore> field_scratch = make_scratch_file(folder), place_scratch = make_scratch_file(folder);
    request.memory_parts = 2;
    request.memory_bytes = memory / request.memory_parts;  // an eighth is for buffers, the rest for places of vertices and what the report counts
    request.scratch = field_scratch.get();
    const std::unique_ptr<SurfaceInput> input = open_surface_input(options.positional, request);
    const bool can_touch = input->method() == SurfaceMethod::cubes && !request.quads;  // itself, along edges
    MeasuredSurface measured(nullptr, place_scratch.get(), memory / 8 * 3, can_touch);
    const std::unique_ptr<SurfaceWriter> writer = make_surface_writer(path, {.overwrite = overwrite, .normals = input->has_normals(), .colors = input->has_colors(), .scalars = input->scalar_names(), .bounds = input->bounds(),
                                                                             .edge = input->edge(), .scratch_folder = folder, .positions = &measured.positions()});
    measured.set_next(writer.get());
    ScalarRanges scalars(measured, input->scalar_names());
    input->extract(scalars, progress);
    for (const ScalarRanges::Range& range : scalars.ranges())
        if (range.is_coarse()) input->notes.push_back("attribute " + range.name + ": its values, about " + value_text(range.greatest) + ", are rounded to " + value_text(range.step()) + ": meshes keep floats");
        else if (!range.known() && range.unknown > 0) input->notes.push_back("attribute " + range.name + ": its value is known nowhere on the surface");
    const Durability durability = options.given("--no-sync") ? Durability::unsynced : Durability::synced;
    Written written = {.surface = measured.report(), .bytes = writer->commit(durability)};
    progress.clear();
    written.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (!writer->keeps_quads()) written.surface.triangles += 2 * std::exchange(written.surface.quads, 0);
    for (const std::string& note : writer->notes()) input->notes.push_back(note);
    if (!quiet) print_notes(input->notes);
    if (json) print_json(report_json(path, written, *input, scalars.ranges(), request));
    else if (!quiet) print_summary(path, written, has_volume(written.surface, input->method(), request));
    return 0;
}

}  // namespace

Command surface_command() {
    return {.name = "surface",
            .summary = "volumes, grids, voxels and points to meshes",
            .positional = "IN...",
            .least_positional = 1,
            .rows = kRows,
            .run = run};
}

}  // namespace strata
