// strata info: one report as JSON; its text is the same report laid out for people.
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/commands/commands.h"
#include "app/commands/info_json.h"
#include "app/commands/info_mesh.h"
#include "app/commands/info_text.h"
#include "app/commands/info_vdb.h"
#include "app/commands/info_volume.h"
#include "app/commands/info_voxels.h"
#include "app/quantity_text.h"
#include "core/cloud/cloud_statistics.h"
#include "core/error.h"
#include "core/octree/layered_points.h"
#include "core/octree/layered_validation.h"
#include "core/octree/sampling_quality.h"
#include "io/crs/crs_text.h"
#include "io/format.h"
#include "io/las/laz_source.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

constexpr OptionRow kRows[] = {
    {"--exact", "-x", "", "", "read every point: true bounds and ranges, counts by return and class; says where the header lies. An LOD set's hierarchy is always validated, with --exact each point too. Of a mesh: what its surface is like"},
    {"--quality", "", "", "", "of an LOD set: how evenly each level is sampled"},
    shared_option::kJson,
    shared_option::kThreads,
    shared_option::kMemory,
};

// What every format says of itself.
ordered_json cloud_json(const std::string& path, const Format& format, const CloudInfo& info) {
    ordered_json report = {{"path", path}, {"format", format.name}, {"detail", info.format}, {"points", info.points},
                           {"bounds", box_json(info.points > 0 ? info.bounds : Box3d{})}, {"scale", vector_json(info.quantization.scale)},
                           {"offset", vector_json(info.quantization.offset)}, {"crs", nullptr}};
    if (!info.crs.empty()) report["crs"] = info.crs;
    if (const std::optional<CrsDescription> crs = describe_crs(info.crs)) {
        const auto or_null = [](const std::string& text) { return text.empty() ? ordered_json() : ordered_json(text); };
        report["crs_name"] = crs->name;
        report["crs_id"] = or_null(crs->id);
        report["unit"] = or_null(crs->unit);
        report["vertical_unit"] = or_null(crs->vertical_unit);
    }
    report["attributes"] = ordered_json::array();
    for (const Attribute& attribute : info.attributes) {
        ordered_json entry = {{"name", attribute.name}, {"type", scalar_name(attribute.type)}, {"components", attribute.components},
                              {"min", nullptr}, {"max", nullptr}};
        if (!attribute.description.empty()) entry["description"] = attribute.description;
        report["attributes"].push_back(std::move(entry));
    }
    if (!info.notes.empty()) report["notes"] = info.notes;
    return report;
}

ordered_json counts_json(std::span<const uint64_t> counts) {
    ordered_json json = ordered_json::object();
    for (size_t i = 0; i < counts.size(); ++i)
        if (counts[i] > 0) json[std::to_string(i)] = counts[i];
    return json;
}

void range_json(const std::vector<ValueRange>& ranges, ordered_json& entry) {
    ordered_json low = ordered_json::array(), high = ordered_json::array();
    for (const ValueRange& range : ranges) {
        low.push_back(range.empty() ? ordered_json() : ordered_json(range.min));
        high.push_back(range.empty() ? ordered_json() : ordered_json(range.max));
    }
    entry["min"] = ranges.size() == 1 ? low[0] : low;
    entry["max"] = ranges.size() == 1 ? high[0] : high;
}

std::vector<std::string> header_lies(const PointSource& source, const CloudStatistics& truth) {
    std::vector<std::string> lies;
    const CloudInfo& info = source.info();
    for (int axis = 0; axis < 3 && truth.points > 0; ++axis) {
        const double step = info.quantization.scale[axis] * (1.0 + 1e-6);  // a header may be rounded to the scale
        for (const bool low : {true, false}) {
            const double stated = low ? info.bounds.min[axis] : info.bounds.max[axis];
            const double found = low ? truth.bounds.min[axis] : truth.bounds.max[axis];
            if (std::abs(stated - found) <= step) continue;
            char line[160];
            std::snprintf(line, sizeof line, "the header's %s %c is %.10g, that of the points %.10g", low ? "least" : "greatest", "xyz"[axis],
                          stated, found);
            lies.push_back(line);
        }
    }
    const las::Header* const header = header_of(source);
    for (size_t i = 0; header && i < header->points_by_return.size(); ++i)
        if (const uint64_t stated = header->points_by_return[i]; stated != truth.points_by_return[i + 1])
            lies.push_back("the header counts " + with_commas(stated) + " points of return " + std::to_string(i + 1) + ", there are " +
                           with_commas(truth.points_by_return[i + 1]));
    return lies;
}

