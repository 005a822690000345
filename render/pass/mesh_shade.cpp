#include "render/pass/mesh_shade.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/surface/corner_normals.h"
#include "render/sky_light.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr size_t kAhead = 32;  // pixels that are looked up before they are drawn

constexpr float kLineWidth = 1.0f;     // pixels, of wires
constexpr float kLineDarkness = 0.75f;  // of linear light, in full
constexpr float kLeastLined = 2.0f;    // pixels that a triangle is high where its wires begin to show, and
constexpr float kWholeLined = 6.0f;    // where they show in full
constexpr Rgba8 kBackColor = make_rgba(214, 92, 72);

// Where a ray meets a triangle's plane. A weight is over / det, both linear in the picture.
struct PlaneHit {
    Vec3d edge_b, edge_c;    // from the first corner
    Vec3d cross_c;           // direction x edge_c
    Vec3d from;              // first corner to the ray's origin
    double det, over_b, over_c;
};

PlaneHit meet(const std::array<Vec3d, 3>& corners, const MeshProjection::Ray& ray) {
    PlaneHit hit;
    hit.edge_b = corners[1] - corners[0];
    hit.edge_c = corners[2] - corners[0];
    hit.cross_c = ray.direction.cross(hit.edge_c);
    hit.from = ray.origin - corners[0];
    hit.det = hit.edge_b.dot(hit.cross_c);
    hit.over_b = hit.from.dot(hit.cross_c);
    hit.over_c = ray.direction.dot(hit.from.cross(hit.edge_b));
    return hit;
}

// Of the corners, within the triangle, as a pixel's center may lie beside it by the rounding of corners.
Vec3d weights_of(const PlaneHit& hit) {
    double b = hit.over_b / hit.det, c = hit.over_c / hit.det;
    b = b > 0.0 ? std::min(b, 1.0) : 0.0;  // 0 for NaN, too
    c = c > 0.0 ? std::min(c, 1.0) : 0.0;
    const double sum = b + c;
    if (sum > 1.0) b /= sum, c /= sum;
    return {std::max(1.0 - b - c, 0.0), b, c};
}

// On the triangle's plane, but not beyond its corners: seen from the side, the plane may be anywhere.
double depth_of(const MeshProjection& view, const PlaneHit& hit, const Vec3d& first, const Vec3d& weights) {
    const double at_first = view.forward.dot(first), to_b = view.forward.dot(hit.edge_b), to_c = view.forward.dot(hit.edge_c);
    const double on_plane = at_first + (hit.over_b * to_b + hit.over_c * to_c) / hit.det;
    const double depth = std::isfinite(on_plane) ? std::clamp(on_plane, at_first + std::min({0.0, to_b, to_c}), at_first + std::max({0.0, to_b, to_c}))
                                                 : at_first + weights[1] * to_b + weights[2] * to_c;
    return std::max(depth, view.near_depth);
}

// How much of a pixel the wires of its triangle cover, where triangles are large enough to have them.
float wire_cover(const MeshProjection& view, const PlaneHit& hit, const MeshProjection::Ray& ray) {
    // What `over` and `det` change by to the next pixel, right and down.
    Eigen::Matrix<double, 3, 2> change;  // rows: b, c, det
    for (int axis = 0; axis < 2; ++axis) {
        const Vec3d& step = axis == 0 ? view.right : view.down;
        if (view.perspective) {
            const Vec3d turned = step.cross(hit.edge_c);
            change.col(axis) = Vec3d(hit.from.dot(turned), step.dot(hit.from.cross(hit.edge_b)), hit.edge_b.dot(turned));
        } else {
            change.col(axis) = Vec3d(step.dot(hit.cross_c), ray.direction.dot(step.cross(hit.edge_b)), 0.0);
        }
    }
    const double over[3] = {hit.det - hit.over_b - hit.over_c, hit.over_b, hit.over_c};
    const Vec2d slope[3] = {(change.row(2) - change.row(0) - change.row(1)).transpose(), change.row(0).transpose(), change.row(1).transpose()};
    float cover = 0.0f, strength = 1.0f;
    for (int i = 0; i < 3; ++i) {
        const double length = slope[i].norm();
        if (!(length > 0.0)) return 0.0f;
        const float distance_px = float(std::abs(over[i]) / length), height_px = float(std::abs(hit.det) / length);
        cover = std::max(cover, std::clamp(0.5f * kLineWidth + 0.5f - distance_px, 0.0f, 1.0f));
        strength = std::min(strength, std::clamp((height_px - kLeastLined) / (kWholeLined - kLeastLined), 0.0f, 1.0f));
    }
    return cover * strength;
}

