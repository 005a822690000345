// strata convert: scans to level-of-detail data sets.
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/commands/commands.h"
#include "app/commands/spared_inputs.h"
#include "app/cut_options.h"
#include "app/progress.h"
#include "app/quantity_text.h"
#include "core/cloud/selected_source.h"
#include "core/error.h"
#include "core/octree/octree_builder.h"
#include "io/format.h"
#include "io/potree/potree_writer.h"
#include "io/scratch_file.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

constexpr OptionRow kRows[] = {
    {"--format", "-f", "FORMAT", "potree", "format of OUT"},
    {"--encoding", "-e", "default|brotli", "default", "potree: plain records, or smaller and slower"},
    {"--quality", "", "0...11", "2", "effort of the brotli encoding; the user guide has its size and time"},
    {"--bounds", "-b", "BOX", "", "only the points in a box: xmin,ymin,zmin,xmax,ymax,zmax, CRS units; a number left out is no limit; several with ';'"},
    {"--classes", "-c", "LIST", "", "only the points of these classes: 2,6 or 3:5"},
    {"--every", "", "N", "1", "only every N-th point, of those that the others leave"},
    {"--normals", "", "[K]", "16", "compute normals from the K nearest points (3 to 256), as NormalX, NormalY, NormalZ"},
    {"--viewpoint", "", "X,Y,Z", "", "where the scanner stood, CRS units: normals look there; default: upwards"},
    {"--density", "", "", "", "compute the density, points per square unit, from the K nearest points"},
    {"--no-sync", "", "", "", "do not wait until the output is on the disk; a power cut may lose it"},
    shared_option::kMemory,
    shared_option::kThreads,
    shared_option::kOverwrite,
    shared_option::kJson,
    shared_option::kQuiet,
};

// The disk must hold what a build writes beside what is there already.
void check_disk(const std::string& output, const BuildEstimate& estimate) {
    const fs::path parent = fs::absolute(output).parent_path();
    const uint64_t needed = estimate.record_bytes + estimate.temporary_bytes;
    const uint64_t free = free_disk_bytes(parent.string());
    if (needed > free)
        throw Error(ErrorKind::io, output + ": about " + std::to_string(needed >> 20) + " MiB of disk are needed, " +
                                       std::to_string(free >> 20) + " MiB are free");
}

PotreeWriteSettings write_settings(const Options& options) {
    PotreeWriteSettings settings;
    const std::string encoding = options.text("--encoding");
    if (encoding != "default" && encoding != "brotli")
        throw Error(ErrorKind::usage, "--encoding: expected default or brotli, got '" + encoding + "'");
    settings.encoding = encoding == "brotli" ? PotreeEncoding::brotli : PotreeEncoding::plain;
    settings.brotli_quality = int(options.integer("--quality", 0, 11));
    if (options.given("--quality") && encoding != "brotli") throw Error(ErrorKind::usage, "--quality needs --encoding brotli");
    settings.overwrite = options.given("--overwrite");
    settings.durability = options.given("--no-sync") ? Durability::unsynced : Durability::synced;
    return settings;
}

std::optional<SurfaceSettings> surface_settings(const Options& options) {
    SurfaceSettings settings;
    settings.neighbors = uint32_t(options.integer("--normals", kLeastNeighbors, kMostNeighbors));
    settings.normals = options.given("--normals");
    settings.density = options.given("--density");
    if (options.given("--viewpoint")) {
        if (!settings.normals) throw Error(ErrorKind::usage, "--viewpoint needs --normals");
        const std::vector<double> place = options.numbers("--viewpoint", 3);
        settings.viewpoint = Vec3d(place[0], place[1], place[2]);
    }
    if (!settings.normals && !settings.density) return std::nullopt;
    return settings;
}

// What the options ask for, before the cloud is known.
struct WantedPoints {
    std::vector<ClipBox> bounds;
    std::vector<FilterTerm> classes;
    uint64_t every = 1;
};

