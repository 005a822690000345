#pragma once

#include <span>
#include <vector>

#include "core/cloud/clip_box.h"
#include "core/voxel/ray_cast.h"

namespace strata {

/// A part of a ray that clip boxes leave, and the face by which the ray comes into it: that of a box, turned towards the
/// ray; `inside` where the ray starts in it.
struct RaySpan {
    double from, to;
    CellFace face;
};

/// What clip boxes leave of rays. Boxes are planes here: they cut through cells.
class VoxelClip {
public:
    VoxelClip(std::span<const ClipBox> boxes, const VoxelFrame& frame);

    bool everything() const { return keeping_.empty() && removing_.empty(); }
    const std::vector<Box3d>& keeping() const { return keeping_; }  // in voxels
    const std::vector<Box3d>& removing() const { return removing_; }

    /// The parts that are left of [least_t, most_t], in the order of the ray. Where a box's face lies on faces of cells, the cell beyond counts:
    /// spans begin and end 2^-40 of their t inside.
    void spans(const VoxelRay& ray, double least_t, double most_t, std::vector<RaySpan>& out) const;

private:
    std::vector<Box3d> keeping_, removing_;  // in voxels
};

}  // namespace strata
