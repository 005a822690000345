#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/surface/cube_brick_source.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// The cells of one depth of an octree as bricks of 64^3, those with occupied cells only, in Morton order. The inside of full cells of the
/// tree larger than a brick is left out: nothing of it can be seen. Reads the tree, which must outlive it.
/// cost  20 bytes a brick
class TreeBricks : public CubeBrickSource {
public:
    /// depth  1 to tree.depth()
    TreeBricks(const VoxelTree& tree, int depth);

    const GridPlacement& placement() const override { return placement_; }
    bool has_colors() const override;
    uint64_t cells() const override;
    size_t size() const override { return codes_.size(); }
    uint64_t memory_bytes() const override { return codes_.size() * (sizeof(uint64_t) + sizeof(Part)); }
    std::string_view advice() const override { return "coarser cells need less"; }
    std::array<uint32_t, 3> place(size_t brick) const override { return coordinates_of_code(codes_[brick]); }
    size_t find(const std::array<int64_t, 3>& place) const override;
    bool gather(size_t brick, const CubeMaterials& materials, CubeBrick& out) const override;

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
    GridPlacement placement_;
    int depth_, side_log2_, root_level_;  // bricks an axis; level of the nodes that bricks are, or are bytes of
    std::vector<uint64_t> codes_;
    std::vector<Part> parts_;
};

/// Occupied cells of a depth, those in full cells above included.
uint64_t count_cells(const VoxelTree& tree, int depth);

}  // namespace strata
