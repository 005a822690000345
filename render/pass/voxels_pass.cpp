#include "render/pass/voxels_pass.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "core/parallel.h"
#include "render/pass/voxels_kernel.h"

namespace strata {
namespace {

constexpr uint32_t kTile = 32;  // pixels

// Pixels of the picture, the last one excluded.
struct PixelBox {
    double left, top, right, bottom;
};

// What a box can cover, a pixel more at each side for rounding; everything where it reaches behind the eye.
PixelBox pixels_of(const Box3d& box, const VoxelView& view) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    PixelBox pixels = {kInfinity, kInfinity, -kInfinity, -kInfinity};
    const Camera& camera = view.camera;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d p((corner & 1 ? box.max : box.min).x(), (corner & 2 ? box.max : box.min).y(), (corner & 4 ? box.max : box.min).z());
        const Vec3d q = camera.view_from_world * (p - camera.eye);
        if (camera.projection == Projection::perspective && !(-q.z() >= camera.near_depth)) return {-kInfinity, -kInfinity, kInfinity, kInfinity};
        const double unit = pixels_per_unit(camera, -q.z(), view.height_px);
        const double x = 0.5 * view.width_px + q.x() * unit, y = 0.5 * view.height_px - q.y() * unit;
        pixels = {std::min(pixels.left, x - 2.0), std::min(pixels.top, y - 2.0), std::max(pixels.right, x + 2.0), std::max(pixels.bottom, y + 2.0)};
    }
    return pixels;
}

}  // namespace

void VoxelsDrawn::add(const VoxelsDrawn& other) {
    finest_depth = std::max(finest_depth, other.finest_depth);
    error_px = std::max(error_px, other.error_px);
    short_of_memory |= other.short_of_memory;
}

void VoxelsDrawn::add_cell(const VoxelTree& tree, int depth, double pixel_voxels, double wanted_px) {
    finest_depth = std::max(finest_depth, depth);
    if (depth == tree.frame.depth()) return;
    const double cell_px = double(uint32_t{1} << (tree.frame.depth() - depth)) / pixel_voxels;
    error_px = std::max(error_px, cell_px);
    short_of_memory |= depth == tree.depth() && cell_px > wanted_px;
}

VoxelsDrawn draw_voxels(const VoxelModel& model, uint32_t drawable, const VoxelView& view, GBuffer& out) {
    VoxelsDrawn drawn;
    if (model.tree->empty()) return drawn;
    const VoxelRays rays(view.camera, model.tree->frame, view.width_px, view.height_px, view.offset_px);
    const VoxelClip clip(view.clips, model.tree->frame);
    const VoxelTileInput input = {model, drawable, rays, clip,
                                  {.least_t = rays.near_depth(), .spread = view.error_px * rays.spread(), .footprint = view.error_px * rays.footprint()},
                                  view.error_px, -view.camera.forward(), sky_of(view.up)};
    // Tiles begin at the picture's first pixel, wherever the rows do.
    const PixelBox seen = pixels_of(model.bounds, view);
    std::vector<TileRect> tiles;
    const uint32_t end_row = out.first_row + out.rows;
    for (uint32_t top = out.first_row / kTile * kTile; top < end_row; top += kTile)
        for (uint32_t left = 0; left < out.width; left += kTile) {
            const uint32_t first = std::max(top, out.first_row), last = std::min(top + kTile, end_row), right = std::min(left + kTile, out.width);
            if (right < seen.left || left > seen.right || last < seen.top || first > seen.bottom) continue;
            tiles.push_back({left, first, int(right - left), int(last - first)});
        }
    std::mutex adding;
    parallel_blocks(view.threads, tiles.size(), 16, [&](size_t begin, size_t end) {
        VoxelTileKernel kernel(input);
        VoxelsDrawn part;
        for (size_t i = begin; i < end; ++i) kernel.draw(tiles[i], out, part);
        const std::lock_guard lock(adding);
        drawn.add(part);
    });
    return drawn;
}

}  // namespace strata
