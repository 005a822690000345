#include "render/pass/voxels_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "render/pass/voxel_light.h"

namespace strata {
namespace {

constexpr double kLineWidth = 1.0;      // pixels, of the borders of cells
constexpr double kLineDarkness = 0.3;   // of linear light, in full
constexpr double kLeastLined = 4.0;     // pixels that a cell's side takes where borders begin to show, and
constexpr double kWholeLined = 16.0;    // where they show in full

constexpr double kSurfaceRadius = 4.0;  // cells around that decide a smooth surface, and
constexpr double kDistantRadius = 2.5;  // the light of flat cells too small to be seen as cubes: those that look
// It is asked so many radii before the ray's hit, as layers of voxels have holes of one, in which its middle would lie all around.
constexpr double kStandBack = 0.25;
constexpr double kLeastCube = 2.0;      // so many pixels large or less; larger ones get ever more of their faces' light, and
constexpr double kWholeCube = 4.0;      // at this size all of it. Faces by themselves would show as rings where pixels meet them in turn
constexpr double kDistantRelief = 2.0;  // cells that their steps, which are none of the surface, reach
constexpr double kMostSmoothed = 1.5;  // cells along the ray, between a cube's depth and that of the surface it stands for

Vec3f face_normal(CellFace face) {
    Vec3f normal = Vec3f::Zero();
    normal[int(face) / 2] = int(face) % 2 == 0 ? -1.0f : 1.0f;
    return normal;
}

// How much of a pixel the border of a cell's face covers, where cells are large enough to have one.
double border_cover(const VoxelTile& picture, const VoxelRay& ray, const VoxelHit& hit, int face_axis, double side) {
    const Vec3d p = (ray.origin + hit.t * ray.direction) / side;
    // What the next pixels, to the right and below, see of the face's plane.
    const Vec3d moves[2] = {picture.origin_per_x + hit.t * picture.direction_per_x, picture.origin_per_y + hit.t * picture.direction_per_y};
    double cover = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        if (axis == face_axis) continue;
        double per_pixel = 0.0;  // cells
        for (const Vec3d& move : moves)
            per_pixel = std::hypot(per_pixel, (move[axis] - ray.direction[axis] * (move[face_axis] / ray.direction[face_axis])) / side);
        const double side_px = 1.0 / per_pixel;
        const double strength = std::clamp((side_px - kLeastLined) / (kWholeLined - kLeastLined), 0.0, 1.0);
        if (!(strength > 0.0)) continue;
        const double place = p[axis] - std::floor(p[axis]);
        const double distance_px = std::min(place, 1.0 - place) * side_px;
        cover = std::max(cover, strength * std::clamp(0.5 * kLineWidth + 0.5 - distance_px, 0.0, 1.0));
    }
    return cover;
}

}  // namespace

// Fills hits_ and faces_.
void VoxelTileKernel::cast(const TileRect& rect, const GBuffer& out) {
    const size_t pixels = size_t(rect.width) * size_t(rect.height);
    hits_.assign(pixels, {});
    faces_.resize(pixels);
    RayLimits limits = in_.limits;
    float farthest = 0.0f;
    for (int y = 0; y < rect.height; ++y) {
        const float* const depths = out.depths.data() + size_t(rect.y - out.first_row + uint32_t(y)) * out.width + rect.x;
        farthest = std::max(farthest, *std::max_element(depths, depths + rect.width));
    }
    limits.most_t = std::min<double>(limits.most_t, farthest);
    const VoxelTree& tree = *in_.model.tree;
    const VoxelTile tile = in_.rays.tile(rect.x, rect.y, rect.width, rect.height);
    if (in_.clip.everything()) {
        cast_tile(tree, tile, limits, hits_);
        for (size_t i = 0; i < pixels; ++i) faces_[i] = hits_[i].face;
        return;
    }
    for (int y = 0; y < rect.height; ++y)
        for (int x = 0; x < rect.width; ++x) {
            const size_t i = size_t(y) * size_t(rect.width) + size_t(x);
            const VoxelRay ray = tile.ray(x, y);
            in_.clip.spans(ray, limits.least_t, limits.most_t, spans_);
            for (const RaySpan& span : spans_) {
                RayLimits part = limits;
                part.least_t = span.from;
                part.most_t = span.to;
                const std::optional<VoxelHit> hit = cast_ray(tree, ray, part);
                if (!hit) continue;
                hits_[i] = *hit;
                faces_[i] = hit->face == CellFace::inside ? span.face : hit->face;
                break;
            }
        }
}

// What rise_over_cells says some way before a hit.
Vec3f VoxelTileKernel::rise_before(const VoxelRay& ray, const VoxelHit& hit, double radius) {
    const double side = double(uint32_t{1} << (in_.model.tree->frame.depth() - hit.depth));
    return rise_over_cells(blocks_, hit.depth, (ray.origin + hit.t * ray.direction) / side - kStandBack * radius * ray.direction.normalized(), radius);
}

