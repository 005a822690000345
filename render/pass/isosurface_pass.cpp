#include "render/pass/isosurface_pass.h"

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <vector>

#include "core/parallel.h"
#include "core/surface/field_rays.h"
#include "render/pass/mesh_projection.h"
#include "render/pass/voxel_clip.h"
#include "render/pass/voxel_light.h"
#include "render/pass/voxel_rays.h"

namespace strata {
namespace {

constexpr uint32_t kTile = 32;  // pixels

struct Tile {
    uint32_t left, top, right, bottom;
};

std::vector<Tile> tiles_of(const GBuffer& out) {
    std::vector<Tile> tiles;
    const uint32_t end_row = out.first_row + out.rows;
    for (uint32_t top = out.first_row / kTile * kTile; top < end_row; top += kTile)
        for (uint32_t left = 0; left < out.width; left += kTile)
            tiles.push_back({left, std::max(top, out.first_row), std::min(left + kTile, out.width), std::min(top + kTile, end_row)});
    return tiles;
}

// The normal of the side that the ray comes to. Near outlines the smoothed gradient may point away from the eye a little, where the surface
// cannot: it is laid across the ray then.
Vec3f towards_eye(const Vec3f& normal, const Vec3f& direction) {
    const float away = normal.dot(direction);
    if (away <= 0.0f) return normal;
    const Vec3f across = normal - away * direction;
    const float length = across.norm();
    return length > 0.0f ? Vec3f(across / length) : Vec3f(-direction);
}

// Draws one tile after another. One a thread.
class TileDrawer {
public:
    TileDrawer(const IsosurfaceModel& model, uint32_t drawable, const IsosurfaceView& view, const VoxelRays& rays, const VoxelClip& clip)
        : model_(model),
          drawable_(drawable),
          view_(view),
          rays_(rays),
          clip_(clip),
          normals_(model.surface),
          projection_(view.camera, view.width_px, view.height_px, view.offset_px),
          sky_(sky_of(view.up)) {}

    /// returns  whether any pixel shows the surface
    bool draw(const Tile& tile, GBuffer& out) {
        const int width = int(tile.right - tile.left), height = int(tile.bottom - tile.top);
        const VoxelTile rays = rays_.tile(tile.left, tile.top, width, height);
        cast(tile, rays, out);
        bool drawn = false;
        size_t number = 0;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const FieldHit& hit = hits_[number++];
                const size_t pixel = pixel_of(tile, x, y, out);
                if (!(float(hit.t) < out.depths[pixel])) continue;
                shade(rays.ray(x, y), world_ray(tile, x, y), hit, pixel, out);
                drawn = true;
            }
        return drawn;
    }

private:
    static size_t pixel_of(const Tile& tile, int x, int y, const GBuffer& out) {
        return size_t(tile.top - out.first_row + uint32_t(y)) * out.width + tile.left + size_t(x);
    }
    // From the eye.
    MeshProjection::Ray world_ray(const Tile& tile, int x, int y) const { return projection_.ray(tile.left + x + 0.5, tile.top + y + 0.5); }

    // Fills hits_.
    void cast(const Tile& tile, const VoxelTile& rays, const GBuffer& out) {
        hits_.assign(size_t(rays.width) * size_t(rays.height), {});
        const double near = view_.camera.near_depth;
        if (clip_.everything()) {
            float farthest = 0.0f;
            for (int y = 0; y < rays.height; ++y) {
                const float* const depths = out.depths.data() + pixel_of(tile, 0, y, out);
                farthest = std::max(farthest, *std::max_element(depths, depths + rays.width));
            }
            return cast_tile(model_.surface, rays, near, double(farthest), hits_);
        }
        for (int y = 0; y < rays.height; ++y)
            for (int x = 0; x < rays.width; ++x) {
                const MeshProjection::Ray ray = world_ray(tile, x, y);
                clip_.spans({ray.origin, ray.direction}, near, double(out.depths[pixel_of(tile, x, y, out)]), spans_);
                for (const RaySpan& span : spans_)
                    if (const std::optional<FieldHit> hit = cast_ray(model_.surface, rays.ray(x, y), span.from, span.to)) {
                        hits_[size_t(y) * size_t(rays.width) + size_t(x)] = *hit;
                        break;
                    }
            }
    }

    void shade(const FieldRay& field_ray, const MeshProjection::Ray& ray, const FieldHit& hit, size_t pixel, GBuffer& out) const {
        Vec3f normal = normals_.outward(field_ray, hit);
        const Vec3f direction = ray.direction.normalized().cast<float>();
        if (normal.isZero()) normal = -direction;
        if (hit.from_inside) normal = -normal;
        normal = towards_eye(normal, direction);
        const Rgba8 color = model_.colors.color(view_.camera.eye.z() + ray.origin.z() + hit.t * ray.direction.z(), normal);
        out.colors[pixel] = model_.colors.rule() == IsosurfaceColors::Rule::normal ? color : lit(color, sky_.light(normal));
        out.depths[pixel] = float(hit.t);
        if (!out.splat_px.empty()) out.splat_px[pixel] = 1;
        if (!out.ids.empty()) out.ids[pixel] = isosurface_id(hit.cell, drawable_);
    }

    const IsosurfaceModel& model_;
    uint32_t drawable_;
    const IsosurfaceView& view_;
    const VoxelRays& rays_;
    const VoxelClip& clip_;
    FieldNormals normals_;
    MeshProjection projection_;
    Sky sky_;
    std::vector<FieldHit> hits_;
    std::vector<RaySpan> spans_;
};

}  // namespace

bool draw_isosurface(const IsosurfaceModel& model, uint32_t drawable, const IsosurfaceView& view, GBuffer& out) {
    if (model.surface.empty()) return false;
    const GridPlacement& placement = model.surface.field->placement();
    const VoxelRays rays(view.camera, placement.origin, placement.axes.inverse(), view.width_px, view.height_px, view.offset_px);
    // Clip boxes in units of the world, from the eye.
    VoxelFrame from_eye;
    from_eye.origin = view.camera.eye;
    const VoxelClip clip(view.clips, from_eye);
    const std::vector<Tile> tiles = tiles_of(out);
    std::atomic<bool> any = false;
    parallel_blocks(view.threads, tiles.size(), 4, [&](size_t begin, size_t end) {
        TileDrawer drawer(model, drawable, view, rays, clip);
        bool drawn = false;
        for (size_t n = begin; n < end; ++n) drawn |= drawer.draw(tiles[n], out);
        if (drawn) any = true;
    });
    return any;
}

}  // namespace strata
