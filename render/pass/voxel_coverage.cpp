#include "render/pass/voxel_coverage.h"

#include <algorithm>
#include <bit>
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
constexpr std::array<std::array<uint8_t, 3>, 64> kCellOfBit = [] {
    std::array<std::array<uint8_t, 3>, 64> cells{};
    for (uint64_t bit = 0; bit < 64; ++bit)
        for (size_t axis = 0; axis < 3; ++axis) cells[bit][axis] = uint8_t(coordinates_of_code(bit)[axis]);
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
    const float inverse_square = float(1.0 / (radius * radius));
    std::array<int64_t, 3> first, last;
    for (size_t axis = 0; axis < 3; ++axis) {
        first[axis] = int64_t(std::floor(p[int(axis)] - radius + 0.5));
        last[axis] = int64_t(std::ceil(p[int(axis)] + radius - 0.5)) - 1;
    }
    // Bits of the blocks that are crossed along an axis.
    const auto slices = [&](size_t axis, int64_t block) {
        uint64_t bits = 0;
        for (int64_t i = std::max<int64_t>(first[axis] - 4 * block, 0); i <= std::min<int64_t>(last[axis] - 4 * block, 3); ++i)
            bits |= kSlices[axis][size_t(i)];
        return bits;
    };
    float sum = 0.0f, sum_x = 0.0f, sum_y = 0.0f, sum_z = 0.0f;
    for (int64_t bx = first[0] >> 2; bx <= last[0] >> 2; ++bx)
        for (int64_t by = first[1] >> 2; by <= last[1] >> 2; ++by)
            for (int64_t bz = first[2] >> 2; bz <= last[2] >> 2; ++bz) {
                uint64_t left = blocks.mask(depth, {bx, by, bz}) & slices(0, bx) & slices(1, by) & slices(2, bz);
                const float x = float(p.x() - 4.0 * double(bx) - 0.5), y = float(p.y() - 4.0 * double(by) - 0.5), z = float(p.z() - 4.0 * double(bz) - 0.5);
                for (; left != 0; left &= left - 1) {
                    const auto& cell = kCellOfBit[size_t(std::countr_zero(left))];
                    const float dx = x - float(cell[0]), dy = y - float(cell[1]), dz = z - float(cell[2]);
                    const float weight = std::max(1.0f - (dx * dx + dy * dy + dz * dz) * inverse_square, 0.0f);
                    sum += weight, sum_x += weight * dx, sum_y += weight * dy, sum_z += weight * dz;
                }
            }
    return sum > 0.0f ? Vec3f(Vec3f(sum_x, sum_y, sum_z) / sum) : Vec3f(Vec3f::Zero());
}

}  // namespace strata
