// strata voxelize: meshes, points and grids to sparse voxel octrees and OpenVDB files.
#include <bit>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "app/commands/command_report.h"
#include "app/commands/commands.h"
#include "app/commands/spared_inputs.h"
#include "app/commands/voxel_input.h"
#include "app/commands/voxel_output.h"
#include "app/peak_memory.h"
#include "app/quantity_text.h"
#include "core/error.h"
#include "io/scratch_file.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMostResolution = int64_t{1} << 2 * kMostVoxelLevels;

constexpr OptionRow kRows[] = {
    {"--output", "-o", "OUT", "", "the file to write: .svo, an octree, or .vdb, a grid of OpenVDB"},
    {"--resolution", "-r", "N", "1024", "voxels along the longest side, 1 to 1048576"},
    {"--voxel-size", "-s", "UNITS", "", "side of a voxel, CRS units, instead of --resolution; faces of voxels lie on its multiples"},
    {"--kind", "-k", "KIND", "", "of a mesh: conservative (each voxel that the surface touches; the default), thin (a layer that no path through faces of voxels crosses), solid (voxels whose center is inside), level-set (OpenVDB's signed distance, whose inside is occupied); of points: points (voxels that hold some)"},
    {"--dag", "", "", "", "store identical subtrees once: what is occupied, in a fraction of the bytes; needs memory for the whole tree"},
    {"--attributes", "-a", "LIST", "", "what voxels know beside: color, normal, count (of points), opacity (of coarser cells, for shadows and cones), or none, with commas; default: the color that points or vertices have, and none with --dag"},
    {"--grid", "", "NAME", "", "of a .vdb file: the grid of that name; default: the first that can be read"},
    {"--isovalue", "", "V", "0", "of a .vdb file: a level set is occupied where it is at most V, a fog volume where it is active and above V"},
    {"--no-sync", "", "", "", "do not wait until the output is on the disk; a power cut may lose it"},
    shared_option::kMemory,
    shared_option::kThreads,
    shared_option::kOverwrite,
    shared_option::kJson,
    shared_option::kQuiet,
};

VoxelAttributes parse_attributes(const std::string& text) {
    VoxelAttributes attributes;
    for (const std::string& name : split_list(text)) {
        if (name == "color") attributes.color = true;
        else if (name == "normal") attributes.normal = true;
        else if (name == "count") attributes.count = true;
        else if (name == "opacity") attributes.opacity = true;
        else if (name != "none" || text != "none")
            throw Error(ErrorKind::usage, "--attributes: expected color, normal, count, opacity or none, with commas, got '" + name + "'");
    }
    return attributes;
}

VoxelRequest request_of(const Options& options, const std::string& output) {
    VoxelRequest request = {.kind = options.text("--kind"),
                            .scratch_folder = fs::absolute(output).parent_path().string(),
                            .threads = thread_count(options),
                            .memory_bytes = memory_cap(options)};
    if (options.given("--resolution") && options.given("--voxel-size")) throw Error(ErrorKind::usage, "--resolution and --voxel-size: one of them is expected");
    if (options.given("--voxel-size")) {
        request.voxel_size = options.number("--voxel-size");
        if (!(request.voxel_size > 0.0)) throw Error(ErrorKind::usage, "--voxel-size: expected a positive number, got '" + options.text("--voxel-size") + "'");
    } else {
        request.resolution = uint32_t(options.integer("--resolution", 1, kMostResolution));
    }
    if (options.given("--attributes")) request.attributes = parse_attributes(options.text("--attributes"));
    else if (options.given("--dag")) request.attributes = VoxelAttributes{};
    for (const char* const flag : {"--resolution", "--voxel-size", "--kind", "--attributes"})
        if (options.given(flag)) request.not_for_grids = flag;
    for (const char* const flag : {"--grid", "--isovalue"})
        if (options.given(flag)) request.for_grids = flag;
    request.grid = options.text("--grid");
    if (options.given("--isovalue")) request.isovalue = options.number("--isovalue");
    return request;
}

void check_disk(const std::string& output, uint64_t needed) {
    const uint64_t free = needed > 0 ? free_disk_bytes(fs::absolute(output).parent_path().string()) : 0;
    if (needed > free)
        throw Error(ErrorKind::io, output + ": about " + size_text(needed) + " of disk are needed, " + size_text(free) + " are free");
}

