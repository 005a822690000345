#include "core/surface/field_surface.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/math/morton.h"
#include "core/parallel.h"
#include "core/surface/sample_masks.h"
#include "core/voxel/voxel_bounds.h"

namespace strata {
namespace {

using BlockMasks = std::array<uint64_t, 8>;  // of 4^3 cells each, in the order of octant digits

// The samples of a brick's cells, 9^3, in rows of 16: a mask of each is a word of 16 bits.
class PaddedBrick {
public:
    PaddedBrick() { samples_.fill(0.0f); }

    BlockMasks crossed(const FieldBricks& field, const std::array<int32_t, 3>& brick, float bound, bool below, SimdLevel simd) {
        field.copy_with_rim(brick, kRow, samples_);
        std::array<uint64_t, kSamples / 64> words;
        uint64_t* const mask = words.data();
        SampleStatistics statistics;
        find_inside(samples_, std::span(&bound, 1), below, &mask, statistics, simd);
        std::array<uint16_t, kRows> inside, valid;
        std::memcpy(inside.data(), words.data(), sizeof inside);
        valid.fill(0x1ff);
        if (statistics.nan > 0)
            for (size_t row = 0; row < kRows; ++row)
                for (size_t x = 0; x < 9; ++x)
                    if (const float value = samples_[row * kRow + x]; value != value) valid[row] &= uint16_t(~(1u << x));
        BlockMasks masks = {};
        for (size_t z = 0; z < 8; ++z)
            for (size_t y = 0; y < 8; ++y) {
                const size_t row = z * 9 + y;
                uint32_t any = inside[row] | inside[row + 1] | inside[row + 9] | inside[row + 10];
                uint32_t all = inside[row] & inside[row + 1] & inside[row + 9] & inside[row + 10];
                uint32_t known = valid[row] & valid[row + 1] & valid[row + 9] & valid[row + 10];
                any |= any >> 1;
                all &= all >> 1;
                known &= known >> 1;
                const uint32_t cells = any & ~all & known & 0xff;
                if (cells == 0) continue;
                const int shift = mask_bit(0, uint32_t(y), uint32_t(z));
                const size_t block = (y & 4) >> 1 | (z & 4) >> 2;
                masks[block] |= kSpread[cells & 15] << shift;
                masks[block | 4] |= kSpread[cells >> 4] << shift;
            }
        return masks;
    }

private:
    static constexpr size_t kRow = 16, kRows = 81, kSamples = (kRows * kRow + 63) / 64 * 64;

    // Four cells along x in a mask.
    static constexpr std::array<uint64_t, 16> kSpread = [] {
        std::array<uint64_t, 16> table{};
        for (uint32_t cells = 0; cells < 16; ++cells)
            for (uint32_t x = 0; x < 4; ++x)
                if (cells >> x & 1) table[cells] |= uint64_t{1} << mask_bit(x, 0, 0);
        return table;
    }();

    std::array<float, kSamples> samples_;
};

VoxelFrame frame_of(const FieldBricks& field) {
    const std::array<int32_t, 3> cells = field.cells();
    VoxelFrame frame;
    while (int32_t(frame.side()) < std::max({cells[0], cells[1], cells[2]})) ++frame.levels;
    return frame;
}

template <class Use>
void for_crossed_bricks(const FieldBricks& field, const IsoLevel& level, const Use& use) {
    const auto [ni, nj, nk] = field.bricks();
    for (int32_t k = 0; k < nk; ++k)
        for (int32_t j = 0; j < nj; ++j)
            for (int32_t i = 0; i < ni; ++i) {
                const FieldRange& range = field.range_of(i, j, k);
                if (level.inside == ContourInside::above ? range.least < level.isovalue && range.greatest >= level.isovalue
                                                         : range.least <= level.isovalue && range.greatest > level.isovalue)
                    use(std::array<int32_t, 3>{i, j, k});
            }
}

void check_memory(uint64_t needed, uint64_t memory_bytes) {
    if (needed > memory_bytes)
        throw Error(ErrorKind::limit, "the cells of a surface need " + std::to_string(needed) + " bytes of memory, " + std::to_string(memory_bytes) + " are left");
}

}  // namespace

uint64_t count_crossed_bricks(const FieldBricks& field, const IsoLevel& level) {
    uint64_t count = 0;
    for_crossed_bricks(field, level, [&](const std::array<int32_t, 3>&) { ++count; });
    return count;
}

VoxelTree surface_cells(const FieldBricks& field, const IsoLevel& level, int threads, uint64_t memory_bytes, SimdLevel simd) {
    VoxelTree tree;
    tree.frame = frame_of(field);
    const bool below = level.inside == ContourInside::below;
    const float bound = level_of(level.isovalue, below);
    std::vector<std::pair<uint64_t, std::array<int32_t, 3>>> bricks;  // by code
    const uint64_t crossed = count_crossed_bricks(field, level), brick_bytes = crossed * (sizeof bricks[0] + sizeof(BlockMasks));
    check_memory(brick_bytes, memory_bytes);
    bricks.reserve(size_t(crossed));
    for_crossed_bricks(field, level, [&](const std::array<int32_t, 3>& brick) {
        bricks.emplace_back(octant_code(uint32_t(brick[0]), uint32_t(brick[1]), uint32_t(brick[2])), brick);
    });
    std::sort(bricks.begin(), bricks.end());
    std::vector<BlockMasks> masks(bricks.size());
    parallel_blocks(threads, bricks.size(), 64, [&](size_t begin, size_t end) {
        PaddedBrick padded;
        for (size_t n = begin; n < end; ++n) masks[n] = padded.crossed(field, bricks[n].second, bound, below, simd);
    });
    // Level by level, from the last: nodes' codes ascend, so those of one parent are neighbors.
    std::vector<uint64_t> codes;
    tree.levels.resize(size_t(tree.frame.levels));
    std::vector<uint64_t>& last = tree.levels.back().masks;
    size_t blocks = 0;
    for (const BlockMasks& brick : masks) blocks += size_t(8 - std::count(brick.begin(), brick.end(), 0));
    check_memory(brick_bytes + blocks * (sizeof codes[0] + sizeof last[0]), memory_bytes);
    codes.reserve(blocks);
    last.reserve(blocks);
    for (size_t n = 0; n < bricks.size(); ++n)
        for (uint64_t block = 0; block < 8; ++block)
            if (masks[n][block] != 0) {
                codes.push_back(bricks[n].first << 3 | block);
                last.push_back(masks[n][block]);
            }
    bricks = {};
    masks = {};  // the levels above take less
    for (size_t number = tree.levels.size() - 1; number > 0; --number) {
        std::vector<uint64_t>& above = tree.levels[number - 1].masks;
        size_t count = 0;
        for (const uint64_t code : codes) {
            const uint64_t parent = code >> 6;
            if (above.empty() || codes[count - 1] != parent) {
                above.push_back(0);
                codes[count++] = parent;  // at or before the code that was read
            }
            above.back() |= uint64_t{1} << (code & 63);
        }
        codes.resize(count);
    }
    index_tree(tree);
    return tree;
}

Box3d surface_bounds(const FieldSurface& surface) {
    const Box3d box = occupied_bounds(surface.cells);
    Box3d world;
    for (int corner = 0; corner < 8 && !box.empty(); ++corner)
        world.extend(surface.field->placement().world_from_index({(corner & 1 ? box.max : box.min).x(), (corner & 2 ? box.max : box.min).y(),
                                                                  (corner & 4 ? box.max : box.min).z()}));
    return world;
}

}  // namespace strata
