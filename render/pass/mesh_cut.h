#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "render/pass/mesh_kernel.h"

namespace strata {

inline constexpr size_t kMostPieces = 6;  // three corners, and one more for each of five planes

/// What of a triangle lies behind the near plane and not too far beside the picture, as triangles. Edges are cut from the end that stays, so
/// that two triangles at an edge are cut alike; corners that stay are where the others have them.
/// corners    world
/// projected  the same, as project_vertex has them
/// returns    how many pieces there are; none where the triangle lies wholly beside the picture
size_t cut_triangle(const MeshProjection& view, uint32_t width_px, uint32_t height_px, const std::array<Vec3d, 3>& corners,
                    const std::array<ProjectedVertex, 3>& projected, uint32_t number, std::array<RasterTriangle, kMostPieces>& pieces);

}  // namespace strata
