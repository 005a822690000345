#include "core/octree/cell_grid.h"

#include <algorithm>

#include "core/math/morton.h"

namespace strata {

CellGrid::CellGrid(const NodeKey& node, int depth)
    : node_(node), depth_(depth), bricks_(new std::atomic<Brick*>[size_t{1} << 3 * (depth - kBrickLevels)]()) {}

CellGrid::~CellGrid() {
    if (!bricks_) return;  // moved from
    for (size_t i = 0; i < size_t{1} << 3 * (depth_ - kBrickLevels); ++i) delete[] bricks_[i].load();
}

size_t CellGrid::brick_index(uint32_t x, uint32_t y, uint32_t z) const {
    const uint32_t mask = (1u << (depth_ - kBrickLevels)) - 1;
    const int bits = depth_ - kBrickLevels;
    return (size_t(x >> kBrickLevels & mask) << bits | (y >> kBrickLevels & mask)) << bits | (z >> kBrickLevels & mask);
}

std::atomic<uint64_t>& CellGrid::cell(uint32_t x, uint32_t y, uint32_t z) {
    std::atomic<Brick*>& slot = bricks_[brick_index(x, y, z)];
    Brick* brick = slot.load(std::memory_order_acquire);
    if (!brick) {
        Brick* fresh = new Brick[1]();
        if (slot.compare_exchange_strong(brick, fresh, std::memory_order_acq_rel))
            brick = fresh;
        else
            delete[] fresh;
    }
    return (*brick)[cell_index(x, y, z)];
}

uint64_t CellGrid::value(uint32_t x, uint32_t y, uint32_t z) const {
    const Brick* brick = bricks_[brick_index(x, y, z)].load(std::memory_order_acquire);
    return brick ? (*brick)[cell_index(x, y, z)].load(std::memory_order_relaxed) : 0;
}

std::vector<CellGrid::Cell> CellGrid::cells() const {
    std::vector<Cell> found;
    const uint32_t bricks_per_side = 1u << (depth_ - kBrickLevels);
    const uint32_t x0 = node_.x << depth_, y0 = node_.y << depth_, z0 = node_.z << depth_;
    for (uint32_t bx = 0; bx < bricks_per_side; ++bx)
        for (uint32_t by = 0; by < bricks_per_side; ++by)
            for (uint32_t bz = 0; bz < bricks_per_side; ++bz) {
                const Brick* brick = bricks_[brick_index(bx << 3, by << 3, bz << 3)].load();
                if (!brick) continue;
                for (uint32_t i = 0; i < 512; ++i)
                    if (const uint64_t value = (*brick)[i].load(); value != 0)
                        found.push_back({{cell_level(), x0 + (bx << 3 | i >> 6), y0 + (by << 3 | (i >> 3 & 7)), z0 + (bz << 3 | (i & 7))}, value});
            }
    std::sort(found.begin(), found.end(), [&](const Cell& a, const Cell& b) {
        return octant_code(a.key.x - x0, a.key.y - y0, a.key.z - z0) < octant_code(b.key.x - x0, b.key.y - y0, b.key.z - z0);
    });
    return found;
}

}  // namespace strata
