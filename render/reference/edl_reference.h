#pragma once

#include "core/math/vec.h"
#include "render/gbuffer.h"
#include "render/pass/edl_pass.h"

namespace strata {

/// Mean response of the 8 neighbours of a pixel, in double precision: what edl.frag approximates.
double edl_response(const GBuffer& in, const EdlSettings& settings, const Vec2d& pixel_world, int x, int y);

/// The pixel as edl.frag shades it: channels 0 to 255, not rounded; alpha is kept.
Vec4d edl_shaded(const GBuffer& in, const EdlSettings& settings, const Vec2d& pixel_world, int x, int y);

}  // namespace strata
