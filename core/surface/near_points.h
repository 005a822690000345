#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/surface/point_layers.h"

namespace strata {

/// Of points within a radius: fewer say nothing of a surface.
inline constexpr int kLeastPoints = 4;

/// The points near a brick of samples, by coordinate, for loops over all of them. Places count from the brick's least sample, in spacings.
struct NearPoints {
    std::vector<float> x, y, z;
    std::vector<Vec3f> normals;    // [x] or empty
    std::vector<uint8_t> layers;   // [x] 0, 1, 2
    std::vector<uint32_t> points;  // [x] of that layer

    size_t size() const { return x.size(); }

    /// Takes those within `reach` <= 8 spacings of the box of the brick's samples and cells, from 0 to 8, in an order that depends on them alone.
    /// layers  that of the brick in the middle; null: no points
    /// skip    points whose normal is zero
    void gather(const std::array<const PointLayer*, 3>& layers, const std::array<int32_t, 2>& corner, float reach, bool skip);
};

/// The corners of bricks that hold points in any of the layers, and of the eight around each; ascending.
std::vector<std::array<int32_t, 2>> corners_around(const std::array<const PointLayer*, 3>& layers);

}  // namespace strata
