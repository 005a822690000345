#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/cloud/clip_box.h"
#include "core/math/camera.h"
#include "core/simd_level.h"
#include "render/gbuffer.h"
#include "render/mesh_model.h"
#include "render/sky_light.h"

namespace strata {

class MeshGlPass;

/// How meshes are drawn into rows of a picture.
struct MeshView {
    const Camera& camera;
    uint32_t width_px, height_px;  // of the whole picture
    Vec2f offset_px;               // of a sample, from the middle of its pixel
    std::span<const ClipBox> clips;
    int threads = 1;
    UpAxis up = UpAxis::z;      // for light
    MeshGlPass* gpu = nullptr;  // draws what it takes, where there are no clip boxes; the picture is the same
};

/// Draws triangles, both sides of them, into a G-buffer: color, eye depth, id and, where the G-buffer has it, splat_px, which is 1: there are no
/// splats whose steps are none. A triangle covers the pixels whose centers lie in it, with corners rounded to 1/256 pixel: of triangles that share
/// an edge none leaves a gap there and none covers what another one does. What a pixel shows is what its ray meets in the triangle's plane, in
/// double precision; between triangles the keys of the rounded corners decide, of equal ones the lower number. Of drawables that are equally near
/// the one that was there stays.
/// Surfaces are lit by the sky that lights voxels, from whichever side they are seen. Clip boxes cut through triangles; the cut is open.
/// Neither threads nor rows nor the instruction set show.
class MeshPass {
public:
    MeshPass();
    ~MeshPass();

    /// drawable  the model's number in the scene; ids are kFrontSlot or kBackSlot (mesh_shade.h) and the triangle
    /// returns   whether any pixel shows it
    /// cost      about 4 ns a vertex, 10 ns a triangle that is in sight and 60 ns a pixel, each by the number of threads
    bool draw(const MeshModel& model, uint32_t drawable, const MeshView& view, GBuffer& out, SimdLevel level = best_simd_level());

    /// Bytes that drawing takes beside the mesh: words of pixels, corners, and large triangles of a round.
    static uint64_t working_bytes(uint64_t vertices, uint64_t pixels);

private:
    struct Buffers;
    std::unique_ptr<Buffers> buffers_;
};

}  // namespace strata
