#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/surface/cube_faces.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// What cells are made of.
struct CubeMaterials {
    bool by_color = false;                // cells of different colors are of different materials; else all are one
    std::vector<VoxelColor> transparent;  // colors of cells that can be seen through
};

/// The cells of one depth of an octree as bricks of 64^3, those with occupied cells only, in Morton order. The inside of full cells of the
/// tree larger than a brick is left out: nothing of it can be seen. Reads the tree, which must outlive it.
/// cost  20 bytes a brick
class TreeBricks {
public:
    static constexpr size_t kNone = ~size_t{0};

    /// depth  1 to tree.depth()
    TreeBricks(const VoxelTree& tree, int depth);

    size_t size() const { return codes_.size(); }
    /// Coordinates in units of bricks.
    std::array<uint32_t, 3> place(size_t brick) const { return coordinates_of_code(codes_[brick]); }
    /// The brick there, or kNone: there is none, or only the inside of a full cell.
    size_t find(const std::array<int64_t, 3>& place) const;

    /// Fills a brick and the cells around it, except that materials are left as they are without by_color. Safe from several threads.
    /// materials  by_color only where the tree has colors of that depth. Material: red << 16 | green << 8 | blue
    /// returns    false: brick and all around it are full, so that it has no faces, and `out` is not filled
    bool gather(size_t brick, const CubeMaterials& materials, CubeBrick& out) const;

private:
    // Cells of a node, or the eight of a byte of its mask, or a part of a full cell.
    struct Part {
        uint32_t node = 0;
        int8_t byte = -1;           // -1: all
        bool full = false;          // all cells are occupied
        int8_t level = 0, bit = 0;  // of the full cell that it is a part of, a bit of its node
        bool in_full_cell = false;
    };
    class Filler;

    void collect(int level, uint32_t node, const std::array<uint32_t, 3>& place);
    void collect_full(const Part& part, uint64_t code, int log2_side, uint32_t outside);
    std::optional<Part> locate(const std::array<int64_t, 3>& place) const;

    const VoxelTree& tree_;
    int depth_, side_log2_, root_level_;  // bricks an axis; level of the nodes that bricks are, or are bytes of
    std::vector<uint64_t> codes_;
    std::vector<Part> parts_;
};

/// Occupied cells of a depth, those in full cells above included.
uint64_t count_cells(const VoxelTree& tree, int depth);

}  // namespace strata
