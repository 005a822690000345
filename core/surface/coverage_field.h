#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/surface/scalar_field.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// How much of each cell of an octree's depth is occupied, 0 to 1, as samples at the cells' centers: the surface at 0.5 runs smoothly
/// between cells that are coarser than the voxels. Bricks with an occupied cell are given, except full ones that touch no empty one: the
/// inside of a solid costs nothing where full cells of the tree are large. Reads the tree, which must outlive it. cost  O(nodes) for all
/// layers together, and the outsides of full cells; memory for one layer
class CoverageField : public FieldBrickSource {
public:
    /// depth         1 to tree.depth(); at the last one cells are voxels, and values 0 or 1
    /// memory_bytes  for a layer: 2,072 bytes a brick
    /// memory_parts  memory_bytes is one of so many of what was given: errors speak of that
    /// throws        Error{usage}: no such depth
    CoverageField(const VoxelTree& tree, int depth, int threads = 1, uint64_t memory_bytes = std::numeric_limits<uint64_t>::max(), uint64_t memory_parts = 1);

    const GridPlacement& placement() const override { return placement_; }
    float background() const override { return 0.0f; }
    float absent_value(const std::array<int32_t, 3>& corner) const override;
    /// throws  Error{limit}: the layer takes more memory than allowed; found before its samples take any
    bool next_layer(FieldBrickLayer& out) override;

private:
    // A brick of a layer: the cells of a node, the eight bytes' of one, or all of a full cell.
    struct Part {
        int32_t j, i;  // bricks
        uint32_t node;
        int8_t byte;  // -1: all
        bool full;
    };

    void add_part(const Part& part);
    void collect(int level, uint32_t node, const std::array<uint32_t, 3>& place, uint32_t layer);
    void collect_full(int log2_side, const std::array<uint32_t, 3>& place, uint32_t layer);
    enum class Content : uint8_t { empty, some, full };
    Content content(const std::array<int64_t, 3>& brick) const;
    bool touches_empty(const std::array<int64_t, 3>& brick) const;
    void fill(const Part& part, float* values) const;
    void fill_cells(int level, uint32_t node, int log2_side, uint64_t mask, const std::array<uint32_t, 3>& first, float* values) const;
    double share(int level, uint32_t node, int bit) const;

    const VoxelTree& tree_;
    int depth_, threads_;
    uint64_t memory_bytes_, memory_parts_;
    int side_log2_, brick_level_;  // bricks an axis; level of the nodes that bricks are, or are bytes of
    GridPlacement placement_;
    uint32_t next_ = 0;  // layer
    std::vector<Part> parts_;
};

}  // namespace strata
