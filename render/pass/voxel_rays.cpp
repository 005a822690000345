#include "render/pass/voxel_rays.h"

#include <algorithm>
#include <cmath>

namespace strata {
namespace {

// A picture's pixel has coordinates below 2^15, so sums of multiples of 2^-51 of the largest are exact.
void round_together(Vec3d& first, Vec3d& per_x, Vec3d& per_y, double pixels) {
    const double largest = std::max({first.cwiseAbs().maxCoeff(), pixels * per_x.cwiseAbs().maxCoeff(), pixels * per_y.cwiseAbs().maxCoeff()});
    if (!(largest > 0.0)) return;
    const int exponent = std::ilogb(largest) - 50;
    const auto round = [&](Vec3d& v) {
        for (int axis = 0; axis < 3; ++axis) v[axis] = std::scalbn(std::nearbyint(std::scalbn(v[axis], -exponent)), exponent);
    };
    round(first);
    round(per_x);
    round(per_y);
}

}  // namespace

VoxelRays::VoxelRays(const Camera& camera, const VoxelFrame& frame, uint32_t width_px, uint32_t height_px, const Vec2f& offset_px)
    : near_depth_(camera.near_depth) {
    const double unit = 1.0 / (pixels_per_unit(camera, 1.0, height_px) * frame.voxel_size);  // voxels a pixel, at depth 1 in perspective
    (camera.projection == Projection::perspective ? spread_ : footprint_) = unit;
    set_picture(camera, frame.voxel_from_world(camera.eye), unit * camera.right(), -unit * camera.up(), camera.forward() / frame.voxel_size, width_px,
                height_px, offset_px);
}

VoxelRays::VoxelRays(const Camera& camera, const Vec3d& origin, const Mat3d& units_from_world, uint32_t width_px, uint32_t height_px,
                     const Vec2f& offset_px)
    : near_depth_(camera.near_depth) {
    const Mat3d pixels = units_from_world / pixels_per_unit(camera, 1.0, height_px);
    set_picture(camera, units_from_world * (camera.eye - origin), pixels * camera.right(), -(pixels * camera.up()), units_from_world * camera.forward(),
                width_px, height_px, offset_px);
}

void VoxelRays::set_picture(const Camera& camera, const Vec3d& eye, const Vec3d& right, const Vec3d& down, const Vec3d& forward, uint32_t width_px,
                            uint32_t height_px, const Vec2f& offset_px) {
    const double first_x = 0.5 + double(offset_px.x()) - 0.5 * width_px, first_y = 0.5 + double(offset_px.y()) - 0.5 * height_px;
    VoxelRay& first = picture_.first;
    if (camera.projection == Projection::perspective) {
        first = {eye, forward + first_x * right + first_y * down};
        picture_.direction_per_x = right;
        picture_.direction_per_y = down;
    } else {
        first = {eye + first_x * right + first_y * down, forward};
        picture_.origin_per_x = right;
        picture_.origin_per_y = down;
    }
    const double pixels = std::max(width_px, height_px);
    round_together(first.origin, picture_.origin_per_x, picture_.origin_per_y, pixels);
    round_together(first.direction, picture_.direction_per_x, picture_.direction_per_y, pixels);
    picture_.width = int(width_px);
    picture_.height = int(height_px);
}

VoxelTile VoxelRays::tile(uint32_t x, uint32_t y, int width, int height) const {
    VoxelTile tile = picture_;
    tile.first = picture_.ray(int(x), int(y));
    tile.width = width;
    tile.height = height;
    return tile;
}

}  // namespace strata
