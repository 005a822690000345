#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/surface/cube_faces.h"

namespace strata {

/// Cells of a brick and those around it, a number each: what tests compare bricks with.
struct DenseBrick {
    static constexpr int kSide = CubeBrick::kMaterialSide;

    std::vector<uint8_t> materials = std::vector<uint8_t>(size_t(kSide) * kSide * kSide);  // 0: empty
    uint8_t first_transparent = 255;                                                       // materials from here on

    /// x, y, z  from -1 to 64
    uint8_t& at(int x, int y, int z) { return materials[CubeBrick::cell(x, y, z)]; }
    uint8_t at(int x, int y, int z) const { return materials[CubeBrick::cell(x, y, z)]; }

    std::unique_ptr<CubeBrick> brick() const {
        auto brick = std::make_unique<CubeBrick>();
        brick->allocate_materials();
        uint8_t only = 0;
        constexpr int kEnd = kCubeBrickSide;
        for (int y = -1; y <= kEnd; ++y)
            for (int x = -1; x <= kEnd; ++x)
                for (int z = -1; z <= kEnd; ++z) {
                    const uint8_t material = at(x, y, z);
                    const int beyond = (x < 0 || x == kEnd) + (y < 0 || y == kEnd) + (z < 0 || z == kEnd);
                    if (material == 0 || beyond > 1) continue;
                    if (only != 0 && only != material) brick->one_material = false;
                    only = material;
                    brick->materials[CubeBrick::cell(x, y, z)] = material;
                    const bool transparent = material >= first_transparent;
                    if (transparent) brick->any_transparent = true;
                    const auto set = [&](uint64_t& occupied, uint64_t& see_through, int bit) {
                        occupied |= uint64_t{1} << bit;
                        if (transparent) see_through |= uint64_t{1} << bit;
                    };
                    if (z < 0) set(brick->below[size_t(x)], brick->transparent_below[size_t(x)], y);
                    else if (z == kEnd) set(brick->above[size_t(x)], brick->transparent_above[size_t(x)], y);
                    else set(brick->occupied[CubeBrick::column(x, y)], brick->transparent[CubeBrick::column(x, y)], z);
                }
        return brick;
    }
};

/// material  of the cells from (-1, -1, -1) to (64, 64, 64)
inline DenseBrick brick_where(const std::function<uint8_t(int x, int y, int z)>& material) {
    DenseBrick dense;
    for (int y = -1; y <= kCubeBrickSide; ++y)
        for (int x = -1; x <= kCubeBrickSide; ++x)
            for (int z = -1; z <= kCubeBrickSide; ++z) dense.at(x, y, z) = material(x, y, z);
    return dense;
}

/// Whether cell (i, j, k) is one of the ball, of which those with a coordinate of `radius` are no part.
inline bool in_integer_ball(int i, int j, int k, int radius) {
    return i >= -radius && i < radius && j >= -radius && j < radius && k >= -radius && k < radius &&
           i * i + j * j + k * k <= radius * radius;
}

}  // namespace strata
