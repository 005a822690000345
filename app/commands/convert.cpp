// strata convert: scans to level-of-detail data sets and other files. What is common to all outputs; each kind has a file beside.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/commands/commands.h"
#include "app/commands/convert_output.h"
#include "app/commands/spared_inputs.h"
#include "app/cut_options.h"
#include "app/peak_memory.h"
#include "app/quantity_text.h"
#include "core/cloud/salvaged_source.h"
#include "core/cloud/selected_source.h"
#include "core/error.h"
#include "core/octree/octree_frame.h"
#include "io/crs/crs_text.h"
#include "io/crs/reprojected_source.h"
#include "io/format.h"

namespace strata {
namespace {

constexpr OptionRow kRows[] = {
    {"--format", "-f", "FORMAT", "", "format of OUT: potree, copc, las, laz or drc; default: what the ending of OUT says, else potree"},
    {"--encoding", "-e", "default|brotli", "default", "potree: plain records, or smaller and slower"},
    {"--quality", "", "0...11", "2", "effort of the brotli encoding; the user guide has its size and time"},
    {"--max-error", "", "UNITS", "", "drc: how far a coordinate may move, CRS units; default: half of the source's quantum, so that strata reads its integers back; where Draco has no room for that, what it has, with a note"},
    {"--bounds", "-b", "BOX", "", "only the points in a box: xmin,ymin,zmin,xmax,ymax,zmax, CRS units; a number left out is no limit; several with ';'"},
    {"--classes", "-c", "LIST", "", "only the points of these classes: 2,6 or 3:5"},
    {"--every", "", "N", "1", "only every N-th point, of those that the others leave"},
    {"--level", "", "N", "", "of level-of-detail sets (COPC, Potree): only the nodes down to level N; the root's is 0"},
    {"--salvage", "", "", "", "read what can be read of damaged LAS and LAZ files and Draco blocks: damage costs the part that it lies in, and notes say which"},
    {"--in-crs", "", "CRS", "", "the coordinate reference system that the files are in, where they do not say or say wrong: EPSG:n, EPSG:n+m with heights, WKT or a PROJ string"},
    {"--out-crs", "", "CRS", "", "transform the points to this coordinate reference system; --bounds is in the coordinates of the input, --viewpoint in those of the output"},
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

// What the options ask for, before the cloud is known.
struct WantedPoints {
    std::vector<ClipBox> bounds;
    std::vector<FilterTerm> classes;
    uint64_t every = 1;
    std::optional<uint32_t> deepest_level;
};

WantedPoints wanted_points(const Options& options) {
    WantedPoints wanted;
    if (options.given("--bounds")) wanted.bounds = parse_clip_boxes("--bounds", options.text("--bounds"), ClipBox::Action::keep);
    if (options.given("--classes")) wanted.classes = parse_filter("--classes", "class=" + options.text("--classes"));
    wanted.every = uint64_t(options.integer("--every", 1, INT64_MAX));
    if (options.given("--level")) wanted.deepest_level = uint32_t(options.integer("--level", 0, kMaxLevel));
    return wanted;
}

std::unique_ptr<PointSource> select_points(std::unique_ptr<PointSource> source, const WantedPoints& wanted, int threads) {
    PointSelection selection = {wanted.bounds, PointFilter(source->info(), wanted.classes), wanted.every};
    if (selection.everything()) return source;
    return std::make_unique<SelectedSource>(std::move(source), std::move(selection), threads);
}

// The systems of --in-crs and --out-crs; empty: as the files say, and no other.
struct WantedSystems {
    std::string in, out;
};

WantedSystems wanted_systems(const Options& options) {
    const auto system_of = [&](const char* flag) {
        const std::string text = options.text(flag);
        try {
            if (options.given(flag)) check_crs(text);
        } catch (const Error& error) {
            throw error.within(flag);
        }
        return text;
    };
    return {system_of("--in-crs"), system_of("--out-crs")};
}

struct Opened {
    std::unique_ptr<PointSource> source;
    uint64_t lost_points = 0;  // that damaged files state and do not have
};

Opened open_wanted(std::span<const std::string> inputs, const WantedPoints& wanted, const WantedSystems& systems, bool salvage, int threads) {
    size_t file = 0;
    Opened opened;
    WantedPoints of_file = wanted, of_all = wanted;
    of_file.every = 1;
    if (!systems.out.empty()) of_all = {.bounds = {}, .classes = {}, .every = wanted.every, .deepest_level = {}};
    // Each file is brought to the new system by itself, so that files may be in several; boxes are in its own.
    const auto in_system = [&](std::unique_ptr<PointSource> source) {
        const std::string& name = inputs[file++];
        if (const auto* const salvaged = dynamic_cast<const SalvagedSource*>(source.get())) opened.lost_points += salvaged->lost_points();
        if (!systems.in.empty()) source = with_crs(std::move(source), systems.in);
        if (systems.out.empty()) return source;
        return reproject_points(select_points(std::move(source), of_file, threads), systems.out, name, threads);
    };
    OpenSettings settings = {.wrap = in_system, .nodes = {.clips = wanted.bounds}, .salvage = salvage, .threads = threads};
    if (wanted.deepest_level) settings.nodes.deepest_level = *wanted.deepest_level;
    opened.source = select_points(open_points(inputs, settings), of_all, threads);
    return opened;
}

// The formats that convert writes, and what makes each.
struct Kind {
    std::string_view format;
    std::unique_ptr<ConvertOutput> (*make)(const ConvertRequest&, const Options&);
};
constexpr std::array kKinds = {Kind{"potree", make_lod_output}, Kind{"copc", make_lod_output}, Kind{"drc", make_draco_output}, Kind{"las", make_las_output}, Kind{"laz", make_las_output}};

const Kind& kind_of(const Options& options) {
    const std::string format = options.given("--format") ? options.text("--format") : std::string(format_of_name(options.positional.back()));
    const auto kind = std::find_if(kKinds.begin(), kKinds.end(), [&](const Kind& k) { return k.format == format; });
    if (kind != kKinds.end()) return *kind;
    std::string names;
    for (const Kind& known : kKinds) names += (names.empty() ? "" : ", ") + std::string(known.format);
    if (options.given("--format")) throw Error(ErrorKind::usage, "--format: expected " + names + ", got '" + format + "'");
    throw Error(ErrorKind::usage, options.positional.back() + ": convert does not write " + format + "; --format knows " + names);
}

ConvertRequest request_of(const Options& options, const Kind& kind) {
    return {.output = options.positional.back(),
            .format = std::string(kind.format),
            .overwrite = options.given("--overwrite"),
            .durability = options.given("--no-sync") ? Durability::unsynced : Durability::synced,
            .threads = thread_count(options),
            .memory_bytes = memory_cap(options),
            .quiet = options.given("--quiet") || options.given("--json")};
}

int convert(const Options& options) {
    const Kind& kind = kind_of(options);
    if (options.given("--max-error") && kind.format != "drc") throw Error(ErrorKind::usage, "--max-error is for drc, the output is " + std::string(kind.format));
    const ConvertRequest request = request_of(options, kind);
    const WantedPoints wanted = wanted_points(options);
    const WantedSystems systems = wanted_systems(options);
    const std::vector<std::string> inputs = point_files(std::span(options.positional).first(options.positional.size() - 1));
    check_inputs_spared(request.output, inputs);
    const std::unique_ptr<ConvertOutput> output = kind.make(request, options);
    const Opened opened = open_wanted(inputs, wanted, systems, options.given("--salvage"), request.threads);
    const std::unique_ptr<PointSource>& source = opened.source;
    for (const std::string& note : source->info().notes)
        if (!request.quiet) std::fprintf(stderr, "note: %s\n", note.c_str());

    const auto start = std::chrono::steady_clock::now();
    ProgressLine progress(request.quiet);
    nlohmann::ordered_json more = nlohmann::ordered_json::object();  // made here: without memory, a null that turns into one crashes as it goes
    ConvertReport report = output->write(*source, progress, more);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    progress.clear();
    std::vector<std::string> notes = source->info().notes;
    if (report.points_written == 0) report.notes.push_back("the output has no points");
    notes.insert(notes.end(), report.notes.begin(), report.notes.end());
    for (const std::string& note : report.notes)
        if (!request.quiet) std::fprintf(stderr, "note: %s\n", note.c_str());

    if (options.given("--json")) {
        nlohmann::ordered_json json = {{"points_read", report.points_read},
                                       {"points_written", report.points_written},
                                       {"points_dropped", report.points_read - report.points_written + opened.lost_points}};
        json.update(more);
        json.update({{"seconds", seconds},
                     {"peak_memory_bytes", peak_memory_bytes()},
                     {"temporary_bytes", report.temporary_bytes},
                     {"output_bytes", report.output_bytes},
                     {"worst_rounding", report.worst_rounding},
                     {"notes", notes}});
        std::printf("%s\n", json.dump(2).c_str());
    } else if (!request.quiet) {
        std::fprintf(stderr, "%s: %s points%s%s, %s, %.1f s", request.output.c_str(), with_commas(report.points_written).c_str(),
                     report.shape.empty() ? "" : " ", report.shape.c_str(), size_text(report.output_bytes).c_str(), seconds);
        if (seconds >= 0.5) std::fprintf(stderr, " (%.1f M points/s)", double(report.points_written) / seconds / 1e6);
        if (opened.lost_points > 0) std::fprintf(stderr, "; %s points are lost", with_commas(opened.lost_points).c_str());
        std::fputc('\n', stderr);
    }
    return 0;
}

int run(const Options& options) {
    try {
        return convert(options);
    } catch (const Error& error) {
        if (error.kind != ErrorKind::malformed || options.given("--salvage")) throw;
        throw Error(error.kind, std::string(error.what()) + "; --salvage may read the rest");
    }
}

}  // namespace

Command convert_command() {
    return {.name = "convert",
            .summary = "scans to level-of-detail data sets and plain files",
            .positional = "IN... OUT",
            .least_positional = 2,
            .rows = kRows,
            .run = run};
}

}  // namespace strata
