#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/cloud/clip_box.h"
#include "render/pass/mesh_projection.h"

namespace strata {

/// What clip boxes leave of a mesh, which they cut through. Places so near to a face of a box that keys of pixels do not tell count as in it.
class MeshClip {
public:
    MeshClip(std::span<const ClipBox> boxes, const MeshProjection& view);

    bool everything() const { return keeping_.empty() && removing_.empty(); }
    /// Of a triangle. `none` and `whole` are certain.
    Coverage coverage(const std::array<Vec3d, 3>& corners) const;
    /// Whether what a pixel shows is left.
    bool keeps(int32_t column, int32_t row, double key) const;

private:
    const MeshProjection& view_;
    std::vector<Box3d> keeping_, removing_;  // world
};

}  // namespace strata
