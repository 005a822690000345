#include "app/commands/info_vdb.h"

#include <nlohmann/json.hpp>

#include "app/commands/info_json.h"
#include "io/vdb/vdb_voxels.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

ordered_json index_json(const std::optional<Vec3i>& index) {
    if (!index) return nullptr;
    return {index->x(), index->y(), index->z()};
}

template <typename T>
ordered_json or_null(const std::optional<T>& value) {
    return value ? ordered_json(*value) : ordered_json();
}

}  // namespace

ordered_json vdb_report(const std::string& path, const Format& format) {
    const VdbFile file = read_vdb_info(path);
    ordered_json grids = ordered_json::array();
    Box3d all;
    for (const VdbGrid& grid : file.grids) {
        const std::optional<Box3d> bounds = grid.bounds();
        if (bounds) all.extend(*bounds);
        grids.push_back({{"name", grid.name},
                         {"type", grid.type},
                         {"half", grid.is_half},
                         {"class", grid.grid_class.empty() ? ordered_json() : ordered_json(grid.grid_class)},
                         {"background", or_null(grid.background)},
                         {"active_voxels", or_null(grid.active_voxels)},
                         {"voxel_size", grid.voxel_size ? vector_json(*grid.voxel_size) : ordered_json()},
                         {"transform", grid.map},
                         {"bounds", box_json(bounds.value_or(Box3d{}))},
                         {"index_min", index_json(grid.least_index)},
                         {"index_max", index_json(grid.greatest_index)}});
    }
    return {{"path", path},
            {"format", format.name},
            {"detail", "OpenVDB " + file.library + ", file version " + std::to_string(file.version)},
            {"bounds", box_json(all)},
            {"attributes", ordered_json::array()},
            {"grids", grids}};
}

}  // namespace strata