VoxelTileKernel::Smooth VoxelTileKernel::smooth_at(const VoxelRay& ray, const VoxelHit& hit, CellFace face) {
    const double side = double(uint32_t{1} << (in_.model.tree->frame.depth() - hit.depth));
    const Vec3f rise = rise_before(ray, hit, kSurfaceRadius), direction = ray.direction.normalized().cast<float>();
    Vec3f normal = stored_normal(*in_.model.tree, hit);
    if (normal.isZero()) normal = rise;
    if (normal.isZero()) return {face_normal(face), hit.t};
    // Of a surface both sides can be seen.
    if (normal.dot(direction) > 0.0f) normal = -normal;
    normal.normalize();
    // It lies half a cell over the middle of its cells, so that flat ground is as high as its voxels.
    const double fall = -normal.dot(direction), above = normal.dot(rise) - 0.5 - kStandBack * kSurfaceRadius * fall;  // cells
    const double farther = std::clamp(above / std::max(fall, 1e-6), -kMostSmoothed, kMostSmoothed) * side / ray.direction.norm();
    return {normal, std::max(hit.t + farther, in_.limits.least_t)};  // before the eye is nothing
}

float VoxelTileKernel::distant_light(const VoxelRay& ray, const VoxelHit& hit, const Vec3f& face_up) {
    const Vec3f rise = rise_before(ray, hit, kDistantRadius);
    if (rise.isZero()) return in_.sky.light(face_up);
    const Vec3f normal = rise.normalized();
    return in_.sky.light(normal.dot(ray.direction.cast<float>()) > 0.0f ? Vec3f(-normal) : normal);
}

void VoxelTileKernel::shade(const VoxelRay& ray, const VoxelHit& hit, CellFace face, double pixel_voxels, size_t pixel, GBuffer& out) {
    const VoxelModel& model = in_.model;
    const double side = double(uint32_t{1} << (model.tree->frame.depth() - hit.depth));
    const bool cut = hit.face == CellFace::inside, flat = model.shading == VoxelShading::flat || cut;
    const Vec3f face_up = face == CellFace::inside ? Vec3f(in_.towards_eye.cast<float>()) : face_normal(face);
    const Smooth smooth = flat ? Smooth{face_up, hit.t} : smooth_at(ray, hit, face);
    const Vec3f& normal = smooth.normal;
    const double side_px = side / pixel_voxels;
    const double distant = flat && !cut ? std::clamp((kWholeCube - side_px) / (kWholeCube - kLeastCube), 0.0, 1.0) : 0.0;
    Rgba8 color = model.colors.color(*model.tree, hit, normal);
    if (model.colors.rule() != VoxelColors::Rule::normal) {
        float light = in_.sky.light(normal);
        if (distant > 0.0) light += float(distant) * (distant_light(ray, hit, normal) - light);
        if (flat && face != CellFace::inside && side_px > kLeastLined)
            light *= 1.0f - float(kLineDarkness * border_cover(in_.rays.picture(), ray, hit, int(face) / 2, side));
        color = lit(color, light);
    }
    out.colors[pixel] = color;
    out.depths[pixel] = float(smooth.t);
    if (!out.splat_px.empty()) out.splat_px[pixel] = uint8_t(std::clamp(flat ? 1.5 + distant * (kDistantRelief * side_px - 1.0) : side_px + 0.5, 1.0, 255.0));
    if (!out.ids.empty()) out.ids[pixel] = make_pixel_id(voxel_slot(hit, face), hit.node, in_.drawable);
}

void VoxelTileKernel::draw(const TileRect& rect, GBuffer& out, VoxelsDrawn& drawn) {
    cast(rect, out);
    const VoxelTile tile = in_.rays.tile(rect.x, rect.y, rect.width, rect.height);
    for (int y = 0; y < rect.height; ++y)
        for (int x = 0; x < rect.width; ++x) {
            const size_t i = size_t(y) * size_t(rect.width) + size_t(x);
            const size_t pixel = size_t(rect.y - out.first_row + uint32_t(y)) * out.width + rect.x + size_t(x);
            const VoxelHit& hit = hits_[i];
            const float depth = float(hit.t);
            if (hit.depth == 0 || !(depth < out.depths[pixel])) continue;
            const double pixel_voxels = in_.rays.pixel_size(hit.t);
            shade(tile.ray(x, y), hit, faces_[i], pixel_voxels, pixel, out);
            drawn.add_cell(*in_.model.tree, hit.depth, pixel_voxels, in_.error_px);
        }
}

}  // namespace strata
