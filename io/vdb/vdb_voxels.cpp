#include "io/vdb/vdb_voxels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <tuple>

#include "core/error.h"
#include "io/vdb/vdb_tree.h"

namespace strata {
namespace {

// Where each of a leaf's 512 places is among eight masks of 4^3.
struct Place {
    uint8_t octant, bit;
};
constexpr std::array<Place, 512> kPlaces = [] {
    std::array<Place, 512> places{};
    for (uint32_t i = 0; i < 512; ++i) {
        const uint32_t x = i >> 6, y = i >> 3 & 7, z = i & 7;
        places[i] = {uint8_t(octant_code(x >> 2, y >> 2, z >> 2)), uint8_t(mask_bit(x, y, z))};
    }
    return places;
}();

}  // namespace

const VdbGrid& choose_vdb_grid(const VdbFile& file, const std::string& name, const std::string& place) {
    const bool any = name.empty();
    const auto found = std::find_if(file.grids.begin(), file.grids.end(), [&](const VdbGrid& grid) { return any ? is_readable(grid) : grid.name == name; });
    if (found != file.grids.end()) return *found;
    std::string there;
    for (const VdbGrid& grid : file.grids) there += (there.empty() ? "" : ", ") + grid.name + " (" + grid.type + (grid.tree_offset == 0 ? ", " + grid.map : "") + ")";
    if (there.empty()) throw Error(ErrorKind::unsupported, place + ": no grids are in this file");
    if (any) throw Error(ErrorKind::unsupported, place + ": a grid of float, double, bool or mask is expected, there are " + there);
    throw Error(ErrorKind::usage, place + ": no grid " + name + ", there are " + there);
}

VdbVisitor gather_occupied(const VdbGrid& grid, const VdbVoxelSettings& settings, std::string place, BrickVoxels& out) {
    const double isovalue = settings.isovalue.value_or(0.0);
    const bool is_truth = grid.type == "bool" || grid.type == "mask";
    const bool is_level_set = grid.grid_class == "level set" && !is_truth;
    const auto is_occupied = [=](double value, bool active) {
        if (is_truth) return active;
        return is_level_set ? value <= isovalue : active && value > isovalue;
    };
    const auto check_memory = [&out, place, most = settings.memory_bytes] {
        if (const uint64_t bytes = out.memory_bytes(); bytes > most)
            throw Error(ErrorKind::limit, place + ": its voxels need more than " + std::to_string(bytes) + " bytes of memory, " + std::to_string(most) + " are allowed");
    };
    VdbVisitor visitor;
    visitor.begin = [=](double background) {
        if (is_level_set && background <= isovalue)
            throw Error(ErrorKind::usage, place + ": what lies far outside has the value " + std::to_string(background) + ", which the isovalue " +
                                              std::to_string(isovalue) + " takes for inside");
    };
    visitor.tile = [=, &out](const Vec3i& origin, int log2_side, double value, bool active) {
        if (!is_occupied(value, active)) return;
        out.add_cube(origin, log2_side);
        check_memory();
    };
    visitor.leaf = [=, &out](const Vec3i& origin, std::span<const uint64_t, 8> active, std::span<const double, 512> values) {
        std::array<uint64_t, 8> masks{};
        for (size_t i = 0; i < values.size(); ++i)
            masks[kPlaces[i].octant] |= uint64_t{is_occupied(values[i], active[i / 64] >> i % 64 & 1)} << kPlaces[i].bit;
        out.add_brick(origin, masks);
        check_memory();
    };
    return visitor;
}

VdbVoxels read_vdb_voxels(const ByteSource& source, const VdbVoxelSettings& settings) {
    ByteStream stream(source);
    VdbVoxels result;
    result.grid = choose_vdb_grid(read_vdb_header(stream), settings.grid, source.name());
    const VdbGrid& grid = result.grid;
    const std::string place = source.name() + ": grid " + grid.name;
    if (!grid.is_uniform())
        throw Error(ErrorKind::unsupported, place + ": voxels that are cubes along the axes are expected, its transform is " + grid.map);
    read_vdb_tree(stream, grid, gather_occupied(grid, settings, place, result.voxels));
    try {
        result.frame = result.voxels.finish(grid.place_of_0, grid.voxel_size->x(), grid.strata_levels);
    } catch (const Error& error) {
        throw error.within(place);
    }
    return result;
}

VdbVoxels read_vdb_voxels(const std::string& path, const VdbVoxelSettings& settings) { return read_vdb_voxels(*open_file(path), settings); }

VdbFile read_vdb_info(const ByteSource& source) {
    ByteStream stream(source);
    VdbFile file = read_vdb_header(stream);
    struct Counts {
        uint64_t active;
        Vec3i least, greatest;
    };
    std::map<std::tuple<uint64_t, std::string, bool>, Counts> counted;  // by tree and how it is read: many grids may share one
    for (VdbGrid& grid : file.grids) {
        if (!is_readable(grid)) continue;
        grid.background = read_vdb_background(stream, grid);
        if (grid.active_voxels) continue;
        const auto say = [&grid](const Counts& counts) {
            grid.active_voxels = counts.active;
            if (counts.active == 0) return;
            grid.least_index = counts.least;
            grid.greatest_index = counts.greatest;
        };
        const std::tuple key(grid.tree_offset, grid.type, grid.is_half);
        if (const auto known = counted.find(key); known != counted.end()) {
            say(known->second);
            continue;
        }
        uint64_t count = 0;
        Vec3i least = Vec3i::Constant(std::numeric_limits<int>::max()), greatest = Vec3i::Constant(std::numeric_limits<int>::min());
        VdbVisitor visitor;
        visitor.begin = [](double) {};
        visitor.tile = [&](const Vec3i& origin, int log2_side, double, bool active) {
            if (!active) return;
            count += uint64_t{1} << 3 * log2_side;
            least = least.cwiseMin(origin);
            greatest = greatest.cwiseMax((origin.array() + ((1 << log2_side) - 1)).matrix());
        };
        visitor.leaf = [&](const Vec3i& origin, std::span<const uint64_t, 8> active, std::span<const double, 512>) {
            for (int i = 0; i < 512; ++i) {
                if ((active[size_t(i) / 64] >> i % 64 & 1) == 0) continue;
                ++count;
                const Vec3i at = origin + Vec3i(i >> 6, i >> 3 & 7, i & 7);
                least = least.cwiseMin(at);
                greatest = greatest.cwiseMax(at);
            }
        };
        read_vdb_tree(stream, grid, visitor);
        say(counted[key] = {count, least, greatest});
    }
    return file;
}

VdbFile read_vdb_info(const std::string& path) { return read_vdb_info(*open_file(path)); }

}  // namespace strata
