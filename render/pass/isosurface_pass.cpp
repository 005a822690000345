#include "render/pass/isosurface_pass.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "core/parallel.h"
#include "core/surface/field_rays.h"
#include "render/pass/mesh_projection.h"
#include "render/pass/voxel_clip.h"
#include "render/pass/voxel_light.h"
#include "render/pass/voxel_rays.h"
#include "render/srgb.h"

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

// What all tiles of a picture share.
struct PictureRays {
    PictureRays(const IsosurfaceModel& shown, const IsosurfaceView& seen)
        : model(shown),
          view(seen),
          rays(seen.camera, shown.surface.field->placement().origin, shown.surface.field->placement().axes.inverse(), seen.width_px, seen.height_px,
               seen.offset_px),
          clip(seen.clips, frame_from_eye(seen.camera)),
          projection(seen.camera, seen.width_px, seen.height_px, seen.offset_px),
          sky(sky_of(seen.up)) {}

    // Clip boxes are in units of the world, from the eye.
    static VoxelFrame frame_from_eye(const Camera& camera) {
        VoxelFrame frame;
        frame.origin = camera.eye;
        return frame;
    }

    const IsosurfaceModel& model;
    const IsosurfaceView& view;
    VoxelRays rays;
    VoxelClip clip;
    MeshProjection projection;
    Sky sky;
};

// A layer of a translucent surface on a ray.
struct RayLayer {
    FieldHit hit;
    int in_cell = 1;  // hits in its cell up to this one
};

// Where the rays of one tile after another meet a surface. One a thread.
class TileHits {
public:
    explicit TileHits(const PictureRays& picture) : picture_(picture), normals_(picture.model.surface) {}

    // The first hits; those that lie behind what is there may be missing.
    void cast(const Tile& tile, const GBuffer& out) {
        tile_ = tile;
        rays_ = picture_.rays.tile(tile.left, tile.top, int(tile.right - tile.left), int(tile.bottom - tile.top));
        hits_.assign(size_t(rays_.width) * size_t(rays_.height), {});
        const double near = picture_.view.camera.near_depth;
        if (picture_.clip.everything()) {
            float farthest = 0.0f;
            for (int y = 0; y < rays_.height; ++y) {
                const float* const depths = out.depths.data() + pixel_of(tile, 0, y, out);
                farthest = std::max(farthest, *std::max_element(depths, depths + rays_.width));
            }
            return cast_tile(picture_.model.surface, rays_, near, double(farthest), hits_);
        }
        for (int y = 0; y < rays_.height; ++y)
            for (int x = 0; x < rays_.width; ++x)
                if (const auto hit = next_hit(x, y, near, double(out.depths[pixel_of(tile, x, y, out)]))) hits_[size_t(y) * size_t(rays_.width) + size_t(x)] = *hit;
    }
    const FieldHit& hit(int x, int y) const { return hits_[size_t(y) * size_t(rays_.width) + size_t(x)]; }

    // Goes from a hit of a pixel's ray to the next; t is infinite where there is none.
    void go_on(int x, int y, RayLayer& layer, double far) {
        const VoxelRay ray = rays_.ray(x, y);
        // So far beyond that the side on which the ray now is can be told, from far away too.
        constexpr double kBeyond = 0x1p-24, kBeyondPart = 0x1p-44;  // cells; of the distance
        double near = layer.hit.t;
        if (layer.in_cell == kMostInCell) near = std::max(near, leaves(ray, layer.hit.cell));
        near += std::max(kBeyond / ray.direction.cwiseAbs().maxCoeff(), kBeyondPart * near);
        const FieldHit next = next_hit(x, y, near, far).value_or(FieldHit{});
        layer.in_cell = next.cell == layer.hit.cell ? layer.in_cell % kMostInCell + 1 : 1;
        layer.hit = next;
    }

