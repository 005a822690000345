#include "render/pass/voxel_coverage.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

namespace strata {
namespace {

// Bits of a mask whose cells have that coordinate, by axis.
constexpr std::array<std::array<uint64_t, 4>, 3> kSlices = [] {
    std::array<std::array<uint64_t, 4>, 3> slices{};
    for (uint64_t bit = 0; bit < 64; ++bit) {
        const std::array<uint32_t, 3> cell = coordinates_of_code(bit);
        for (size_t axis = 0; axis < 3; ++axis) slices[axis][cell[axis]] |= uint64_t{1} << bit;
    }
    return slices;
}();
constexpr std::array<std::array<float, 3>, 64> kCellOfBit = [] {
    std::array<std::array<float, 3>, 64> cells{};
    for (uint64_t bit = 0; bit < 64; ++bit)
        for (size_t axis = 0; axis < 3; ++axis) cells[bit][axis] = float(coordinates_of_code(bit)[axis]);
    return cells;
}();

}  // namespace

// Of the node at coordinates in its own side.
uint64_t CellBlocks::node_mask(size_t level, const std::array<uint32_t, 3>& place) const {
    uint32_t node = 0;
    for (size_t number = 0; number < level; ++number) {
        const int shift = 2 * int(level - 1 - number);
        const int bit = mask_bit(place[0] >> shift, place[1] >> shift, place[2] >> shift);
        const VoxelLevel& above = tree_->levels[number];
        if ((above.masks[node] >> bit & 1) == 0) return 0;
        if (number + 1 == tree_->levels.size() || (above.full_mask(node) >> bit & 1) != 0) return kFullMask;
        node = above.child(node, bit);
    }
    return tree_->levels[level].masks[node];
}

uint64_t CellBlocks::mask(int depth, const std::array<int64_t, 3>& block) {
    const int64_t blocks = depth < 2 ? 1 : int64_t{1} << (depth - 2);
    for (const int64_t place : block)
        if (place < 0 || place >= blocks) return 0;
    const std::array<uint32_t, 3> place = {uint32_t(block[0]), uint32_t(block[1]), uint32_t(block[2])};
    const uint64_t hash = (place[0] * 0x9e3779b97f4a7c15u) ^ (place[1] * 0xc2b2ae3d27d4eb4fu) ^ (place[2] * 0x165667b19e3779f9u);
    Kept& kept = kept_[(hash >> 32) % kKept];
    if (kept.depth == depth && kept.block == place) return kept.mask;
    uint64_t mask = 0;
    if (depth % 2 == 0) {
        mask = node_mask(size_t(depth - 2) / 2, place);
    } else {
        // The octants of eight nodes, of one where there is no more.
        const uint64_t nodes = depth == 1 ? 1 : 8;
        for (uint64_t octant = 0; octant < nodes; ++octant) {
            const std::array<uint32_t, 3> half = coordinates_of_code(octant);
            mask |= uint64_t{bytes_present(node_mask(size_t(depth - 1) / 2, {2 * place[0] + half[0], 2 * place[1] + half[1], 2 * place[2] + half[2]}))} << 8 * octant;
        }
    }
    kept = {depth, place, mask};
    return mask;
}

Vec3f rise_over_cells(CellBlocks& blocks, int depth, const Vec3d& p, double radius) {
    constexpr size_t kMostBlocks = 4;  // along an axis, that a radius of up to 6 reaches
    assert(radius <= 6.0);
    const float inverse_square = float(1.0 / (radius * radius));
    // Along each axis: the first block that is reached, how many are, and of each the bits of the cells that may be near and how far off the nearest is.
    std::array<int64_t, 3> first_block;
    std::array<size_t, 3> count;
    std::array<std::array<uint64_t, kMostBlocks>, 3> slices;
    std::array<std::array<float, kMostBlocks>, 3> place, square;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double at = p[int(axis)];
        const auto first = int64_t(std::floor(at - radius + 0.5)), last = int64_t(std::ceil(at + radius - 0.5)) - 1;
        first_block[axis] = first >> 2;
        count[axis] = size_t((last >> 2) - (first >> 2) + 1);
        for (size_t i = 0; i < count[axis]; ++i) {
            const int64_t cell = 4 * (first_block[axis] + int64_t(i));
            const int64_t low = std::max<int64_t>(first - cell, 0), high = std::min<int64_t>(last - cell, 3);
            slices[axis][i] = 0;
            for (int64_t k = low; k <= high; ++k) slices[axis][i] |= kSlices[axis][size_t(k)];
            place[axis][i] = float(at - double(cell) - 0.5);
            const float off = std::max({float(low) - place[axis][i], place[axis][i] - float(high), 0.0f});
            square[axis][i] = off * off * inverse_square;
        }
    }
    float sum = 0.0f, sum_x = 0.0f, sum_y = 0.0f, sum_z = 0.0f;
    for (size_t i = 0; i < count[0]; ++i)
        for (size_t j = 0; j < count[1]; ++j)
            for (size_t k = 0; k < count[2]; ++k) {
                if (square[0][i] + square[1][j] + square[2][k] >= 1.0f) continue;
                uint64_t left = blocks.mask(depth, {first_block[0] + int64_t(i), first_block[1] + int64_t(j), first_block[2] + int64_t(k)}) & slices[0][i] & slices[1][j] & slices[2][k];
                for (; left != 0; left &= left - 1) {
                    const std::array<float, 3>& cell = kCellOfBit[size_t(std::countr_zero(left))];
                    const float dx = place[0][i] - cell[0], dy = place[1][j] - cell[1], dz = place[2][k] - cell[2];
                    const float weight = std::max(1.0f - (dx * dx + dy * dy + dz * dz) * inverse_square, 0.0f);
                    sum += weight, sum_x += weight * dx, sum_y += weight * dy, sum_z += weight * dz;
                }
            }
    return sum > 0.0f ? Vec3f(Vec3f(sum_x, sum_y, sum_z) / sum) : Vec3f(Vec3f::Zero());
}

}  // namespace strata
