#include "render/pass/isosurface_pass.h"

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <vector>

#include "core/parallel.h"
#include "render/pass/mesh_projection.h"
#include "render/pass/voxel_clip.h"
#include "render/pass/voxel_light.h"

namespace strata {
namespace {

constexpr uint32_t kTile = 32;  // pixels

struct Tile {
    uint32_t left, top, right, bottom;
};

// The rays of a picture's pixels: in samples of the field, and in the world for clip boxes.
struct PictureRays {
    PictureRays(const FieldBricks& field, const IsosurfaceView& view)
        : projection(view.camera, view.width_px, view.height_px, view.offset_px),
          index_from_world(field.placement().axes.inverse()),
          eye_index(index_from_world * (view.camera.eye - field.placement().origin)) {}

    FieldRay field_ray(const MeshProjection::Ray& ray) const {
        return {eye_index + index_from_world * ray.origin, index_from_world * ray.direction};
    }

    MeshProjection projection;
    Mat3d index_from_world;
    Vec3d eye_index;
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

}  // namespace

bool draw_isosurface(const IsosurfaceModel& model, uint32_t drawable, const IsosurfaceView& view, GBuffer& out) {
    const FieldBricks& field = *model.field;
    if (field.empty()) return false;
    const PictureRays rays(field, view);
    // Clip boxes in units of the world, from the eye.
    VoxelFrame from_eye;
    from_eye.origin = view.camera.eye;
    const VoxelClip clip(view.clips, from_eye);
    const Sky sky = sky_of(view.up);
    const std::vector<Tile> tiles = tiles_of(out);
    std::atomic<bool> any = false;
    parallel_blocks(view.threads, tiles.size(), 4, [&](size_t begin, size_t end) {
        std::vector<RaySpan> spans;
        bool drawn = false;
        for (size_t n = begin; n < end; ++n)
            for (uint32_t y = tiles[n].top; y < tiles[n].bottom; ++y)
                for (uint32_t x = tiles[n].left; x < tiles[n].right; ++x) {
                    const size_t pixel = size_t(y - out.first_row) * out.width + x;
                    const MeshProjection::Ray ray = rays.projection.ray(x + 0.5, y + 0.5);
                    const FieldRay field_ray = rays.field_ray(ray);
                    const double near = view.camera.near_depth, far = double(out.depths[pixel]);
                    clip.spans({ray.origin, ray.direction}, near, far, spans);
                    std::optional<FieldHit> hit;
                    for (const RaySpan& span : spans)
                        if ((hit = cast_ray(field, model.level, field_ray, span.from, span.to))) break;
                    if (!hit || !(float(hit->t) < out.depths[pixel])) continue;
                    Vec3f normal = outward_normal(field, model.level, field_ray, *hit);
                    const Vec3f direction = ray.direction.normalized().cast<float>();
                    if (normal.isZero()) normal = -direction;
                    if (hit->from_inside) normal = -normal;
                    normal = towards_eye(normal, direction);
                    const Rgba8 color = model.colors.color(view.camera.eye.z() + ray.origin.z() + hit->t * ray.direction.z(), normal);
                    out.colors[pixel] = model.colors.rule() == IsosurfaceColors::Rule::normal ? color : lit(color, sky.light(normal));
                    out.depths[pixel] = float(hit->t);
                    if (!out.splat_px.empty()) out.splat_px[pixel] = 1;
                    if (!out.ids.empty()) out.ids[pixel] = isosurface_id(hit->cell, drawable);
                    drawn = true;
                }
        if (drawn) any = true;
    });
    return any;
}

}  // namespace strata
