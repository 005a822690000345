#include "core/voxel/voxel_bounds.h"

#include <algorithm>

namespace strata {
namespace {

using Coordinates = std::array<uint32_t, 3>;

// Voxels of the frame, the last one included.
struct VoxelRange {
    Coordinates low = {~0u, ~0u, ~0u}, high = {};

    void extend(const Coordinates& first, uint32_t side) {
        for (size_t axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], first[axis]);
            high[axis] = std::max(high[axis], first[axis] + (side - 1));
        }
    }
    bool holds(const Coordinates& first, uint32_t side) const {
        for (size_t axis = 0; axis < 3; ++axis)
            if (first[axis] < low[axis] || first[axis] + (side - 1) > high[axis]) return false;
        return true;
    }
};

Coordinates cell_of_node(const Coordinates& node, int bit) {
    Coordinates cell = coordinates_of_code(uint64_t(bit));
    for (size_t axis = 0; axis < 3; ++axis) cell[axis] += 4 * node[axis];
    return cell;
}

void extend_by_node(const VoxelTree& tree, size_t number, uint32_t node, const Coordinates& place, VoxelRange& range) {
    const VoxelLevel& level = tree.levels[number];
    const int shift = 2 * (tree.frame.levels - 1 - int(number));
    for (uint64_t left = level.masks[node]; left != 0; left &= left - 1) {
        const int bit = std::countr_zero(left);
        const Coordinates cell = cell_of_node(place, bit);
        const Coordinates first = {cell[0] << shift, cell[1] << shift, cell[2] << shift};
        if (range.holds(first, uint32_t{1} << shift)) continue;
        if (number + 1 == tree.levels.size() || (level.full_mask(node) >> bit & 1) != 0)
            range.extend(first, uint32_t{1} << shift);
        else
            extend_by_node(tree, number + 1, level.child(node, bit), cell, range);
    }
}

}  // namespace

Box3d occupied_bounds(const VoxelTree& tree) {
    if (tree.empty()) return {};
    VoxelRange range;
    extend_by_node(tree, 0, 0, {}, range);
    const Vec3d low(range.low[0], range.low[1], range.low[2]), high(range.high[0], range.high[1], range.high[2]);
    return {.min = tree.frame.world_from_voxel(low), .max = tree.frame.world_from_voxel(high + Vec3d::Ones())};
}

CellList coarse_cells(const VoxelTree& tree, size_t most) {
    // A level's cells in Morton order: those with nodes below have the next level's, one after the other.
    struct Cell {
        Coordinates place;
        bool full;
    };
    CellList list;
    if (tree.empty()) return list;
    std::vector<Cell> cells = {{{}, false}}, finer;
    list.cells = {{}};
    for (size_t number = 0; number < tree.levels.size(); ++number) {
        const VoxelLevel& level = tree.levels[number];
        finer.clear();
        size_t node = 0;
        for (const Cell& cell : cells) {
            const uint64_t mask = cell.full ? kFullMask : level.masks[node], full = cell.full ? kFullMask : level.full_mask(node);
            node += cell.full ? 0 : 1;
            for (uint64_t left = mask; left != 0; left &= left - 1) {
                const int bit = std::countr_zero(left);
                finer.push_back({cell_of_node(cell.place, bit), (full >> bit & 1) != 0});
            }
            if (finer.size() > most) return list;
        }
        cells.swap(finer);
        list.depth = 2 * int(number) + 2;
        list.cells.clear();
        for (const Cell& cell : cells) list.cells.push_back(cell.place);
    }
    return list;
}

Box3d cell_box(const VoxelFrame& frame, int depth, const Coordinates& cell) {
    const double side = double(uint32_t{1} << (frame.depth() - depth));
    const Vec3d first = side * Vec3d(cell[0], cell[1], cell[2]);
    return {.min = frame.world_from_voxel(first), .max = frame.world_from_voxel(first + Vec3d::Constant(side))};
}

}  // namespace strata
