#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/octree/cell_grid.h"
#include "core/octree/octree_frame.h"

namespace strata {

/// Points that one chunk may hold. It fixes which nodes exist, so it must not depend on memory or threads.
inline constexpr uint64_t kMaxChunkPoints = 1'000'000;

/// The top of the octree: inner nodes down to the chunks, subtrees of at most kMaxChunkPoints points (more only where
/// all of them lie in one smallest cell). Made from counts alone.
class Partition {
public:
    struct Node {
        NodeKey key;
        uint64_t points = 0;
        std::array<int32_t, 8> children = {-1, -1, -1, -1, -1, -1, -1, -1};  // indices of nodes; -1: no points there
        int32_t chunk = -1;                                                  // index of the chunk; -1: an inner node
    };
    struct Chunk {
        NodeKey key;
        uint64_t points = 0;
        int32_t node = -1;
    };

    /// Starts with a grid that suits `points`; `count` every point, then call `refine`.
    explicit Partition(uint64_t points, uint64_t max_chunk_points = kMaxChunkPoints);

    /// Counts points that share a cell. x, y, z: level-31 cell of one of them. Thread-safe.
    void count(uint32_t x, uint32_t y, uint32_t z, uint64_t points);
    /// Points with equal (x, y, z) >> run_shift() share a cell of the grid that is being counted.
    int run_shift() const { return int(kMaxLevel - grids_.back().cell_level()); }

    /// Looks for cells that hold more than a chunk may. If there are any, returns false: finer grids were laid into
    /// them, and every point has to be counted once more. Else makes nodes() and chunks() and returns true.
    bool refine();

    const std::vector<Node>& nodes() const { return nodes_; }  // children before parents
    int32_t root() const { return int32_t(nodes_.size()) - 1; }  // -1: there are no points
    const std::vector<Chunk>& chunks() const { return chunks_; }

    /// The chunk of a point, by its level-31 cell. Constant time but for refined cells.
    uint32_t chunk_of(uint32_t x, uint32_t y, uint32_t z) const;
    /// The chunk whose cube holds the cell `key`; none where no chunk reaches up to it.
    std::optional<uint32_t> chunk_above(const NodeKey& key) const;

private:
    static constexpr uint64_t kRefined = uint64_t{1} << 63;  // cell value: index of a finer grid

    int32_t add_nodes(const NodeKey& key, std::span<const CellGrid::Cell> cells);
    uint64_t points_of(const CellGrid::Cell& cell) const;
    void label_cells();

    uint64_t max_chunk_points_;
    std::vector<CellGrid> grids_;         // the coarse grid, then finer ones inside hot cells
    std::vector<uint64_t> grid_points_;   // [grids]
    size_t counting_from_ = 0;            // grids before this one are complete
    std::vector<Node> nodes_;
    std::vector<Chunk> chunks_;
};

}  // namespace strata
