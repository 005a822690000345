#include "core/octree/partition.h"

#include <algorithm>
#include <bit>

namespace strata {
namespace {

// Fine enough that a scanned surface has some thousand points a cell, coarse enough that a full cube of cells stays
// below 150 MB: a surface fills about 4^depth cells, a volume 8^depth.
int first_depth(uint64_t points) {
    const int bits = std::bit_width(points / 1000);
    return std::clamp(2 + bits / 3, 3, 8);
}

// Finer grids go down 5 levels a pass; a grid has at least 3, so the last steps before level 31 are shared out.
int refined_depth(uint32_t level) {
    const int left = int(kMaxLevel - level);
    if (left == 6 || left == 7) return left - 3;
    return std::min(left, 5);
}

}  // namespace

Partition::Partition(uint64_t points, uint64_t max_chunk_points) : max_chunk_points_(max_chunk_points) { grids_.emplace_back(NodeKey{}, first_depth(points)); }

void Partition::count(uint32_t x, uint32_t y, uint32_t z, uint64_t points) {
    size_t grid = 0;
    for (;;) {
        CellGrid& cells = grids_[grid];
        const int shift = int(kMaxLevel - cells.cell_level());
        if (grid >= counting_from_) return cells.add(x >> shift, y >> shift, z >> shift, points);
        const uint64_t value = cells.value(x >> shift, y >> shift, z >> shift);
        if (!(value & kRefined)) return;  // counted in an earlier pass
        grid = value & ~kRefined;
    }
}

bool Partition::refine() {
    const size_t counted = grids_.size();
    grid_points_.resize(counted, 0);
    for (size_t grid = counting_from_; grid < counted; ++grid) {
        const uint32_t level = grids_[grid].cell_level();
        const int shift_to_31 = int(kMaxLevel - level);
        for (const CellGrid::Cell& cell : grids_[grid].cells()) {
            grid_points_[grid] += cell.value;
            if (cell.value <= max_chunk_points_ || shift_to_31 == 0) continue;
            grids_[grid].set_value(cell.key.x, cell.key.y, cell.key.z, kRefined | grids_.size());
            grids_.emplace_back(cell.key, refined_depth(level));
        }
    }
    counting_from_ = counted;
    if (grids_.size() > counted) return false;
    const std::vector<CellGrid::Cell> cells = grids_[0].cells();
    if (!cells.empty()) add_nodes(NodeKey{}, cells);
    label_cells();
    return true;
}

uint64_t Partition::points_of(const CellGrid::Cell& cell) const {
    return cell.value & kRefined ? grid_points_[cell.value & ~kRefined] : cell.value;
}

int32_t Partition::add_nodes(const NodeKey& key, std::span<const CellGrid::Cell> cells) {
    Node node{.key = key};
    for (const CellGrid::Cell& cell : cells) node.points += points_of(cell);
    const uint32_t cell_level = cells.front().key.level;
    if (node.points <= max_chunk_points_ || key.level == kMaxLevel) {
        node.chunk = int32_t(chunks_.size());
        chunks_.push_back({key, node.points, int32_t(nodes_.size())});
        nodes_.push_back(node);
        return int32_t(nodes_.size()) - 1;
    }
    if (key.level == cell_level) return add_nodes(key, grids_[cells.front().value & ~kRefined].cells());
    int child_count = 0;
    int32_t only_child = -1;
    const uint32_t bit = cell_level - key.level - 1;
    for (size_t begin = 0; begin < cells.size();) {
        const auto octant_of = [&](const CellGrid::Cell& cell) {
            return int((cell.key.x >> bit & 1) << 2 | (cell.key.y >> bit & 1) << 1 | (cell.key.z >> bit & 1));
        };
        const int octant = octant_of(cells[begin]);
        size_t end = begin + 1;
        while (end < cells.size() && octant_of(cells[end]) == octant) ++end;
        only_child = node.children[size_t(octant)] = add_nodes(key.child(octant), cells.subspan(begin, end - begin));
        ++child_count;
        begin = end;
    }
    // Points that no cell can tell apart become a leaf at once, not at the end of a chain of empty nodes.
    Node& last = nodes_[size_t(only_child)];
    if (child_count == 1 && last.chunk >= 0 && last.points > max_chunk_points_) {
        last.key = chunks_[size_t(last.chunk)].key = key;
        return only_child;
    }
    nodes_.push_back(node);
    return int32_t(nodes_.size()) - 1;
}

void Partition::label_cells() {
    for (CellGrid& grid : grids_)
        for (const CellGrid::Cell& cell : grid.cells())
            if (!(cell.value & kRefined)) grid.set_value(cell.key.x, cell.key.y, cell.key.z, 1 + chunk_above(cell.key).value());
}

uint32_t Partition::chunk_of(uint32_t x, uint32_t y, uint32_t z) const {
    size_t grid = 0;
    for (;;) {
        const int shift = int(kMaxLevel - grids_[grid].cell_level());
        const uint64_t value = grids_[grid].value(x >> shift, y >> shift, z >> shift);
        if (!(value & kRefined)) return uint32_t(value - 1);
        grid = value & ~kRefined;
    }
}

std::optional<uint32_t> Partition::chunk_above(const NodeKey& key) const {
    int32_t node = root();
    for (uint32_t level = key.level;; --level) {
        if (node < 0) return std::nullopt;
        if (nodes_[size_t(node)].chunk >= 0) return uint32_t(nodes_[size_t(node)].chunk);
        if (level == 0) return std::nullopt;
        const uint32_t bit = level - 1;
        node = nodes_[size_t(node)].children[(key.x >> bit & 1) << 2 | (key.y >> bit & 1) << 1 | (key.z >> bit & 1)];
    }
}

}  // namespace strata
