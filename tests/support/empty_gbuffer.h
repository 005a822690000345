#pragma once

#include "render/gbuffer.h"

namespace strata::test {

/// Rows of a picture in which nothing is drawn yet.
inline GBuffer empty_gbuffer(uint32_t width, uint32_t first_row, uint32_t rows) {
    GBuffer gbuffer;
    gbuffer.width = width;
    gbuffer.first_row = first_row;
    gbuffer.rows = rows;
    const size_t pixels = size_t{width} * rows;
    gbuffer.colors.assign(pixels, 0);
    gbuffer.depths.assign(pixels, kNoDepth);
    gbuffer.splat_px.assign(pixels, 0);
    gbuffer.ids.assign(pixels, kNoPixelId);
    return gbuffer;
}

}  // namespace strata::test
