#pragma once

#include <optional>

#include "core/math/camera.h"
#include "core/math/vec.h"
#include "render/gbuffer.h"
#include "render/pass/fill_settings.h"

namespace strata {

/// What a pixel is filled with.
struct FillTruth {
    Vec3d linear_color;
    double depth;
    PixelId id;
    int splat_px;
};

/// One pixel of the hole filling, by looking along every line in double precision; none where it stays as it is.
std::optional<FillTruth> fill_reference(const GBuffer& in, const FillSettings& settings, const Camera& camera,
                                        uint32_t height_px, int x, int y);

}  // namespace strata
