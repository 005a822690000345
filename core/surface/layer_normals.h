#pragma once

#include <array>
#include <vector>

#include "core/simd_level.h"
#include "core/surface/near_points.h"
#include "core/surface/point_layers.h"

namespace strata {

/// Normals of the points in the middle one of three layers: the direction in which the points within a radius spread least, near ones with
/// more weight. Of either sign; zero where there are fewer than kLeastPoints of them, or where they lie along a line.
/// layers  null: no points
/// radius  at most 8 spacings
/// source  H. Hoppe et al., "Surface reconstruction from unorganized points", SIGGRAPH 1992
std::vector<Vec3f> layer_normals(const std::array<const PointLayer*, 3>& layers, float radius, int threads, SimdLevel level = best_simd_level());

}  // namespace strata
