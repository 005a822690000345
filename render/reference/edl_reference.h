#pragma once

#include "core/math/vec.h"
#include "render/gbuffer.h"
#include "render/pass/edl_settings.h"

namespace strata {

/// Mean response of a pixel's neighbors, in double precision: what edl.frag and the kernel approximate.
double edl_response(const GBuffer& in, const EdlSettings& settings, const Vec2d& pixel_world, uint32_t height_px, int x, int y);

/// The pixel as they shade it: channels 0 to 255, not rounded; alpha is kept.
Vec4d edl_shaded(const GBuffer& in, const EdlSettings& settings, const Vec2d& pixel_world, uint32_t height_px, int x, int y);

}  // namespace strata
