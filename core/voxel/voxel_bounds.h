#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/box.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// The least box that holds all occupied cells, of the finest depth in memory; world. Empty for an empty tree.
/// cost  passes over what cannot make the box larger
Box3d occupied_bounds(const VoxelTree& tree);

/// Occupied cells of one depth.
struct CellList {
    int depth = 0;  // 0: the whole tree as one cell
    std::vector<std::array<uint32_t, 3>> cells;
};

/// The cells of the finest even depth that has at most `most` of them: an even sample of where things are.
CellList coarse_cells(const VoxelTree& tree, size_t most);

/// The box of a cell; world.
Box3d cell_box(const VoxelFrame& frame, int depth, const std::array<uint32_t, 3>& cell);

}  // namespace strata
