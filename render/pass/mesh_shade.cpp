#include "render/pass/mesh_shade.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/surface/corner_normals.h"
#include "render/srgb.h"

namespace strata {
namespace {

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

// The color of a pixel of a block.
Rgba8 color_of(const MeshModel& model, const MeshProjection& view, const ShadeBlock& block, size_t i, uint32_t triangle) {
    const bool front = block.front[i] != 0;
    const Vec3f normal(block.normal[0][i], block.normal[1][i], block.normal[2][i]);
    Vec3f light = !front && model.style.mark_backs
                      ? linear_light(kBackColor)
                      : model.colors.light(*model.mesh, triangle, Vec3f(block.weights[0][i], block.weights[1][i], block.weights[2][i]), block.z[i], normal);
    if (model.colors.rule() != MeshColors::Rule::normal) light *= block.light[i];
    if (model.style.wireframe) {
        const auto& [a, b, c] = model.mesh->triangles[triangle];
        const MeshProjection::Ray ray = view.ray(block.x_px[i], block.y_px);
        const std::array<Vec3d, 3> corners = {model.mesh->positions[a] - view.eye, model.mesh->positions[b] - view.eye, model.mesh->positions[c] - view.eye};
        light *= 1.0f - kLineDarkness * wire_cover(view, meet(corners, ray), ray);
    }
    return make_rgba(srgb8_from_linear(light[0]), srgb8_from_linear(light[1]), srgb8_from_linear(light[2]));
}

}  // namespace

bool MeshShade::draw_row(uint32_t row, uint32_t left, uint32_t right, GBuffer& out) const {
    const TriangleMesh& mesh = *model.mesh;
    const uint64_t* const words = target.words + size_t(row) * target.width;
    const size_t first_pixel = size_t(target.first_row + row - out.first_row) * out.width;
    const bool smooth = !model.corners.empty();
    ShadeBlock block;
    block.y_px = double(target.first_row + row) + 0.5;
    std::fill(block.packed[0], block.packed[0] + 3 * kShadeBlock, kNoNormal);
    std::fill(block.x_px, block.x_px + kShadeBlock, 0.0);
    std::fill(block.corners[0], block.corners[0] + 9 * kShadeBlock, 0.0);
    std::array<uint32_t, kShadeBlock> columns;
    bool drawn = false;
    for (uint32_t next = left; next < right;) {
        block.count = 0;
        for (; next < right && block.count < kShadeBlock; ++next) {
            columns[block.count] = next;
            block.count += words[next] != 0;
        }
        if (block.count == 0) break;
        // What they show lies anywhere in memory.
        for (size_t i = 0; i < block.count; ++i) {
            const uint32_t triangle = ~uint32_t(words[columns[i]]);
            __builtin_prefetch(&mesh.triangles[triangle]);
            if (smooth) __builtin_prefetch(&model.corners[3 * size_t(triangle)]);
        }
        for (size_t i = 0; i < block.count; ++i)
            for (const uint32_t vertex : mesh.triangles[~uint32_t(words[columns[i]])]) __builtin_prefetch(&mesh.positions[vertex]);
        for (size_t i = 0; i < block.count; ++i) {
            const size_t triangle = ~uint32_t(words[columns[i]]);
            block.x_px[i] = double(columns[i]) + 0.5;
            for (size_t corner = 0; corner < 3; ++corner) {
                const Vec3d& p = mesh.positions[mesh.triangles[triangle][corner]];
                for (size_t axis = 0; axis < 3; ++axis) block.corners[3 * corner + axis][i] = p[int(axis)];
                if (smooth) block.packed[corner][i] = model.corners[3 * triangle + corner];
            }
        }
        meet_triangles(view, sky, block);
        for (size_t i = 0; i < block.count; ++i) {
            const size_t pixel = first_pixel + columns[i];
            if (!(block.depth[i] < out.depths[pixel])) continue;
            const uint32_t triangle = ~uint32_t(words[columns[i]]);
            drawn = true;
            out.colors[pixel] = color_of(model, view, block, i, triangle);
            out.depths[pixel] = block.depth[i];
            if (!out.splat_px.empty()) out.splat_px[pixel] = 1;
            if (!out.ids.empty()) out.ids[pixel] = make_pixel_id(block.front[i] != 0 ? kFrontSlot : kBackSlot, triangle, drawable);
        }
    }
    return drawn;
}

}  // namespace strata