    Rgba8 lit_color(int x, int y, const FieldHit& hit) const {
        const MeshProjection::Ray ray = world_ray(x, y);
        Vec3f normal = normals_.outward(rays_.ray(x, y), hit);
        const Vec3f direction = ray.direction.normalized().cast<float>();
        if (normal.isZero()) normal = -direction;
        if (hit.from_inside) normal = -normal;
        normal = towards_eye(normal, direction);
        const IsosurfaceColors& colors = picture_.model.colors;
        const Rgba8 color = colors.color(picture_.view.camera.eye.z() + ray.origin.z() + hit.t * ray.direction.z(), normal);
        return colors.rule() == IsosurfaceColors::Rule::normal ? color : lit(color, picture_.sky.light(normal));
    }

    static size_t pixel_of(const Tile& tile, int x, int y, const GBuffer& out) {
        return size_t(tile.top - out.first_row + uint32_t(y)) * out.width + tile.left + size_t(x);
    }

private:
    // A cubic has three roots. A ray along the surface may meet it more often, by rounding: so it comes to an end.
    static constexpr int kMostInCell = 3;

    // Where a ray leaves a cell.
    static double leaves(const VoxelRay& ray, const std::array<int32_t, 3>& cell) {
        double t = std::numeric_limits<double>::infinity();
        for (int a = 0; a < 3; ++a)
            if (const double step = ray.direction[a]; step != 0.0) t = std::min(t, (cell[size_t(a)] + (step > 0.0) - ray.origin[a]) / step);
        return t;
    }

    // From the eye.
    MeshProjection::Ray world_ray(int x, int y) const { return picture_.projection.ray(tile_.left + x + 0.5, tile_.top + y + 0.5); }

    std::optional<FieldHit> next_hit(int x, int y, double near, double far) {
        const VoxelRay ray = rays_.ray(x, y);
        if (picture_.clip.everything()) return cast_ray(picture_.model.surface, ray, near, far);
        const MeshProjection::Ray in_world = world_ray(x, y);
        picture_.clip.spans({in_world.origin, in_world.direction}, near, far, spans_);
        for (const RaySpan& span : spans_)
            if (const std::optional<FieldHit> hit = cast_ray(picture_.model.surface, ray, span.from, span.to)) return hit;
        return std::nullopt;
    }

    const PictureRays& picture_;
    FieldNormals normals_;
    Tile tile_ = {};
    VoxelTile rays_;
    std::vector<FieldHit> hits_;
    std::vector<RaySpan> spans_;
};

void set_place(size_t pixel, float depth, PixelId id, GBuffer& out) {
    out.depths[pixel] = depth;
    if (!out.splat_px.empty()) out.splat_px[pixel] = 1;
    if (!out.ids.empty()) out.ids[pixel] = id;
}

// Draws tiles on several threads. draw(drawer, tile) gives what was drawn; make() a drawer for a thread
template <class Make, class Draw>
IsosurfacesDrawn draw_tiles(int threads, const GBuffer& out, const Make& make, const Draw& draw) {
    const std::vector<Tile> tiles = tiles_of(out);
    std::mutex adding;
    IsosurfacesDrawn drawn;
    parallel_blocks(threads, tiles.size(), 4, [&](size_t begin, size_t end) {
        auto drawer = make();
        IsosurfacesDrawn part;
        for (size_t n = begin; n < end; ++n) part.add(draw(drawer, tiles[n]));
        const std::lock_guard lock(adding);
        drawn.add(part);
    });
    return drawn;
}

constexpr float kHidden = 1.0f / 512.0f;  // half a step of 8 bits: what lets no more light pass hides all

// Layers from the eye on, over a pixel.
class LayerLight {
public:
    void add(Rgba8 color, float opacity) {
        const std::array<float, 256>& linear = linear_from_srgb8();
        const float part = passing_ * opacity * (float(alpha_of(color)) / 255.0f);
        light_ += part * Vec3f(linear[red_of(color)], linear[green_of(color)], linear[blue_of(color)]);
        passing_ -= part;
    }
    bool hides_all() const { return passing_ < kHidden; }
    Rgba8 color() const {
        const float hidden = std::max(1.0f - passing_, 0x1p-24f);  // of a very low opacity none remains
        const Vec3f light = light_ / hidden;
        return make_rgba(srgb8_from_linear(light.x()), srgb8_from_linear(light.y()), srgb8_from_linear(light.z()), uint8_t(std::clamp(hidden * 255.0f + 0.5f, 1.0f, 255.0f)));
    }

private:
    Vec3f light_ = Vec3f::Zero();
    float passing_ = 1.0f;
};

}  // namespace