VoxelOutputReport write_own_grid(const VoxelOutputRequest& request, VoxelInput& input, ProgressLine& progress) {
    VoxelOutputReport report;
    input.voxelize([&](const VoxelBatch& batch) {
        for (const VoxelBlock& block : batch.blocks) report.voxels += uint64_t(std::popcount(block.mask)) << 6 * block.height;
    }, progress);
    report.bytes = input.write_own_grid(request.path, request.overwrite, request.durability);
    return report;
}

VoxelOutputReport write_voxels(const VoxelOutputRequest& request, VoxelInput& input, ProgressLine& progress) {
    if (request.path.ends_with(".vdb") && input.has_own_grid()) return write_own_grid(request, input, progress);
    for (bool again = false;; again = true) {
        const std::unique_ptr<VoxelOutput> output = make_voxel_output(request, input.frame(), input.attributes(), {input.kind(), input.crs()});
        check_disk(request.path, output->estimated_bytes(input.estimated_bytes()));
        if (input.voxelize([&](const VoxelBatch& batch) { output->add(batch); }, progress)) return output->commit();
        if (again) throw Error(ErrorKind::malformed, "points lie outside of their own bounds");
    }
}

nlohmann::ordered_json report_json(const std::string& path, const VoxelOutputReport& written, const VoxelInput& input, double seconds) {
    const VoxelFrame& frame = input.frame();
    nlohmann::ordered_json report = {{"output", path}, {"voxels", written.voxels}, {"nodes", written.nodes}, {"levels", frame.levels}, {"kind", input.kind()}};
    if (written.dag_nodes > 0) report["dag_nodes"] = written.dag_nodes;
    report.update({{"voxel_size", frame.voxel_size},
                   {"origin", {frame.origin.x(), frame.origin.y(), frame.origin.z()}},
                   {"points_read", input.points_read},
                   {"seconds", seconds},
                   {"peak_memory_bytes", peak_memory_bytes()},
                   {"temporary_bytes", input.scratch_bytes},
                   {"output_bytes", written.bytes},
                   {"notes", input.notes}});
    return report;
}

void print_summary(const std::string& path, const VoxelOutputReport& written, double voxel_size, double seconds) {
    std::fprintf(stderr, "%s: %s voxels of %.6g, %s", path.c_str(), with_commas(written.voxels).c_str(), voxel_size, size_text(written.bytes).c_str());
    if (written.voxels > 0) std::fprintf(stderr, " (%.3g bytes a voxel)", double(written.bytes) / double(written.voxels));
    if (written.dag_nodes > 0) std::fprintf(stderr, ", %s nodes of %s differ", with_commas(written.dag_nodes).c_str(), with_commas(written.nodes).c_str());
    std::fprintf(stderr, ", %.1f s", seconds);
    if (seconds >= 0.5) std::fprintf(stderr, " (%.1f M voxels/s)", double(written.voxels) / seconds / 1e6);
    std::fputc('\n', stderr);
}

int run(const Options& options) {
    const VoxelOutputRequest output = voxel_output_request(options);
    const bool json = options.given("--json"), quiet = options.given("--quiet") || json;
    const VoxelRequest request = request_of(options, output.path);
    check_inputs_spared(output.path, options.positional);
    check_output_path(output.path, output.overwrite);

    const auto start = std::chrono::steady_clock::now();
    ProgressLine progress(quiet);
    const std::unique_ptr<VoxelInput> input = open_voxel_input(options.positional, request);
    const VoxelOutputReport written = write_voxels(output, *input, progress);
    progress.clear();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (written.voxels == 0) input->notes.push_back("there are no voxels");
    if (!quiet) print_notes(input->notes);
    if (json) print_json(report_json(output.path, written, *input, seconds));
    else if (!quiet) print_summary(output.path, written, input->frame().voxel_size, seconds);
    return 0;
}

}  // namespace

Command voxelize_command() {
    return {.name = "voxelize",
            .summary = "meshes, points and grids to sparse voxel octrees",
            .positional = "IN...",
            .least_positional = 1,
            .rows = kRows,
            .run = run};
}

}  // namespace strata
