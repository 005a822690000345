#pragma once

#include <cstdint>
#include <memory>

#include "render/pass/voxels_pass.h"

namespace strata {

class EglContext;

/// Casts rays and lights what they hit with a compute shader: the twin of draw_voxels. Trees stay in the GPU's memory from frame to frame, by the
/// serials of their models, until others need the room.
/// The context must be current while this lives.
class VoxelsGlPass {
public:
    /// throws  Error{device} where the driver does not take the shader
    explicit VoxelsGlPass(const EglContext& context);
    ~VoxelsGlPass();

    /// Draws as draw_voxels does; colors may differ by a step or two.
    /// cap_bytes  most GPU memory that trees take: 16 bytes a node and what colors and normals ask for. Pixels take 20 MiB
    /// returns    false where the tree does not fit or cannot be drawn so: nothing was
    /// throws     Error{device}
    bool draw(const VoxelModel& model, uint32_t drawable, const VoxelView& view, uint64_t cap_bytes, GBuffer& out, VoxelsDrawn& drawn);

private:
    struct Resources;
    std::unique_ptr<Resources> resources_;
};

}  // namespace strata
