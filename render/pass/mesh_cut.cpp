#include "render/pass/mesh_cut.h"

#include <algorithm>
#include <cmath>

namespace strata {
namespace {

// Linear in the world: x / w and y / w are pixels, and w is 1 in orthographic projection.
struct Corner {
    Vec4d place;             // x, y, w, depth
    int whole = -1;          // the triangle's corner that this is; -1: made by a cut
};

struct Polygon {
    static constexpr size_t kMost = kMostPieces + 2;

    std::array<Corner, kMost + 2> corners;  // room for what rounding may add to a sliver
    size_t count = 0;
};

// distance  of a place from the plane, above 0 where it stays
template <typename Distance>
void cut(Polygon& polygon, const Distance& distance) {
    Polygon left;
    for (size_t i = 0; i < polygon.count && left.count < Polygon::kMost; ++i) {
        const Corner &from = polygon.corners[i], &to = polygon.corners[(i + 1) % polygon.count];
        const double d = distance(from.place), e = distance(to.place);
        if (d >= 0.0) left.corners[left.count++] = from;
        if ((d >= 0.0) == (e >= 0.0)) continue;
        const Corner &stays = d >= 0.0 ? from : to, &goes = d >= 0.0 ? to : from;
        const double s = d >= 0.0 ? d : e, g = d >= 0.0 ? e : d;
        left.corners[left.count++].place = stays.place + s / (s - g) * (goes.place - stays.place);
    }
    polygon = left;
    polygon.count = std::min(polygon.count, Polygon::kMost);
}

}  // namespace

size_t cut_triangle(const MeshProjection& view, uint32_t width_px, uint32_t height_px, const std::array<Vec3d, 3>& corners,
                    const std::array<ProjectedVertex, 3>& projected, uint32_t number, std::array<RasterTriangle, kMostPieces>& pieces) {
    Polygon polygon;
    for (size_t i = 0; i < 3; ++i) {
        const Vec3d d = corners[i] - view.eye;
        const double depth = view.forward.dot(d), w = view.perspective ? depth : 1.0;
        polygon.corners[i] = {Vec4d(view.center_x * w + view.x_row.dot(d), view.center_y * w + view.y_row.dot(d), w, depth), int(i)};
        if (!polygon.corners[i].place.allFinite()) return 0;
    }
    polygon.count = 3;
    const auto all_beside = [&](const auto& inside) {
        return std::none_of(polygon.corners.begin(), polygon.corners.begin() + 3, [&](const Corner& corner) { return inside(corner.place) >= 0.0; });
    };
    if (all_beside([](const Vec4d& p) { return p[0]; }) || all_beside([&](const Vec4d& p) { return width_px * p[2] - p[0]; }) ||
        all_beside([](const Vec4d& p) { return p[1]; }) || all_beside([&](const Vec4d& p) { return height_px * p[2] - p[1]; }))
        return 0;
    cut(polygon, [&](const Vec4d& p) { return p[3] - view.near_depth; });
    for (const double side : {-1.0, 1.0})
        for (const int axis : {0, 1}) cut(polygon, [&](const Vec4d& p) { return kGuardPx * p[2] + side * p[axis]; });
    if (polygon.count < 3) return 0;

    std::array<ProjectedVertex, Polygon::kMost> snapped;
    for (size_t i = 0; i < polygon.count; ++i) {
        const Corner& corner = polygon.corners[i];
        if (corner.whole >= 0 && projected[size_t(corner.whole)].x != kUnsnapped) {
            snapped[i] = projected[size_t(corner.whole)];
            continue;
        }
        const auto pixel = [&](int axis) { return nearest_integer(std::clamp(corner.place[axis] / corner.place[2], -kGuardPx, kGuardPx) * kSubpixels); };
        snapped[i] = {pixel(0), pixel(1), view.key_of(std::max(corner.place[3], view.near_depth))};
    }
    for (size_t i = 0; i + 2 < polygon.count; ++i) {
        const ProjectedVertex &a = snapped[0], &b = snapped[i + 1], &c = snapped[i + 2];
        pieces[i] = {{a.x, b.x, c.x}, {a.y, b.y, c.y}, {a.key, b.key, c.key}, number};
    }
    return polygon.count - 2;
}

}  // namespace strata
