#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/octree/node_key.h"

namespace strata {

/// Counts of the cells `depth` levels below a node, kept in bricks of 8^3 that exist only where points are.
/// A cell later holds where its points go (see Partition) instead of how many there are.
class CellGrid {
public:
    /// depth  3 to 8; memory: 8^(depth - 3) pointers and 4 KiB a brick touched
    CellGrid(const NodeKey& node, int depth);
    CellGrid(CellGrid&&) = default;
    ~CellGrid();

    const NodeKey& node() const { return node_; }
    uint32_t cell_level() const { return node_.level + uint32_t(depth_); }

    /// x, y, z: cell indices at cell_level() inside the node's cube.
    void add(uint32_t x, uint32_t y, uint32_t z, uint64_t count) { cell(x, y, z).fetch_add(count, std::memory_order_relaxed); }
    uint64_t value(uint32_t x, uint32_t y, uint32_t z) const;
    void set_value(uint32_t x, uint32_t y, uint32_t z, uint64_t value) { cell(x, y, z).store(value, std::memory_order_relaxed); }

    struct Cell {
        NodeKey key;
        uint64_t value;
    };
    /// The cells that are not zero, in octant order.
    std::vector<Cell> cells() const;

private:
    static constexpr int kBrickLevels = 3;
    using Brick = std::atomic<uint64_t>[512];

    std::atomic<uint64_t>& cell(uint32_t x, uint32_t y, uint32_t z);
    size_t brick_index(uint32_t x, uint32_t y, uint32_t z) const;
    static size_t cell_index(uint32_t x, uint32_t y, uint32_t z) { return (x & 7) << 6 | (y & 7) << 3 | (z & 7); }

    NodeKey node_;
    int depth_;
    std::unique_ptr<std::atomic<Brick*>[]> bricks_;
};

}  // namespace strata
