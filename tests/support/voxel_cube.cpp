#include "tests/support/voxel_cube.h"

#include <algorithm>

#include "core/math/random.h"

namespace strata {

uint64_t VoxelCube::count() const {
    return uint64_t(std::count_if(occupied.begin(), occupied.end(), [](uint8_t v) { return v != 0; }));
}

VoxelCube cube_where(int levels, const std::function<bool(uint32_t, uint32_t, uint32_t)>& is_occupied) {
    VoxelCube voxels(levels);
    for (uint32_t x = 0; x < voxels.side(); ++x)
        for (uint32_t y = 0; y < voxels.side(); ++y)
            for (uint32_t z = 0; z < voxels.side(); ++z) voxels.set(x, y, z, is_occupied(x, y, z));
    return voxels;
}

VoxelCube random_cube(int levels, double share, uint64_t seed) {
    Random random(seed);
    return cube_where(levels, [&](uint32_t, uint32_t, uint32_t) { return random.uniform() < share; });
}

VoxelCube random_boxes(int levels, int count, uint64_t seed) {
    Random random(seed);
    VoxelCube voxels(levels);
    for (int i = 0; i < count; ++i) {
        const uint32_t grain = i % 3 == 0 ? 1 : i % 3 == 1 ? 4 : 16;
        std::array<uint32_t, 3> low, high;
        for (size_t a = 0; a < 3; ++a) {
            low[a] = uint32_t(random.uniform() * voxels.side()) / grain * grain;
            const auto length = std::max<uint32_t>(1, uint32_t(random.uniform() * random.uniform() * voxels.side() / 4)) + grain - 1;
            high[a] = std::min(voxels.side(), low[a] + length / grain * grain);
        }
        for (uint32_t x = low[0]; x < high[0]; ++x)
            for (uint32_t y = low[1]; y < high[1]; ++y)
                for (uint32_t z = low[2]; z < high[2]; ++z) voxels.set(x, y, z);
    }
    return voxels;
}

VoxelCube coarsened(const VoxelCube& voxels, int shift) {
    VoxelCube cells(voxels.levels);
    for (uint32_t x = 0; x < voxels.side(); ++x)
        for (uint32_t y = 0; y < voxels.side(); ++y)
            for (uint32_t z = 0; z < voxels.side(); ++z)
                if (voxels.at(x, y, z)) cells.set(x >> shift, y >> shift, z >> shift);
    return cube_where(voxels.levels, [&](uint32_t x, uint32_t y, uint32_t z) { return cells.at(x >> shift, y >> shift, z >> shift); });
}

VoxelTree tree_of(const VoxelCube& voxels, bool with_full) {
    VoxelTree tree;
    tree.frame.levels = voxels.levels;
    if (voxels.count() == 0) return tree;
    // Occupied and full cells of each depth in Morton order, from the voxels up.
    std::vector<std::vector<uint8_t>> occupied(size_t(voxels.levels) + 1), full(size_t(voxels.levels) + 1);
    auto& finest = occupied[size_t(voxels.levels)];
    finest.resize(voxels.occupied.size());
    for (size_t code = 0; code < finest.size(); ++code) {
        const auto [x, y, z] = coordinates_of_code(code);
        finest[code] = voxels.at(x, y, z);
    }
    full[size_t(voxels.levels)] = finest;
    for (size_t depth = size_t(voxels.levels); depth-- > 0;) {
        const size_t cells = size_t{1} << 6 * depth;
        occupied[depth].resize(cells);
        full[depth].resize(cells);
        for (size_t code = 0; code < cells; ++code) {
            const auto any = [&](size_t i) { return occupied[depth + 1][code << 6 | i] != 0; };
            bool some = false, all = true;
            for (size_t i = 0; i < 64; ++i) {
                some = some || any(i);
                all = all && full[depth + 1][code << 6 | i] != 0;
            }
            occupied[depth][code] = some;
            full[depth][code] = all;
        }
    }
    std::vector<uint64_t> codes = {0};
    for (size_t l = 0; l < size_t(voxels.levels); ++l) {
        VoxelLevel level;
        std::vector<uint64_t> children;
        const bool last = l + 1 == size_t(voxels.levels);
        for (const uint64_t code : codes) {
            uint64_t mask = 0, full_mask = 0;
            if (!last) level.first_child.push_back(uint32_t(children.size()));
            for (uint64_t bit = 0; bit < 64; ++bit) {
                const uint64_t child = code << 6 | bit;
                if (!occupied[l + 1][child]) continue;
                mask |= uint64_t{1} << bit;
                if (with_full && !last && full[l + 1][child]) full_mask |= uint64_t{1} << bit;
                else if (!last) children.push_back(child);
            }
            level.masks.push_back(mask);
            if (with_full && !last) level.full.push_back(full_mask);
        }
        codes = std::move(children);
        if (level.masks.empty()) break;  // all above are full
        tree.levels.push_back(std::move(level));
    }
    return tree;
}

}  // namespace strata