Vec3f smooth_normal(const MeshModel& model, uint32_t triangle, const Vec3f& weights, const Vec3f& face) {
    const uint32_t* const packed = model.corners.data() + 3 * size_t(triangle);
    if (packed[0] == kNoNormal) return face;
    if (packed[0] == packed[1] && packed[0] == packed[2]) return unpack_normal(packed[0]);
    const Vec3f sum = weights[0] * unpack_normal(packed[0]) + weights[1] * unpack_normal(packed[1]) + weights[2] * unpack_normal(packed[2]);
    const float square = sum.squaredNorm();
    return square > 0.0f ? Vec3f(sum / std::sqrt(square)) : face;
}

}  // namespace

bool MeshShade::draw_row(uint32_t row, uint32_t left, uint32_t right, GBuffer& out) const {
    const TriangleMesh& mesh = *model.mesh;
    const uint64_t* const words = target.words + size_t(row) * target.width;
    const size_t first_pixel = size_t(target.first_row + row - out.first_row) * out.width;
    const double y = double(target.first_row + row) + 0.5;
    const bool smooth = !model.corners.empty(), by_normal = model.colors.rule() == MeshColors::Rule::normal;
    bool drawn = false;
    for (uint32_t begin = left; begin < right; begin += kAhead) {
        const uint32_t end = std::min<uint32_t>(begin + kAhead, right);
        // What they show lies anywhere in memory.
        for (uint32_t x = begin; x < end; ++x)
            if (words[x] != 0) __builtin_prefetch(&mesh.triangles[~uint32_t(words[x])]);
        for (uint32_t x = begin; x < end; ++x) {
            if (words[x] == 0) continue;
            const uint32_t triangle = ~uint32_t(words[x]);
            for (const uint32_t vertex : mesh.triangles[triangle]) __builtin_prefetch(&mesh.positions[vertex]);
            if (smooth) __builtin_prefetch(&model.corners[3 * size_t(triangle)]);
        }
        for (uint32_t x = begin; x < end; ++x) {
            if (words[x] == 0) continue;
            const uint32_t triangle = ~uint32_t(words[x]);
            const auto& [a, b, c] = mesh.triangles[triangle];
            const std::array<Vec3d, 3> corners = {mesh.positions[a] - view.eye, mesh.positions[b] - view.eye, mesh.positions[c] - view.eye};
            const MeshProjection::Ray ray = view.ray(double(x) + 0.5, y);
            const PlaneHit hit = meet(corners, ray);
            const Vec3d weights = weights_of(hit);
            const float depth = float(depth_of(view, hit, corners[0], weights));
            const size_t pixel = first_pixel + x;
            if (!(depth < out.depths[pixel])) continue;
            drawn = true;

            const bool front = hit.det >= 0.0;
            Vec3f face = hit.edge_b.cross(hit.edge_c).stableNormalized().cast<float>();
            if (!(face.squaredNorm() > 0.5f)) face = (front ? -view.forward : view.forward).cast<float>();  // no area
            const Vec3f parts = weights.cast<float>();
            Vec3f normal = smooth ? smooth_normal(model, triangle, parts, face) : face;
            if (!front) normal = -normal;
            Vec3f light;
            if (!front && model.style.mark_backs) {
                light = linear_light(kBackColor);
            } else {
                const double z = view.eye.z() + corners[0].z() + weights[1] * hit.edge_b.z() + weights[2] * hit.edge_c.z();
                light = model.colors.light(mesh, triangle, parts, z, normal);
            }
            if (!by_normal) light *= sky_light(normal);
            if (model.style.wireframe) light *= 1.0f - kLineDarkness * wire_cover(view, hit, ray);
            out.colors[pixel] = make_rgba(srgb8_from_linear(light[0]), srgb8_from_linear(light[1]), srgb8_from_linear(light[2]));
            out.depths[pixel] = depth;
            if (!out.splat_px.empty()) out.splat_px[pixel] = 1;
            if (!out.ids.empty()) out.ids[pixel] = make_pixel_id(front ? kFrontSlot : kBackSlot, triangle, drawable);
        }
    }
    return drawn;
}

}  // namespace strata
