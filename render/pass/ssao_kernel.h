#pragma once

#include <vector>

#include "core/math/camera.h"
#include "core/simd_level.h"
#include "render/gbuffer.h"
#include "render/pass/depth_normals.h"

namespace strata {

/// Ambient occlusion from depth: the share of a white sky's light, weighted by the cosine to the surface, that reaches a
/// pixel past what the G-buffer holds within a radius. Open ground keeps its color whatever its tilt.
/// Visibility is found for every fourth pixel, in 4 directions that turn from row to row and 10 steps, blurred over 5 rows
/// without crossing edges, and spread to all pixels along their surfaces.
/// source  J. Jimenez et al., "Practical Realtime Strategies for Accurate Indirect Occlusion", 2016: the integral over a
///         slice between two horizons; it is exact for what has no cavities behind the horizon
struct SsaoSettings {
    float radius = 0.0f;  // world units; what is farther away does not occlude, from 0.6 of it on ever less; 0: off

    static constexpr int kMostPx = 128;  // a radius that looks larger in the picture is taken as so large
    /// Rows beyond those wanted that decide how they are lit.
    int reach_px() const;
};

/// Finds and applies ambient occlusion. Keeps its memory from one picture to the next.
class SsaoKernel {
public:
    /// Multiplies the G-buffer's colors, in linear light. Rows nearer than reach_px() to its first or last row, where that is
    /// not the picture's own border, come out unfinished.
    /// gbuffer  with splat_px
    /// level    what the processor has; never shows
    /// cost     about 15 ns a pixel and thread
    void shade(GBuffer& gbuffer, const SsaoSettings& settings, const Camera& camera, uint32_t height_px, int threads,
               SimdLevel level = best_simd_level());

private:
    HalfSurface surface_;
    std::vector<float> open_, blurred_;  // visibility, laid out as the surface
};

}  // namespace strata
