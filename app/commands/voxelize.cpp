// strata voxelize: meshes and points to sparse voxel octrees.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/commands/spared_inputs.h"
#include "app/commands/voxel_input.h"
#include "app/peak_memory.h"
#include "app/quantity_text.h"
#include "core/error.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/scratch_file.h"
#include "io/svo/svo_writer.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMostResolution = int64_t{1} << 2 * kMostVoxelLevels;

constexpr OptionRow kRows[] = {
    {"--output", "-o", "OUT.svo", "", "the voxel file to write"},
    {"--resolution", "-r", "N", "1024", "voxels along the longest side, 1 to 1048576"},
    {"--voxel-size", "-s", "UNITS", "", "side of a voxel, CRS units, instead of --resolution; faces of voxels lie on its multiples"},
    {"--kind", "-k", "KIND", "", "of a mesh: conservative (each voxel that the surface touches; the default), thin (a layer that no path through faces of voxels crosses); points: voxels that hold points"},
    {"--attributes", "-a", "LIST", "", "what voxels know beside: color, normal, count (of points), opacity (of coarser cells, for shadows and cones), or none, with commas; default: the color that points have"},
    {"--no-sync", "", "", "", "do not wait until the output is on the disk; a power cut may lose it"},
    shared_option::kMemory,
    shared_option::kThreads,
    shared_option::kOverwrite,
    shared_option::kJson,
    shared_option::kQuiet,
};

VoxelAttributes parse_attributes(const std::string& text) {
    VoxelAttributes attributes;
    for (size_t begin = 0; begin <= text.size();) {
        const size_t end = std::min(text.find(',', begin), text.size());
        const std::string name = text.substr(begin, end - begin);
        if (name == "color") attributes.color = true;
        else if (name == "normal") attributes.normal = true;
        else if (name == "count") attributes.count = true;
        else if (name == "opacity") attributes.opacity = true;
        else if (name != "none" || text != "none")
            throw Error(ErrorKind::usage, "--attributes: expected color, normal, count, opacity or none, with commas, got '" + name + "'");
        begin = end + 1;
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
    return request;
}

void check_disk(const std::string& output, const std::string& folder, uint64_t needed) {
    const uint64_t free = needed > 0 ? free_disk_bytes(folder) : 0;
    if (needed > free)
        throw Error(ErrorKind::io, output + ": about " + size_text(needed) + " of disk are needed, " + size_text(free) + " are free");
}

struct Written {
    VoxelTreeCounts counts;
    uint64_t bytes = 0;
};

Written write_voxels(const std::string& output, const Options& options, VoxelInput& input, ProgressLine& progress) {
    for (bool again = false;; again = true) {
        SvoWriter writer(output, options.given("--overwrite"), input.frame(), {input.kind(), input.crs()});
        VoxelTreeBuilder builder(input.frame(), input.attributes(), writer);
        if (!input.voxelize([&](const VoxelBatch& batch) { builder.add(batch); }, progress)) {
            if (again) throw Error(ErrorKind::malformed, "points lie outside of their own bounds");
            continue;
        }
        Written written = {.counts = builder.finish()};
        if (written.counts.voxels == 0) input.notes.push_back("there are no voxels: nothing lies inside");
        written.bytes = writer.commit(written.counts.voxels, options.given("--no-sync") ? Durability::unsynced : Durability::synced);
        return written;
    }
}

int run(const Options& options) {
    const std::string output = options.text("--output");
    if (output.empty()) throw Error(ErrorKind::usage, "voxelize: --output OUT.svo is expected");
    if (!output.ends_with(".svo")) throw Error(ErrorKind::usage, output + ": a name that ends in .svo is expected");
    const bool json = options.given("--json"), quiet = options.given("--quiet") || json;
    const VoxelRequest request = request_of(options, output);
    check_inputs_spared(output, options.positional);
    check_output_path(output, options.given("--overwrite"));

    const auto start = std::chrono::steady_clock::now();
    ProgressLine progress(quiet);
    const std::unique_ptr<VoxelInput> input = open_voxel_input(options.positional, request);
    check_disk(output, request.scratch_folder, input->estimated_bytes());
    const auto [counts, bytes] = write_voxels(output, options, *input, progress);
    progress.clear();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    for (const std::string& note : input->notes)
        if (!quiet) std::fprintf(stderr, "note: %s\n", note.c_str());

    uint64_t nodes = 0;
    for (const uint64_t level : counts.nodes) nodes += level;
    const VoxelFrame& frame = input->frame();
    if (json) {
        const nlohmann::ordered_json report = {{"voxels", counts.voxels},
                                               {"nodes", nodes},
                                               {"levels", frame.levels},
                                               {"kind", input->kind()},
                                               {"voxel_size", frame.voxel_size},
                                               {"origin", {frame.origin.x(), frame.origin.y(), frame.origin.z()}},
                                               {"points_read", input->points_read},
                                               {"seconds", seconds},
                                               {"peak_memory_bytes", peak_memory_bytes()},
                                               {"temporary_bytes", input->scratch_bytes},
                                               {"output_bytes", bytes},
                                               {"notes", input->notes}};
        std::printf("%s\n", report.dump(2).c_str());
    } else if (!quiet) {
        std::fprintf(stderr, "%s: %s voxels of %.6g, %s", output.c_str(), with_commas(counts.voxels).c_str(), frame.voxel_size, size_text(bytes).c_str());
        if (counts.voxels > 0) std::fprintf(stderr, " (%.3g bytes a voxel)", double(bytes) / double(counts.voxels));
        std::fprintf(stderr, ", %.1f s", seconds);
        if (seconds >= 0.5) std::fprintf(stderr, " (%.1f M voxels/s)", double(counts.voxels) / seconds / 1e6);
        std::fputc('\n', stderr);
    }
    return 0;
}

}  // namespace

Command voxelize_command() {
    return {.name = "voxelize",
            .summary = "meshes and points to sparse voxel octrees",
            .positional = "IN...",
            .least_positional = 1,
            .rows = kRows,
            .run = run};
}

}  // namespace strata