IsosurfacesDrawn draw_isosurface(const IsosurfaceModel& model, uint32_t drawable, const IsosurfaceView& view, GBuffer& out) {
    if (model.surface.empty()) return {};
    const PictureRays picture(model, view);
    return draw_tiles(view.threads, out, [&] { return TileHits(picture); }, [&](TileHits& hits, const Tile& tile) {
        hits.cast(tile, out);
        IsosurfacesDrawn drawn;
        for (int y = 0; y < int(tile.bottom - tile.top); ++y)
            for (int x = 0; x < int(tile.right - tile.left); ++x) {
                ++drawn.rays;
                const FieldHit& hit = hits.hit(x, y);
                const size_t pixel = TileHits::pixel_of(tile, x, y, out);
                if (!(float(hit.t) < out.depths[pixel])) continue;
                out.colors[pixel] = hits.lit_color(x, y, hit);
                set_place(pixel, float(hit.t), isosurface_id(hit.cell, drawable), out);
                ++drawn.hits;
            }
        return drawn;
    });
}

IsosurfacesDrawn draw_translucent(std::span<const IsosurfaceModel> models, uint32_t first, const IsosurfaceView& view, GBuffer& out) {
    std::vector<std::unique_ptr<PictureRays>> pictures;
    std::vector<uint32_t> drawables;
    for (size_t i = 0; i < models.size(); ++i) {
        if (models[i].surface.empty() || models[i].opacity >= 1.0f) continue;
        pictures.push_back(std::make_unique<PictureRays>(models[i], view));
        drawables.push_back(first + uint32_t(i));
    }
    if (pictures.empty()) return {};
    const auto make = [&] {
        std::vector<TileHits> surfaces;
        for (const auto& picture : pictures) surfaces.emplace_back(*picture);
        return surfaces;
    };
    return draw_tiles(view.threads, out, make, [&](std::vector<TileHits>& surfaces, const Tile& tile) {
        for (TileHits& surface : surfaces) surface.cast(tile, out);
        IsosurfacesDrawn drawn;
        std::vector<RayLayer> next(surfaces.size());  // of each surface
        for (int y = 0; y < int(tile.bottom - tile.top); ++y)
            for (int x = 0; x < int(tile.right - tile.left); ++x) {
                drawn.rays += surfaces.size();
                const size_t pixel = TileHits::pixel_of(tile, x, y, out);
                const float depth = out.depths[pixel];
                for (size_t n = 0; n < surfaces.size(); ++n) next[n] = {surfaces[n].hit(x, y)};
                LayerLight light;
                bool met = false;
                for (;;) {
                    // Of equally near ones the first.
                    const size_t n = size_t(std::min_element(next.begin(), next.end(), [](const RayLayer& a, const RayLayer& b) { return a.hit.t < b.hit.t; }) - next.begin());
                    const FieldHit& hit = next[n].hit;
                    if (!(float(hit.t) < depth)) break;
                    if (!met) set_place(pixel, float(hit.t), isosurface_id(hit.cell, drawables[n]), out);
                    met = true;
                    light.add(surfaces[n].lit_color(x, y, hit), pictures[n]->model.opacity);
                    if (light.hides_all()) break;
                    surfaces[n].go_on(x, y, next[n], double(depth));
                }
                if (!met) continue;
                if (alpha_of(out.colors[pixel]) > 0) light.add(out.colors[pixel], 1.0f);
                out.colors[pixel] = light.color();
                ++drawn.hits;
            }
        return drawn;
    });
}

}  // namespace strata