void add_exact(const PointSource& source, int threads, ordered_json& report) {
    const CloudStatistics truth = measure_cloud(source, threads);
    report["bounds"] = box_json(truth.bounds);
    report["header_bounds"] = box_json(source.info().bounds);
    for (size_t a = 0; a < truth.ranges.size(); ++a) range_json(truth.ranges[a], report["attributes"][a]);
    if (find_attribute(source.info().attributes, attribute_name::kRgb) >= 0) report["rgb_bits"] = truth.rgb_bits;
    report["points_by_return"] = counts_json(truth.points_by_return);
    report["points_by_class"] = counts_json(truth.points_by_class);
    if (const std::vector<std::string> lies = header_lies(source, truth); !lies.empty()) report["warnings"] = lies;
}

ordered_json points_report(const std::string& path, const Format& format, const Options& options) {
    const std::unique_ptr<PointSource> source = open_points({&path, 1});
    ordered_json report = cloud_json(path, format, source->info());
    if (options.given("--exact")) add_exact(*source, thread_count(options), report);
    return report;
}

ordered_json sampling_json(LayeredCloud& cloud, int threads) {
    ordered_json levels = ordered_json::array();
    for (const LevelSampling& level : measure_sampling(cloud, {.threads = threads}))
        levels.push_back({{"level", level.level}, {"spacing", level.spacing}, {"inner_nodes", level.inner_nodes},
                          {"measured_nodes", level.measured_nodes}, {"kept_points", level.kept_points},
                          {"removed_points", level.removed_points}, {"removed_total", level.removed_total},
                          {"reach", level.reach}, {"neighbor_min", level.neighbor_min}, {"neighbor_p5", level.neighbor_p5},
                          {"neighbor_median", level.neighbor_median}, {"coverage_p99", level.coverage_p99},
                          {"coverage_max", level.coverage_max}});
    return levels;
}

// A set is always validated: the hierarchy by itself, and with --exact every point as well.
ordered_json layered_report(const std::string& path, const Format& format, const Options& options) {
    const std::unique_ptr<LayeredCloud> cloud = open_layered(path);
    const int threads = thread_count(options);
    const bool exact = options.given("--exact");
    const LayeredSummary summary = validate_layered(*cloud, {.name = path, .read_points = exact, .threads = threads});
    const CloudInfo& info = cloud->info();
    ordered_json report = cloud_json(path, format, info);
    for (size_t a = 0; a < info.attribute_min.size(); ++a) {
        if (info.attribute_min[a].empty() || info.attribute_max[a].empty()) continue;
        const bool one = info.attributes[a].components == 1;
        report["attributes"][a]["min"] = one ? ordered_json(info.attribute_min[a][0]) : ordered_json(info.attribute_min[a]);
        report["attributes"][a]["max"] = one ? ordered_json(info.attribute_max[a][0]) : ordered_json(info.attribute_max[a]);
    }
    report["nodes"] = summary.nodes;
    report["levels"] = summary.points_per_level.size();
    report["spacing"] = cloud->node_count() > 0 ? cloud->node(cloud->root()).spacing : 0.0;
    report["points_per_level"] = summary.points_per_level;
    report["valid"] = true;
    report["validated"] = exact ? "every point" : "hierarchy";
    if (exact) add_exact(LayeredPoints(*cloud), threads, report);
    if (options.given("--quality")) report["sampling"] = sampling_json(*cloud, threads);
    return report;
}

void print(const std::string& text) {
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
        throw Error(ErrorKind::io, std::string("standard output: ") + std::strerror(errno));
}

int run(const Options& options) {
    const std::string& path = options.positional.front();
    const Format& format = identify_format(path);
    if (options.given("--quality") && format.kind != FormatKind::layered && format.kind != FormatKind::not_readable)
        throw Error(ErrorKind::usage, "--quality: a level-of-detail data set is expected, " + path + " is " + std::string(format.name));
    const ordered_json report = format.kind == FormatKind::layered ? layered_report(path, format, options)
                                : format.kind == FormatKind::mesh  ? mesh_report(path, format, options.given("--exact"), memory_cap(options))
                                : format.kind == FormatKind::grids ? vdb_report(path, format)
                                : format.kind == FormatKind::volume ? volume_report(path, format)
                                : format.kind == FormatKind::voxels ? voxel_report(path, format, options.given("--exact"), memory_cap(options), thread_count(options))
                                                                   : points_report(path, format, options);
    // Names and texts from a file may be of any encoding; JSON is UTF-8.
    const std::string text = report.dump(2, ' ', false, ordered_json::error_handler_t::replace);
    print(options.given("--json") ? text + "\n" : info_text(text));
    return 0;
}

}  // namespace

Command info_command() {
    return {.name = "info", .summary = "what a file or data set is, and whether it is whole", .positional = "PATH",
            .least_positional = 1, .most_positional = 1, .rows = kRows, .run = run};
}

}  // namespace strata
