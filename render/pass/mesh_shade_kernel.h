#pragma once

#include <cstddef>
#include <cstdint>

#include "core/simd_level.h"
#include "render/pass/mesh_projection.h"
#include "render/sky_light.h"

namespace strata {

inline constexpr size_t kShadeBlock = 32;

/// Pixels of one row that a mesh shows, and what their rays meet there.
struct ShadeBlock {
    size_t count;
    double y_px;  // of the row's middle
    alignas(64) double x_px[kShadeBlock];
    alignas(64) double corners[9][kShadeBlock];   // of the triangle, world: x, y, z of the first, of the second, of the third
    alignas(64) uint32_t packed[3][kShadeBlock];  // normals of the corners; kNoNormal for flat ones

    alignas(64) float depth[kShadeBlock];       // on the triangle's plane, not beyond its corners and not before the near plane
    alignas(64) float weights[3][kShadeBlock];  // of the corners, 0 to 1
    alignas(64) double z[kShadeBlock];          // world
    alignas(64) float normal[3][kShadeBlock];   // towards the eye, of length 1
    alignas(64) float light[kShadeBlock];       // of the sky
    alignas(64) int32_t front[kShadeBlock];     // 1: corners turn counterclockwise
};

/// Meets triangles with rays, in double precision. The kernel compiled for an instruction set, which the processor must have. All give the same bits.
using MeetTriangles = void (*)(const MeshProjection& view, const Sky& sky, ShadeBlock& block);
MeetTriangles mesh_shade_kernel(SimdLevel level);

}  // namespace strata
