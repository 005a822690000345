#include "render/reference/mesh_reference.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>

namespace strata {
namespace {

Vec2d place_of(const MeshProjection& view, const Vec3d& p) {
    const Vec3d d = p - view.eye;
    const double w = view.perspective ? view.forward.dot(d) : 1.0;
    return {view.center_x + view.x_row.dot(d) / w, view.center_y + view.y_row.dot(d) / w};
}

double distance_to_segment(const Vec2d& p, const Vec2d& a, const Vec2d& b) {
    const double square = (b - a).squaredNorm(), along = square > 0.0 ? std::clamp((p - a).dot(b - a) / square, 0.0, 1.0) : 0.0;
    return (a + along * (b - a) - p).norm();
}

double turn(const Vec2d& a, const Vec2d& b, const Vec2d& p) { return (b - a).x() * (p - a).y() - (b - a).y() * (p - a).x(); }

}  // namespace

MeshTruth first_in_mesh(const TriangleMesh& mesh, const MeshProjection& view, double x_px, double y_px) {
    MeshTruth truth = {std::nullopt, std::numeric_limits<double>::infinity()};
    const Vec2d place(x_px, y_px);
    const MeshProjection::Ray ray = view.ray(x_px, y_px);
    for (uint32_t triangle = 0; triangle < mesh.triangles.size(); ++triangle) {
        std::array<Vec3d, 3> corners;
        std::array<Vec2d, 3> places;
        for (size_t i = 0; i < 3; ++i) {
            corners[i] = mesh.positions[mesh.triangles[triangle][i]];
            places[i] = place_of(view, corners[i]);
        }
        std::array<double, 3> turns;
        for (size_t i = 0; i < 3; ++i) {
            turns[i] = turn(places[i], places[(i + 1) % 3], place);
            truth.edge_px = std::min(truth.edge_px, distance_to_segment(place, places[i], places[(i + 1) % 3]));
        }
        const auto [least, most] = std::minmax_element(turns.begin(), turns.end());
        if (*least < 0.0 && *most > 0.0) continue;
        const Vec3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        const double depth = normal.dot(corners[0] - view.eye - ray.origin) / normal.dot(ray.direction);
        if (depth >= view.near_depth && (!truth.nearest || depth < truth.nearest->depth)) truth.nearest = {triangle, depth};
    }
    return truth;
}

}  // namespace strata
