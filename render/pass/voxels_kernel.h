#pragma once

#include <vector>

#include "render/pass/voxel_clip.h"
#include "render/pass/voxel_coverage.h"
#include "render/pass/voxel_rays.h"
#include "render/pass/voxels_pass.h"

namespace strata {

/// What all tiles of a picture share.
struct VoxelTileInput {
    const VoxelModel& model;
    uint32_t drawable;
    const VoxelRays& rays;
    const VoxelClip& clip;
    RayLimits limits;
    double error_px;
    Vec3d towards_eye;  // of length 1
    Sky sky;
};

/// Pixels of the G-buffer's picture.
struct TileRect {
    uint32_t x, y;
    int width, height;
};

/// Draws the voxels of one tile after another. One a thread.
class VoxelTileKernel {
public:
    explicit VoxelTileKernel(const VoxelTileInput& input) : in_(input), blocks_(*input.model.tree) {}

    void draw(const TileRect& rect, GBuffer& out, VoxelsDrawn& drawn);

private:
    // The surface that a hit's cell and those around it stand for: its normal, towards the eye, and its depth on the ray.
    struct Smooth {
        Vec3f normal;
        double t;
    };
    void cast(const TileRect& rect, const GBuffer& out);
    void shade(const VoxelRay& ray, const VoxelHit& hit, CellFace face, double pixel_voxels, size_t pixel, GBuffer& out);
    Vec3f rise_before(const VoxelRay& ray, const VoxelHit& hit, double radius);
    float distant_light(const VoxelRay& ray, const VoxelHit& hit, const Vec3f& face_up);
    Smooth smooth_at(const VoxelRay& ray, const VoxelHit& hit, CellFace face);

    const VoxelTileInput& in_;
    CellBlocks blocks_;
    std::vector<VoxelHit> hits_;
    std::vector<CellFace> faces_;  // that the pixels show: of cells or of cuts
    std::vector<RaySpan> spans_;
};

}  // namespace strata
