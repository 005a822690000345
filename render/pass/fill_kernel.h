#pragma once

#include "core/simd_level.h"
#include "render/gbuffer.h"
#include "render/pass/fill_settings.h"

namespace strata {

/// Hole filling on the CPU: what fill.frag computes.
/// Fills colors (averaged in linear light), depths (on the plane) and, where present, ids and splat_px (those of the nearest
/// pixel that takes part). Rows nearer than reach_px() to the first or the last row of `gbuffer` that is not the
/// picture's own border come out unfinished.
/// gbuffer  with splat_px
/// level    what the processor has; never shows
/// cost     about 10 ns a pixel and thread, and 0.7 us a pixel that may be a hole
void fill_holes(GBuffer& gbuffer, const FillSettings& settings, const Camera& camera, uint32_t height_px, int threads,
                SimdLevel level = best_simd_level());

}  // namespace strata