WantedPoints wanted_points(const Options& options) {
    WantedPoints wanted;
    if (options.given("--bounds")) wanted.bounds = parse_clip_boxes("--bounds", options.text("--bounds"), ClipBox::Action::keep);
    if (options.given("--classes")) wanted.classes = parse_filter("--classes", "class=" + options.text("--classes"));
    wanted.every = uint64_t(options.integer("--every", 1, INT64_MAX));
    return wanted;
}

std::unique_ptr<PointSource> select_points(std::unique_ptr<PointSource> source, const WantedPoints& wanted, int threads) {
    PointSelection selection = {wanted.bounds, PointFilter(source->info(), wanted.classes), wanted.every};
    if (selection.everything()) return source;
    return std::make_unique<SelectedSource>(std::move(source), std::move(selection), threads);
}

uint64_t peak_memory_bytes() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return uint64_t(usage.ru_maxrss) * 1024;
}

int run(const Options& options) {
    if (options.text("--format") != "potree")
        throw Error(ErrorKind::usage, "--format: expected potree, got '" + options.text("--format") + "'");
    const PotreeWriteSettings writing = write_settings(options);
    BuildSettings settings;
    settings.threads = thread_count(options);
    settings.memory_bytes = memory_cap(options);
    settings.surface = surface_settings(options);
    const WantedPoints wanted = wanted_points(options);
    const std::string output = options.positional.back();
    const std::vector<std::string> inputs = point_files(std::span(options.positional).first(options.positional.size() - 1));
    const bool quiet = options.given("--quiet") || options.given("--json");
    check_inputs_spared(output, inputs);
    std::unique_ptr<PointSource> whole = open_points(inputs);
    const auto writer = make_potree_writer(output, writing);  // refuses an output that exists, before points are read
    const std::unique_ptr<PointSource> source = select_points(std::move(whole), wanted, settings.threads);
    const BuildEstimate estimate = estimate_build(source->info(), settings);
    check_disk(output, estimate);
    if (!quiet && estimate.memory_bytes <= settings.memory_bytes)
        std::fprintf(stderr, "%s points: at most %s memory, %s temporary, %s output\n", with_commas(source->info().points).c_str(),
                     size_text(estimate.memory_bytes).c_str(), size_text(estimate.temporary_bytes).c_str(),
                     size_text(estimate.record_bytes).c_str());
    for (const std::string& note : source->info().notes)
        if (!quiet) std::fprintf(stderr, "note: %s\n", note.c_str());
    ProgressLine progress(quiet);
    settings.on_progress = [&](const BuildProgress& p) { progress.update(p.stage, p.done, p.total); };

    const auto start = std::chrono::steady_clock::now();
    const auto scratch = make_scratch_file(fs::absolute(output).parent_path().string());
    const BuildReport report = build_octree(*source, settings, scratch.get(), *writer);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    progress.clear();

    if (options.given("--json")) {
        const nlohmann::ordered_json json = {{"points_read", report.points_read},
                                             {"points_written", report.points_written},
                                             {"points_dropped", report.points_read - report.points_written},
                                             {"nodes", report.nodes},
                                             {"levels", report.levels},
                                             {"seconds", seconds},
                                             {"peak_memory_bytes", peak_memory_bytes()},
                                             {"temporary_bytes", report.temporary_bytes},
                                             {"output_bytes", writer->output_bytes()},
                                             {"worst_rounding", report.worst_rounding},
                                             {"notes", source->info().notes}};
        std::printf("%s\n", json.dump(2).c_str());
    } else if (!quiet) {
        std::fprintf(stderr, "%s: %s points in %s nodes on %d levels, %s, %.1f s", output.c_str(), with_commas(report.points_written).c_str(),
                     with_commas(report.nodes).c_str(), report.levels, size_text(writer->output_bytes()).c_str(), seconds);
        if (seconds >= 0.5) std::fprintf(stderr, " (%.1f M points/s)", double(report.points_written) / seconds / 1e6);
        std::fputc('\n', stderr);
    }
    return 0;
}

}  // namespace

Command convert_command() {
    return {.name = "convert",
            .summary = "scans to level-of-detail data sets",
            .positional = "IN... OUT",
            .least_positional = 2,
            .rows = kRows,
            .run = run};
}

}  // namespace strata
