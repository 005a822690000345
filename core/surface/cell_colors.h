#pragma once

#include "core/surface/grid_at_vertices.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// Colors of an octree's cells at vertices of a surface between their centers: of the occupied ones among the eight around a vertex, by
/// trilinear weights and, as colors of voxels are averaged, as they are stored. Gray where none is.
class CellColorsAtVertices : public ColorsAtVertices {
public:
    /// depth  of the cells, 1 to tree.depth(), with colors. The tree must outlive it.
    CellColorsAtVertices(const VoxelTree& tree, int depth, int threads = 1);
    static bool has_colors(const VoxelTree& tree, int depth);

    void look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<std::array<uint8_t, 4>> out) override;

private:
    const VoxelColor* color_of(int64_t x, int64_t y, int64_t z) const;  // null: not occupied, or not known

    const VoxelTree& tree_;
    int depth_, threads_;
    PlacesInGrid places_;
};

}  // namespace strata
