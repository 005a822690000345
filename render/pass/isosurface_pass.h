#pragma once

#include <cstdint>
#include <span>

#include "core/cloud/clip_box.h"
#include "core/math/camera.h"
#include "render/gbuffer.h"
#include "render/isosurface_model.h"
#include "render/sky_light.h"

namespace strata {

/// How isosurfaces are drawn into rows of a picture.
struct IsosurfaceView {
    const Camera& camera;
    uint32_t width_px, height_px;  // of the whole picture
    Vec2f offset_px;               // of a sample, from the middle of its pixel
    std::span<const ClipBox> clips;
    int threads = 1;
    UpAxis up = UpAxis::z;  // for light
};

/// What was drawn.
struct IsosurfacesDrawn {
    uint64_t rays = 0;  // one a pixel and surface, but for those that translucent ones let pass
    uint64_t hits = 0;  // pixels that show a surface

    void add(const IsosurfacesDrawn& other) {
        rays += other.rays;
        hits += other.hits;
    }
};

/// Casts a ray through the middle of each pixel of a G-buffer and draws the isosurface that it meets where that is nearer than what is
/// there: color, eye depth, id and, where the G-buffer has it, splat_px, which is 1. Of what is equally near the lower drawable stays. Lit
/// by the sky that lights voxels and meshes, from whichever side it is seen, by the gradient's normal. Where clip boxes cut it is open.
/// Its opacity does not count.
/// drawable  the model's number in the scene; ids are the cell's coordinates (isosurface_id)
/// cost      some 0.1 to 0.3 us a pixel and thread
IsosurfacesDrawn draw_isosurface(const IsosurfaceModel& model, uint32_t drawable, const IsosurfaceView& view, GBuffer& out);

/// Draws translucent isosurfaces over all that is opaque, which must be there: each layer of each that a ray meets hides its part of what is behind, in
/// linear light, from the eye on, until no more than 1/512 passes. Depth and id are those of the first layer. Over nothing a pixel's alpha is what the layers hide.
/// first  drawable of the first of the models; those that are opaque are passed over
IsosurfacesDrawn draw_translucent(std::span<const IsosurfaceModel> models, uint32_t first, const IsosurfaceView& view, GBuffer& out);

/// The id of a cell: 18 bits of each coordinate.
constexpr PixelId isosurface_id(const std::array<int32_t, 3>& cell, uint32_t drawable) {
    return PixelId{drawable} << 56 | PixelId(uint32_t(cell[2])) << 36 | PixelId(uint32_t(cell[1])) << 18 | PixelId(uint32_t(cell[0]));
}

}  // namespace strata
