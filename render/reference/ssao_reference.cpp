#include "render/reference/ssao_reference.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/math/vec.h"

namespace strata {
namespace {

class Scene {
public:
    Scene(const GBuffer& in, const Camera& camera, uint32_t height_px) : in_(in), camera_(camera), height_px_(height_px) {}

    // Where a pixel's surface lies: right, down and away from the eye.
    std::optional<Vec3d> at(int x, int y) const {
        if (x < 0 || y < 0 || x >= int(in_.width) || y >= int(in_.rows)) return std::nullopt;
        const double depth = in_.depths[size_t(y) * in_.width + size_t(x)];
        if (std::isinf(depth)) return std::nullopt;
        const double unit = 1.0 / pixels_per_unit(camera_, depth, height_px_);
        return Vec3d((x + 0.5 - 0.5 * in_.width) * unit, (y + int(in_.first_row) + 0.5 - 0.5 * height_px_) * unit, depth);
    }
    Vec3d to_eye(const Vec3d& p) const {
        return camera_.projection == Projection::perspective ? Vec3d(-p.normalized()) : Vec3d(0, 0, -1);
    }
    // Along the surface to one side: that on which three pixels lie better in a line.
    Vec3d tangent(int x, int y, int step_x, int step_y) const {
        const Vec3d p = *at(x, y);
        Vec3d best(step_x, step_y, 0);
        double least = std::numeric_limits<double>::infinity();
        for (const int sign : {-1, 1}) {
            const auto near = at(x + sign * step_x, y + sign * step_y), far = at(x + 2 * sign * step_x, y + 2 * sign * step_y);
            if (!near || !far) continue;
            const double error = (*near - p).normalized().cross((*far - p).normalized()).norm();
            if (error < least) {
                least = error;
                best = sign * (*near - p);
            }
        }
        return best;
    }

private:
    const GBuffer& in_;
    const Camera& camera_;
    uint32_t height_px_;
};

}  // namespace

double visibility_reference(const GBuffer& in, const Camera& camera, uint32_t height_px, double radius, int x, int y, int slices) {
    const Scene scene(in, camera, height_px);
    const auto place = scene.at(x, y);
    if (!place) return 1.0;
    const Vec3d p = *place, view = scene.to_eye(p);
    Vec3d normal = scene.tangent(x, y, 1, 0).cross(scene.tangent(x, y, 0, 1)).normalized();
    if (normal.dot(view) < 0.0) normal = -normal;
    const int reach = int(radius * pixels_per_unit(camera, p.z(), height_px)) + 1;
    double sum = 0.0;
    for (int slice = 0; slice < slices; ++slice) {
        const double angle = std::numbers::pi * (slice + 0.5) / slices;
        const Vec3d screen(std::cos(angle), std::sin(angle), 0.0);
        const Vec3d side = (screen - screen.dot(view) * view).normalized();
        const double along_view = normal.dot(view), along_side = normal.dot(side);
        const double gamma = std::atan2(along_side, along_view), length = std::hypot(along_view, along_side);
        double horizon[2];
        for (const int sign : {-1, 1}) {
            const double tangent = -sign * along_side / along_view;
            double highest = 0.0;
            for (int step = 1; step <= reach; ++step) {
                const auto q = scene.at(x + sign * int(std::lround(step * screen.x())), y + sign * int(std::lround(step * screen.y())));
                if (!q) continue;
                const Vec3d d = *q - p;
                const double towards = d.dot(view), aside = (d - towards * view).norm();
                const double weight = std::clamp((1.0 - d.squaredNorm() / (radius * radius)) / (1.0 - 0.36), 0.0, 1.0);
                // Off the slice by rounding to pixels: over the surface there, not in the slice.
                const Vec3d out = (d - towards * view) / aside;
                const double over = towards / aside + normal.dot(out) / along_view;
                highest = std::max(highest, weight * over);
            }
            horizon[(sign + 1) / 2] = sign * (std::numbers::pi / 2 - std::atan(tangent + highest));
        }
        double light = 0.0;
        for (const double h : horizon) light += 0.25 * (-std::cos(2.0 * h - gamma) + std::cos(gamma) + 2.0 * h * std::sin(gamma));
        sum += length * light;
    }
    return sum / slices;
}

}  // namespace strata
