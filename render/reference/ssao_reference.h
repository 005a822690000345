#pragma once

#include "core/math/camera.h"
#include "render/gbuffer.h"

namespace strata {

/// Cosine-weighted visibility of a pixel past what the G-buffer holds, in double precision: every pixel of `slices` lines through it,
/// for occluders that are solid away from the eye. They count in full up to 0.6 of the radius, and from there on ever less.
double visibility_reference(const GBuffer& in, const Camera& camera, uint32_t height_px, double radius, int x, int y, int slices);

}  // namespace strata
