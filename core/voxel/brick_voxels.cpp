#include "core/voxel/brick_voxels.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <limits>
#include <string>

#include "core/error.h"

namespace strata {
namespace {

constexpr int kBrick = 8, kOctant = 4;
constexpr size_t kBatch = 4096;  // blocks

uint64_t first_block(const VoxelBlock& block) { return block.code << 6 * block.height; }

}  // namespace

void BrickVoxels::add_brick(const Vec3i& origin, const std::array<uint64_t, 8>& masks) {
    uint64_t count = 0;
    for (const uint64_t mask : masks) count += uint64_t(std::popcount(mask));
    if (count == 0) return;
    voxels_ += count;
    bricks_.push_back({{origin.x(), origin.y(), origin.z()}, masks});
}

void BrickVoxels::add_cube(const Vec3i& origin, int log2_side) {
    assert(log2_side >= 3 && log2_side <= 20);
    voxels_ += uint64_t{1} << 3 * log2_side;
    cubes_.push_back({{origin.x(), origin.y(), origin.z()}, log2_side});
}

VoxelFrame BrickVoxels::finish(const Vec3d& place_of_0, double voxel_size, int levels) {
    std::array<int64_t, 3> low, high;
    low.fill(std::numeric_limits<int32_t>::max());
    high.fill(std::numeric_limits<int32_t>::min());
    const auto extend = [&](const std::array<int32_t, 3>& origin, int64_t side) {
        for (size_t axis = 0; axis < 3; ++axis) {
            low[axis] = std::min<int64_t>(low[axis], origin[axis]);
            high[axis] = std::max<int64_t>(high[axis], origin[axis] + side);
        }
    };
    // By octants: a frame of one level is half as wide as a brick.
    for (const Brick& brick : bricks_)
        for (uint64_t octant = 0; octant < 8; ++octant) {
            if (brick.masks[octant] == 0) continue;
            const std::array<uint32_t, 3> place = coordinates_of_code(octant);
            std::array<int32_t, 3> origin = brick.origin;
            for (size_t axis = 0; axis < 3; ++axis) origin[axis] += kOctant * int32_t(place[axis]);
            extend(origin, kOctant);
        }
    for (const Cube& cube : cubes_) extend(cube.origin, int64_t{1} << cube.log2_side);
    if (voxels_ == 0) low = high = {};
    int largest = 3;
    for (const Cube& cube : cubes_) largest = std::max(largest, cube.log2_side);
    VoxelFrame frame{.voxel_size = voxel_size};
    const bool fits = levels > 0 && std::all_of(low.begin(), low.end(), [](int64_t place) { return place >= 0; }) &&
                      std::all_of(high.begin(), high.end(), [&](int64_t place) { return place <= int64_t{1} << 2 * levels; });
    if (fits) {
        low = {};
        frame.levels = levels;
    } else {
        for (int64_t& place : low) place &= -(int64_t{1} << largest);
        const int64_t longest = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
        while (int64_t{1} << 2 * frame.levels < longest)
            if (++frame.levels > kMostVoxelLevels)
                throw Error(ErrorKind::limit, "at most 1,048,576 voxels an axis can be held, there are " + std::to_string(longest));
    }
    frame.origin = place_of_0 + voxel_size * (Vec3d(double(low[0]), double(low[1]), double(low[2])).array() - 0.5).matrix();

    order_.reserve(bricks_.size());
    for (uint32_t i = 0; i < bricks_.size(); ++i) {
        const auto unit = [&](size_t axis) { return uint32_t((bricks_[i].origin[axis] - low[axis]) / kBrick); };
        order_.emplace_back(octant_code(unit(0), unit(1), unit(2)), i);
    }
    std::sort(order_.begin(), order_.end());
    for (const Cube& cube : cubes_) {
        // A cell of side 4^h is one of a block's; one of side 2 * 4^h is eight of them, a byte of the mask; the whole frame is 64.
        const int height = std::min(cube.log2_side / 2, frame.levels - 1);
        const auto unit = [&](size_t axis) { return uint32_t((cube.origin[axis] - low[axis]) >> 2 * height); };
        const uint64_t mask = cube.log2_side == 2 * height ? 1 : cube.log2_side == 2 * height + 1 ? 0xFF : kFullMask;
        tall_.push_back({octant_code(unit(0) >> 2, unit(1) >> 2, unit(2) >> 2), mask << mask_bit(unit(0), unit(1), unit(2)), height});
    }
    // Of blocks that begin at one place the taller comes first: it holds the others' node.
    std::sort(tall_.begin(), tall_.end(), [](const VoxelBlock& a, const VoxelBlock& b) {
        return first_block(a) != first_block(b) ? first_block(a) < first_block(b) : a.height > b.height;
    });
    size_t kept = 0;
    for (const VoxelBlock& block : tall_)
        if (kept > 0 && tall_[kept - 1].code == block.code && tall_[kept - 1].height == block.height)
            tall_[kept - 1].mask |= block.mask;
        else
            tall_[kept++] = block;
    tall_.resize(kept);
    return frame;
}

void BrickVoxels::emit(const VoxelSink& sink) const {
    VoxelBatch batch;
    const auto put = [&](const VoxelBlock& block) {
        batch.blocks.push_back(block);
        if (batch.blocks.size() < kBatch) return;
        sink(batch);
        batch.clear();
    };
    size_t tall = 0;
    for (const auto& [code, index] : order_)
        for (uint64_t octant = 0; octant < 8; ++octant) {
            const VoxelBlock block{code * 8 + octant, bricks_[index].masks[octant], 0};
            if (block.mask == 0) continue;
            while (tall < tall_.size() && first_block(tall_[tall]) <= block.code) put(tall_[tall++]);
            put(block);
        }
    while (tall < tall_.size()) put(tall_[tall++]);
    if (!batch.blocks.empty()) sink(batch);
}

}  // namespace strata
