#pragma once

#include <cstdint>

#include "core/math/camera.h"
#include "core/voxel/ray_cast.h"

namespace strata {

/// The rays of a picture's pixels, in voxels of a frame or in samples of a field. t along them is eye depth in world units. Origins and directions are
/// rounded to so many bits that those of any pixel are exact sums: neither tiles nor strips show in them. That moves a ray by
/// less than 2^-36 of its distance from the eye.
class VoxelRays {
public:
    /// offset_px  of a sample, from the middle of its pixel
    VoxelRays(const Camera& camera, const VoxelFrame& frame, uint32_t width_px, uint32_t height_px, const Vec2f& offset_px);
    /// In units of their own, from an origin in the world.
    VoxelRays(const Camera& camera, const Vec3d& origin, const Mat3d& units_from_world, uint32_t width_px, uint32_t height_px, const Vec2f& offset_px);

    /// Of the rectangle of pixels whose first is (x, y) of the picture.
    VoxelTile tile(uint32_t x, uint32_t y, int width, int height) const;

    /// Voxels that a pixel covers at a depth; for rays in voxels, as are the next two.
    double pixel_size(double depth) const { return spread_ * depth + footprint_; }
    double spread() const { return spread_; }
    double footprint() const { return footprint_; }
    double near_depth() const { return near_depth_; }
    const VoxelTile& picture() const { return picture_; }

private:
    // All but the camera in units of the rays: the eye, and the ways a pixel to the right and down and forward, at depth 1 in perspective.
    void set_picture(const Camera& camera, const Vec3d& eye, const Vec3d& right, const Vec3d& down, const Vec3d& forward, uint32_t width_px, uint32_t height_px,
                     const Vec2f& offset_px);

    VoxelTile picture_;  // whose first pixel is (0, 0)
    double spread_ = 0.0, footprint_ = 0.0, near_depth_;
};

}  // namespace strata
