#include "core/surface/coverage_field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr int kBrickDepth = 3;  // 8 cells an axis

}  // namespace

CoverageField::CoverageField(const VoxelTree& tree, int depth, int threads, uint64_t memory_bytes, uint64_t memory_parts)
    : tree_(tree), depth_(depth), threads_(threads), memory_bytes_(memory_bytes), memory_parts_(memory_parts) {
    if (depth < 1 || depth > tree.depth())
        throw Error(ErrorKind::usage, "expected a depth of 1 to " + std::to_string(tree.depth()) + ", got " + std::to_string(depth));
    side_log2_ = std::max(0, depth - kBrickDepth);
    brick_level_ = side_log2_ / 2;
    const double cell = tree.frame.voxel_size * std::ldexp(1.0, tree.frame.depth() - depth);
    placement_ = {.origin = tree.frame.origin + Vec3d::Constant(0.5 * cell), .axes = cell * Mat3d::Identity()};
}

bool CoverageField::next_layer(FieldBrickLayer& out) {
    const uint32_t layers = tree_.empty() ? 0 : 1u << side_log2_;
    parts_.clear();
    for (; next_ < layers && parts_.empty(); ++next_) {
        collect(0, 0, {0, 0, 0}, next_);
        out.k = int32_t(next_) * kFieldBrickSide;
    }
    std::sort(parts_.begin(), parts_.end(), [](const Part& a, const Part& b) { return a.j != b.j ? a.j < b.j : a.i < b.i; });
    out.corners.clear();
    for (const Part& part : parts_) out.corners.push_back({part.i * kFieldBrickSide, part.j * kFieldBrickSide});
    out.values.assign(parts_.size() * kFieldBrickSamples, 0.0f);
    parallel_blocks(threads_, parts_.size(), 16, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) fill(parts_[i], out.values.data() + i * kFieldBrickSamples);
    });
    return !parts_.empty();
}

// Bricks are counted here, 16 bytes each, before there are samples of them.
void CoverageField::add_part(const Part& part) {
    constexpr uint64_t kPartBytes = sizeof(Part) + sizeof(FieldBrickLayer::corners[0]) + kFieldBrickSamples * sizeof(float);
    if ((parts_.size() + 1) * kPartBytes > memory_bytes_)
        throw Error(ErrorKind::limit, "a layer of cells needs more than " + std::to_string(parts_.size() * kPartBytes * memory_parts_) + " bytes of memory, " +
                                          std::to_string(memory_bytes_ * memory_parts_) + " are allowed; coarser cells need less");
    parts_.push_back(part);
}

// place  of the node, in units of its own side
void CoverageField::collect(int level, uint32_t node, const std::array<uint32_t, 3>& place, uint32_t layer) {
    const bool bytes = side_log2_ % 2 == 1;
    const auto add = [&](const std::array<uint32_t, 3>& brick, int byte, bool full) {
        add_part({int32_t(brick[1]), int32_t(brick[0]), node, int8_t(byte), full});
    };
    if (level == brick_level_ && !bytes) return add(place, -1, false);
    const VoxelLevel& nodes = tree_.levels[size_t(level)];
    if (level == brick_level_) {
        for (uint32_t byte = 0; byte < 8; ++byte)
            if ((nodes.masks[node] >> 8 * byte & 0xFF) != 0 && 2 * place[2] + (byte & 1) == layer)
                add({2 * place[0] + (byte >> 2), 2 * place[1] + (byte >> 1 & 1), layer}, int(byte), false);
        return;
    }
    const int log2_side = side_log2_ - 2 * (level + 1);  // of a cell, in bricks
    for (uint64_t bits = nodes.masks[node]; bits != 0; bits &= bits - 1) {
        const int bit = std::countr_zero(bits);
        const auto [x, y, z] = coordinates_of_code(uint64_t(bit));
        const std::array<uint32_t, 3> cell = {4 * place[0] + x, 4 * place[1] + y, 4 * place[2] + z};
        if (layer >> log2_side != cell[2]) continue;
        if ((nodes.full_mask(node) >> bit & 1) != 0) collect_full(log2_side, cell, layer);
        else collect(level + 1, nodes.child(node, bit), cell, layer);
    }
}

void CoverageField::collect_full(int log2_side, const std::array<uint32_t, 3>& place, uint32_t layer) {
    const uint32_t side = 1u << log2_side, k = layer & (side - 1);
    for (uint32_t j = 0; j < side; ++j)
        for (uint32_t i = 0; i < side; ++i) {
            const bool rim = k == 0 || k + 1 == side || j == 0 || j + 1 == side;
            if (!rim && i == 1 && side > 2) i = side - 1;  // the bricks between have only full ones around them
            const std::array<uint32_t, 3> brick = {side * place[0] + i, side * place[1] + j, layer};
            if (touches_empty({brick[0], brick[1], brick[2]})) add_part({int32_t(brick[1]), int32_t(brick[0]), 0, -1, true});
        }
}

