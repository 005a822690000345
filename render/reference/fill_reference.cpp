#include "render/reference/fill_reference.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "render/pass/fill_criteria.h"
#include "render/srgb.h"

namespace strata {
namespace {

using namespace fill_criteria;

struct Sample {
    Vec2d place;  // from the pixel
    double depth, splat;
    size_t pixel;
};

struct Side {
    Sample rim, inner;
};

class Scene {
public:
    Scene(const GBuffer& in, const FillSettings& settings, const Camera& camera, uint32_t height_px)
        : in_(in), settings_(settings), camera_(camera), height_px_(height_px) {}

    double unit(double depth) const { return 1.0 / pixels_per_unit(camera_, depth, height_px_); }
    double nearness(double depth) const { return camera_.projection == Projection::perspective ? 1.0 / depth : -depth; }
    double widest_gap(double splat) const {
        return settings_.follow_splats ? std::min<double>(settings_.gap_px, splat) : double(settings_.gap_px);
    }
    double longest(double gap) const { return gap > 0.0 ? std::max<double>(kSlantedGap * gap, kLeastGap) : 0.0; }

    std::optional<Sample> at(int x, int y, const Vec2d& place) const {
        if (x < 0 || y < 0 || x >= int(in_.width) || y >= int(in_.rows)) return std::nullopt;
        const size_t pixel = size_t(y) * in_.width + size_t(x);
        if (in_.depths[pixel] == kNoDepth) return std::nullopt;
        return Sample{place, in_.depths[pixel], double(in_.splat_px[pixel]), pixel};
    }
    bool is_one_surface(const Sample& a, const Sample& b, double splat, double distance) const {
        return std::abs(a.depth - b.depth) <= unit(a.depth) * (kSameDepth * splat + kSteepest * distance);
    }
    std::optional<Side> look(int x, int y, const Line& line, int sign, int steps) const;

private:
    const GBuffer& in_;
    const FillSettings& settings_;
    const Camera& camera_;
    uint32_t height_px_;
};

std::optional<Side> Scene::look(int x, int y, const Line& line, int sign, int steps) const {
    const size_t pixel = size_t(y) * in_.width + size_t(x);
    const double own_depth = in_.depths[pixel], own_splat = in_.splat_px[pixel];
    const Vec2d direction(sign * line.x, sign * line.y);
    std::optional<Side> side;
    for (int k = 1; k <= steps; ++k) {
        const auto rim = at(x + k * sign * line.x, y + k * sign * line.y, k * direction);
        const double distance = k * direction.norm();
        if (!rim || distance > longest(widest_gap(rim->splat))) continue;
        const double u = unit(rim->depth);
        if (own_depth - rim->depth <= u * (kHoleDepth * std::max(rim->splat, own_splat) + kHoleSlope * distance)) continue;
        if (side && side->rim.depth - rim->depth <= u * (kHoleDepth * rim->splat + kSteepest * (distance - side->rim.place.norm())))
            continue;
        const int deeper = std::max(1, int(std::min<double>(kSupport * rim->splat, kMostSupport) / direction.norm() + 0.5));
        const auto inner = at(x + (k + deeper) * sign * line.x, y + (k + deeper) * sign * line.y, (k + deeper) * direction);
        if (inner && is_one_surface(*rim, *inner, rim->splat, deeper * direction.norm())) side = Side{*rim, *inner};
    }
    return side;
}

}  // namespace

std::optional<FillTruth> fill_reference(const GBuffer& in, const FillSettings& settings, const Camera& camera,
                                        uint32_t height_px, int x, int y) {
    const Scene scene(in, settings, camera, height_px);
    std::vector<Side> sides;
    bool narrow = false;
    for (const Line& line : kLine) {
        const double step = std::hypot(line.x, line.y);
        const int steps = int(scene.longest(settings.gap_px) / step);
        const auto a = scene.look(x, y, line, 1, steps);
        if (!a) continue;
        const auto b = scene.look(x, y, line, -1, std::min(steps, steps + 1 - int(std::lround(a->rim.place.norm() / step))));
        if (!b) continue;
        const double gap = (a->rim.place - b->rim.place).norm() - step;
        const double widest = scene.widest_gap(0.5 * (a->rim.splat + b->rim.splat));
        const Sample& nearer = a->rim.depth < b->rim.depth ? a->rim : b->rim;
        const Sample& farther = a->rim.depth < b->rim.depth ? b->rim : a->rim;
        if (gap > scene.longest(widest) || !scene.is_one_surface(nearer, farther, std::max(a->rim.splat, b->rim.splat), gap)) continue;
        narrow |= gap <= widest;
        sides.push_back(*a);
        sides.push_back(*b);
    }
    if (sides.size() < size_t(2) * kLeastLines || !narrow) return std::nullopt;

    Eigen::MatrixXd places(2 * sides.size(), 3);
    Eigen::VectorXd nearness(2 * sides.size()), weights(2 * sides.size());
    FillTruth truth = {.linear_color = Vec3d::Zero(), .depth = 0.0, .id = kNoPixelId, .splat_px = 0};
    double total = 0.0, splat = 0.0, nearest = 0.0;
    for (size_t i = 0; i < sides.size(); ++i) {
        const auto& [rim, inner] = sides[i];
        const double weight = 1.0 / rim.place.squaredNorm();
        places.row(Eigen::Index(2 * i)) << 1.0, rim.place.x(), rim.place.y();
        places.row(Eigen::Index(2 * i + 1)) << 1.0, inner.place.x(), inner.place.y();
        nearness[Eigen::Index(2 * i)] = scene.nearness(rim.depth);
        nearness[Eigen::Index(2 * i + 1)] = scene.nearness(inner.depth);
        weights[Eigen::Index(2 * i)] = kRimWeight * weight;
        weights[Eigen::Index(2 * i + 1)] = weight;
        const Rgba8 color = in.colors[rim.pixel];
        truth.linear_color += weight * Vec3d(linear_from_srgb(red_of(color) / 255.0), linear_from_srgb(green_of(color) / 255.0),
                                             linear_from_srgb(blue_of(color) / 255.0));
        splat += weight * rim.splat;
        total += weight;
        if (weight > nearest * (1.0 + 1e-6)) {
            nearest = weight;
            truth.id = in.ids.empty() ? kNoPixelId : in.ids[rim.pixel];
            truth.splat_px = int(rim.splat);
        }
    }
    const Eigen::VectorXd roots = weights.cwiseSqrt();
    const Vec3d plane = (roots.asDiagonal() * places).colPivHouseholderQr().solve(roots.cwiseProduct(nearness));
    truth.linear_color /= total;
    const bool perspective = camera.projection == Projection::perspective;
    truth.depth = perspective ? 1.0 / plane[0] : -plane[0];
    if (!(truth.depth > 0.0) || std::isinf(truth.depth)) return std::nullopt;
    const double depth_per_nearness = perspective ? truth.depth * truth.depth : 1.0, u = scene.unit(truth.depth);
    const double off = std::sqrt(weights.dot((places * plane - nearness).cwiseAbs2()) / weights.sum()) * depth_per_nearness;
    const double slope = plane.tail<2>().norm() * depth_per_nearness / u;
    if (off > u * (splat / total) * (kRough + kRoughSlope * slope)) return std::nullopt;
    return truth;
}

}  // namespace strata
