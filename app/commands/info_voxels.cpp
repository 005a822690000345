#include "app/commands/info_voxels.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "app/commands/info_json.h"
#include "core/voxel/voxel_tree.h"
#include "io/svo/svo_file.h"

namespace strata {

using nlohmann::ordered_json;

namespace {

constexpr uint64_t kBoundsBytes = uint64_t{8} << 20;  // of the levels that bounds are taken from

// The box of the occupied cells of the tree's last level, or of full cells above it.
Box3d occupied_box(const VoxelTree& tree) {
    Box3d box;
    if (tree.empty()) return box;
    struct Node {
        uint32_t index;
        std::array<uint32_t, 3> place;  // in units of its side
    };
    std::vector<Node> nodes = {{0, {0, 0, 0}}}, below;
    for (size_t level = 0; level < tree.levels.size(); ++level) {
        const double side = std::ldexp(1.0, 2 * (tree.frame.levels - 1 - int(level)));  // of a cell, voxels
        const bool last = level + 1 == tree.levels.size();
        below.clear();
        for (const Node& node : nodes) {
            const uint64_t mask = tree.levels[level].masks[node.index], full = tree.levels[level].full_mask(node.index);
            for (uint64_t left = mask; left != 0; left &= left - 1) {
                const int bit = std::countr_zero(left);
                const auto [x, y, z] = coordinates_of_code(uint64_t(bit));
                const std::array<uint32_t, 3> place = {4 * node.place[0] + x, 4 * node.place[1] + y, 4 * node.place[2] + z};
                const Vec3d corner = Vec3d(place[0], place[1], place[2]) * side;
                if (last || (full >> bit & 1) != 0) {
                    box.extend(corner);
                    box.extend(corner + Vec3d::Constant(side));
                } else {
                    below.push_back({tree.levels[level].child(node.index, bit), place});
                }
            }
        }
        nodes.swap(below);
    }
    return {.min = tree.frame.world_from_voxel(box.min), .max = tree.frame.world_from_voxel(box.max)};
}

void add_attribute(ordered_json& report, const char* name, const char* type, int components) {
    report["attributes"].push_back({{"name", name}, {"type", type}, {"components", components}, {"min", nullptr}, {"max", nullptr}});
}

}  // namespace

ordered_json voxel_report(const std::string& path, const Format& format, bool exact, int threads) {
    const SvoFile file = open_svo(path);
    const VoxelFrame& frame = file.frame();
    const bool dag = file.dag() != nullptr;  // then all of it was checked when it was opened
    const int levels = exact && !dag ? frame.levels : file.levels_within(kBoundsBytes, false);
    const VoxelTree tree = file.load(levels, exact, threads);
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
                           {"bounds", box_json(occupied_box(tree))},
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
