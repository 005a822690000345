#pragma once

#include <span>

#include "core/simd_level.h"
#include "render/gbuffer.h"
#include "render/pass/edl_settings.h"

namespace strata {

/// Eye-dome lighting on the CPU: what edl.frag computes, to less than 1/50 of a step of 8 bits before rounding.
/// Shades rows [first, first + rows) of the G-buffer (its splat_px filled if settings follow splats), counted from its own
/// first row; the others serve as neighbors. level: what the processor has; never shows
/// cost  about 10 ns a pixel and thread
void shade_edl(const GBuffer& in, const EdlSettings& settings, const Camera& camera, uint32_t height_px, uint32_t first,
               uint32_t rows, int threads, std::span<Rgba8> out, SimdLevel level = best_simd_level());

}  // namespace strata