CoverageField::Content CoverageField::content(const std::array<int64_t, 3>& brick) const {
    const int64_t end = int64_t{1} << side_log2_;
    for (const int64_t c : brick)
        if (c < 0 || c >= end) return Content::empty;
    if (tree_.empty()) return Content::empty;
    const uint64_t code = octant_code(uint32_t(brick[0]), uint32_t(brick[1]), uint32_t(brick[2]));
    uint32_t node = 0;
    for (int level = 0; level < brick_level_; ++level) {
        const VoxelLevel& nodes = tree_.levels[size_t(level)];
        const int bit = int(code >> 3 * (side_log2_ - 2 * (level + 1)) & 63);
        if ((nodes.masks[node] >> bit & 1) == 0) return Content::empty;
        if ((nodes.full_mask(node) >> bit & 1) != 0) return Content::full;
        node = nodes.child(node, bit);
    }
    if (side_log2_ % 2 == 0) return Content::some;
    return (tree_.levels[size_t(brick_level_)].masks[node] >> 8 * (code & 7) & 0xFF) != 0 ? Content::some : Content::empty;
}

bool CoverageField::touches_empty(const std::array<int64_t, 3>& brick) const {
    for (int64_t i = -1; i <= 1; ++i)
        for (int64_t j = -1; j <= 1; ++j)
            for (int64_t k = -1; k <= 1; ++k)
                if (content({brick[0] + i, brick[1] + j, brick[2] + k}) == Content::empty) return true;
    return false;
}

float CoverageField::absent_value(const std::array<int32_t, 3>& corner) const {
    const auto brick = [&](size_t axis) { return int64_t{corner[axis]} / kFieldBrickSide; };
    const bool negative = corner[0] < 0 || corner[1] < 0 || corner[2] < 0;
    return !negative && content({brick(0), brick(1), brick(2)}) == Content::full ? 1.0f : 0.0f;
}

void CoverageField::fill(const Part& part, float* values) const {
    if (part.full) return void(std::fill(values, values + kFieldBrickSamples, 1.0f));
    const uint64_t mask = part.byte < 0 ? kFullMask : uint64_t{0xFF} << 8 * part.byte;
    fill_cells(brick_level_, part.node, depth_ - 2 * brick_level_, mask, {0, 0, 0}, values);
}

// first  of the node's cells in the brick, modulo 8, as eight cells of a node may be all of it
void CoverageField::fill_cells(int level, uint32_t node, int log2_side, uint64_t mask, const std::array<uint32_t, 3>& first,
                               float* values) const {
    const VoxelLevel& nodes = tree_.levels[size_t(level)];
    const auto value_at = [&](uint32_t x, uint32_t y, uint32_t z) -> float& {
        return values[((first[2] + z) % 8 * 8 + (first[1] + y) % 8) * 8 + (first[0] + x) % 8];
    };
    if (log2_side == 1) {
        for (uint32_t byte = 0; byte < 8; ++byte) {
            double sum = 0.0;
            for (int bit = 8 * int(byte); bit < 8 * int(byte) + 8; ++bit)
                if ((nodes.masks[node] >> bit & 1) != 0) sum += share(level, node, bit);
            value_at(byte >> 2, byte >> 1 & 1, byte & 1) = float(sum / 8.0);
        }
        return;
    }
    for (uint64_t bits = nodes.masks[node] & mask; bits != 0; bits &= bits - 1) {
        const int bit = std::countr_zero(bits);
        const auto [x, y, z] = coordinates_of_code(uint64_t(bit));
        if (log2_side == 2) {
            value_at(x, y, z) = float(share(level, node, bit));
            continue;
        }
        const int side_log2 = log2_side - 2;
        const uint32_t side = 1u << side_log2;
        if ((nodes.full_mask(node) >> bit & 1) != 0) {
            for (uint32_t i = 0; i < side * side * side; ++i)
                value_at(side * x + i % side, side * y + i / side % side, side * z + i / (side * side)) = 1.0f;
        } else {
            const std::array<uint32_t, 3> child = {first[0] + side * x, first[1] + side * y, first[2] + side * z};
            fill_cells(level + 1, nodes.child(node, bit), side_log2, kFullMask, child, values);
        }
    }
}

// Of an occupied cell what its voxels fill: sums of powers of 1/64, exact.
double CoverageField::share(int level, uint32_t node, int bit) const {
    const VoxelLevel& nodes = tree_.levels[size_t(level)];
    const auto below = size_t(level) + 1;
    if (below == tree_.levels.size() || (nodes.full_mask(node) >> bit & 1) != 0) return 1.0;
    const uint32_t child = nodes.child(node, bit);
    const uint64_t mask = tree_.levels[below].masks[child];
    const uint64_t whole = below + 1 == tree_.levels.size() ? mask : tree_.levels[below].full_mask(child);
    double sum = std::popcount(whole);
    for (uint64_t bits = mask & ~whole; bits != 0; bits &= bits - 1) sum += share(level + 1, child, std::countr_zero(bits));
    return sum / 64.0;
}

}  // namespace strata
