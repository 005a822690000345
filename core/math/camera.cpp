#include "core/math/camera.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/error.h"

namespace strata {
namespace {

constexpr double kLargestFov = 179.0 * std::numbers::pi / 180.0;
// Up closer to the view direction than this leaves the horizon to rounding.
constexpr double kLeastSine = 1e-7;

struct Range {
    double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
    void extend(double value) {
        low = std::min(low, value);
        high = std::max(high, value);
    }
    double middle() const { return 0.5 * (low + high); }
    double size() const { return high - low; }
};

}  // namespace

Mat3d look_along(const Vec3d& forward, const Vec3d& up) {
    if (!forward.allFinite() || !up.allFinite()) throw Error(ErrorKind::usage, "camera: directions must be finite");
    const double forward_length = forward.stableNorm(), up_length = up.stableNorm();
    if (!(forward_length > 0.0)) throw Error(ErrorKind::usage, "camera: eye and target are the same point");
    if (!(up_length > 0.0)) throw Error(ErrorKind::usage, "camera: up has no length");
    const Vec3d backward = -forward / forward_length;
    const Vec3d right = (up / up_length).cross(backward);
    if (!(right.norm() > kLeastSine)) throw Error(ErrorKind::usage, "camera: up is parallel to the view direction");
    Mat3d view_from_world;
    view_from_world.row(0) = right.normalized();
    view_from_world.row(1) = backward.cross(right.normalized());
    view_from_world.row(2) = backward;
    return view_from_world;
}

void check_camera(const Camera& camera) {
    if (!camera.eye.allFinite() || !camera.view_from_world.allFinite())
        throw Error(ErrorKind::usage, "camera: eye and directions must be finite");
    if (!(camera.near_depth >= 0.0) || !std::isfinite(camera.near_depth))
        throw Error(ErrorKind::usage, "camera: near must be finite and not negative");
    if (camera.projection == Projection::perspective) {
        if (!(camera.fov_rad > 0.0) || !(camera.fov_rad <= kLargestFov))
            throw Error(ErrorKind::usage, "camera: the field of view must be above 0 and at most 179 degrees");
        if (!(camera.near_depth > 0.0)) throw Error(ErrorKind::usage, "camera: near must be positive in perspective");
    } else {
        if (!(camera.height > 0.0) || !std::isfinite(camera.height))
            throw Error(ErrorKind::usage, "camera: the height of the view must be positive and finite");
        if (!(camera.far_depth > camera.near_depth) || !std::isfinite(camera.far_depth))
            throw Error(ErrorKind::usage, "camera: far must be finite and beyond near");
    }
}

double pixels_per_unit(const Camera& camera, double depth, uint32_t height_px) {
    if (camera.projection == Projection::orthographic) return height_px / camera.height;
    return 0.5 * height_px / (std::tan(0.5 * camera.fov_rad) * depth);
}

void frame_points(Camera& camera, std::span<const Vec3d> points, double aspect, double margin) {
    if (points.empty()) return;
    // Coordinates along the view axes, relative to the first point so that far-away clouds lose nothing.
    const Vec3d origin = points[0];
    const double fill = 1.0 - 2.0 * margin;
    if (camera.projection == Projection::orthographic) {
        Range x, y, z;
        for (const Vec3d& p : points) {
            const Vec3d q = camera.view_from_world * (p - origin);
            x.extend(q.x());
            y.extend(q.y());
            z.extend(q.z());
        }
        const double depth = std::max({z.size(), x.size(), y.size(), 1e-9 * (1.0 + origin.norm())});
        camera.height = std::max({y.size(), x.size() / aspect, 1e-3 * depth}) / fill;
        const Vec3d eye_in_view(x.middle(), y.middle(), z.high + 0.5 * depth);
        camera.eye = origin + camera.view_from_world.transpose() * eye_in_view;
        return;
    }
    // Each side of the picture is a plane through the eye; pushed against the points, the four planes give the eye.
    const double slope_y = std::tan(0.5 * camera.fov_rad) * fill, slope_x = std::tan(0.5 * camera.fov_rad) * aspect * fill;
    Range right_of_x, left_of_x, above_y, below_y, z;
    double extent = 0.0;
    for (const Vec3d& p : points) {
        const Vec3d q = camera.view_from_world * (p - origin);
        right_of_x.extend(q.x() + slope_x * q.z());
        left_of_x.extend(-q.x() + slope_x * q.z());
        above_y.extend(q.y() + slope_y * q.z());
        below_y.extend(-q.y() + slope_y * q.z());
        z.extend(q.z());
        extent = std::max(extent, q.norm());
    }
    const double least_distance = std::max(1e-3 * extent, 1e-9 * (1.0 + origin.norm()));
    const Vec3d eye_in_view(0.5 * (right_of_x.high - left_of_x.high), 0.5 * (above_y.high - below_y.high),
                            std::max({(right_of_x.high + left_of_x.high) / (2.0 * slope_x),
                                      (above_y.high + below_y.high) / (2.0 * slope_y), z.high + least_distance}));
    camera.eye = origin + camera.view_from_world.transpose() * eye_in_view;
}

void fit_depth_range(Camera& camera, const Box3d& bounds) {
    if (bounds.empty()) return;
    Range depth;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d p((corner & 1 ? bounds.max : bounds.min).x(), (corner & 2 ? bounds.max : bounds.min).y(),
                      (corner & 4 ? bounds.max : bounds.min).z());
        depth.extend(camera.forward().dot(p - camera.eye));
    }
    // Reversed floating-point depth does not lose precision to a small near, so it only keeps the eye's own dust away.
    const double scale = std::max({std::abs(depth.low), std::abs(depth.high), std::numeric_limits<double>::min() * 1e9});
    camera.near_depth = camera.projection == Projection::perspective ? std::max(0.5 * depth.low, 1e-5 * scale) : 0.0;
    camera.far_depth = std::max(depth.high, 0.0) + 1e-3 * scale;
}

}  // namespace strata
