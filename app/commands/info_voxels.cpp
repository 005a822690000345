#include "app/commands/info_voxels.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "app/commands/info_json.h"
#include "core/voxel/voxel_bounds.h"
#include "io/svo/svo_file.h"

namespace strata {

using nlohmann::ordered_json;

namespace {

constexpr uint64_t kBoundsBytes = uint64_t{64} << 20;  // of the levels that bounds are taken from

void add_attribute(ordered_json& report, const char* name, const char* type, int components) {
    report["attributes"].push_back({{"name", name}, {"type", type}, {"components", components}, {"min", nullptr}, {"max", nullptr}});
}

}  // namespace

ordered_json voxel_report(const std::string& path, const Format& format, bool exact, uint64_t memory_bytes, int threads) {
    const SvoFile file = open_svo(path);
    const VoxelFrame& frame = file.frame();
    const bool dag = file.dag() != nullptr;
    const int levels = file.levels_within(exact ? memory_bytes : std::min(memory_bytes, kBoundsBytes), exact);
    const VoxelTree tree = file.load(levels, exact, threads);
    if (exact) file.verify(threads);
    uint64_t nodes = 0;
    ordered_json rows = ordered_json::array();
    for (int level = 0; level < frame.levels; ++level) {
        nodes += file.nodes(level);
        rows.push_back({{"level", level}, {"depth", 2 * level}, {"cell_size", frame.voxel_size * std::ldexp(1.0, 2 * (frame.levels - level))},
                        {"nodes", file.nodes(level)}, {"occupancy", double(file.nodes(level)) / std::ldexp(1.0, 6 * level)}});
    }
    ordered_json report = {{"path", path},
                           {"format", format.name},
                           {"detail", "strata voxels, version 1" + (file.labels().kind.empty() ? "" : ": " + file.labels().kind) + (dag ? ", as a DAG" : "")},
                           {"voxels", file.voxels()},
                           {"nodes", nodes},
                           {"layout", dag ? "dag" : "tree"},
                           {"bytes", file.size_bytes()},
                           {"bytes_per_voxel", file.voxels() > 0 ? ordered_json(double(file.size_bytes()) / double(file.voxels())) : ordered_json()},
                           {"levels", frame.levels},
                           {"kind", file.labels().kind},
                           {"voxel_size", frame.voxel_size},
                           {"origin", vector_json(frame.origin)},
                           {"side", frame.side()},
                           {"occupancy", double(file.voxels()) / std::ldexp(1.0, 6 * frame.levels)},
                           {"bounds", box_json(occupied_bounds(tree))},
                           {"bounds_within", frame.voxel_size * std::ldexp(1.0, 2 * (frame.levels - levels))},
                           {"crs", file.labels().crs.empty() ? ordered_json() : ordered_json(file.labels().crs)},
                           {"level_table", rows},
                           {"attributes", ordered_json::array()}};
    const VoxelAttributes attributes = file.attributes();
    if (attributes.color) add_attribute(report, "color", "uint8", 3);
    if (attributes.normal) add_attribute(report, "normal", "int8", 3);
    if (attributes.count) add_attribute(report, "count", "uint32", 1);
    if (attributes.opacity) add_attribute(report, "opacity", "uint8", 3);
    if (dag) {
        uint64_t different = 0;
        for (const DagLevel& level : file.dag()->levels) different += level.masks.size();
        report["dag_nodes"] = different;
    }
    if (exact) report["valid"] = true;  // else loading has thrown
    return report;
}

}  // namespace strata
