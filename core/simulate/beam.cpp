#include "core/simulate/beam.h"

#include <algorithm>
#include <cmath>

#include "core/simulate/waves.h"

namespace strata {
namespace {

const Vec3d kSun = Vec3d(-0.42, -0.48, 0.77).normalized();
constexpr double kFaintest = 0.06;  // share of the pulse that still makes an echo

struct Echo {
    double distance = 0.0;
    double share = 0.0;  // of what arrives here: what this takes; then of the whole pulse
    Vec3d point = Vec3d::Zero();
    Vec3d normal = Vec3d::UnitZ();
    Part part = Part::leaf;
    Shade shade;
};

Shade shade_leaf(const Crown& crown, const CrownLook& look, const Vec3d& p) {
    const double level = (p.z() - crown.center.z()) / crown.half_height;
    const double outward = (p - crown.center).head<2>().norm() / crown.radius;
    const double clump = smooth_noise(p.x() / 0.6, p.y() / 0.6, p.z() / 0.6, crown.seed + 1);
    const double light = 0.72 + 0.17 * level + 0.12 * std::min(outward, 1.0) + 0.34 * (clump - 0.5);
    Vec3f color = look.color * float(light);
    color.x() *= 1.0f + 0.25f * float(clump - 0.5);
    const double height = level * crown.half_height + crown.half_height;
    const uint8_t classification = crown.kind == Crown::Kind::bush ? (height + crown.radius < 2.0 ? 3 : 4) : 5;
    return {color, 0.5f, classification};
}

// Places along a span where leaves stop a part of the beam, by Woodcock's tracking through the crown's density.
size_t meet_leaves(const LeafSpan& span, const Ray& ray, Random& random, std::span<Echo> out) {
    size_t count = 0;
    double open = 1.0;
    double t = span.enter;
    while (count < out.size() && open > kFaintest) {
        t -= std::log(1.0 - random.uniform()) / Crown::kDensest;
        if (t >= span.leave) break;
        const Vec3d p = ray.at(t);
        if (random.uniform() * Crown::kDensest >= span.crown->density(p)) continue;
        const double share = random.uniform(0.3, 0.85);
        out[count++] = {.distance = t, .share = share, .point = p, .normal = -ray.direction, .part = Part::leaf,
                        .shade = shade_leaf(*span.crown, *span.look, p)};
        open *= 1.0 - share;
    }
    return count;
}

// A smooth water surface mirrors: only beams that fall straight down come back, and now and then a ripple's.
bool water_answers(const Vec3d& direction, Random& random) {
    const double lobe = std::exp(-std::pow(std::acos(std::min(1.0, -direction.z())) / 0.10, 2.0));
    return random.uniform() < 0.04 + 0.75 * lobe;
}

uint16_t full_scale(double value) { return uint16_t(std::clamp(value, 0.0, 1.0) * 65535.0 + 0.5); }

}  // namespace

void fire(SceneProbe& probe, const Ray& ray, const BeamModel& model, uint64_t pulse, const ScanPoint& fields, std::vector<ScanPoint>& out) {
    BeamPath path;
    probe.trace(ray, model.farthest, model.exit_radius + 120.0 * model.divergence, path);
    Random random(mix_bits(pulse));

    std::array<Echo, 48> echoes;
    size_t count = 0;
    for (size_t i = 0; i < path.leaf_count; ++i) count += meet_leaves(path.leaves[i], ray, random, std::span(echoes).subspan(count, std::min<size_t>(12, 40 - std::min<size_t>(40, count))));
    for (size_t i = 0; i < path.wire_count; ++i) {
        const WireTouch& touch = path.wires[i];
        echoes[count++] = {.distance = touch.hit.distance, .share = 0.35, .point = touch.point, .normal = touch.hit.normal, .part = Part::wire, .shade = {}};
    }
    if (count > 1) std::sort(echoes.begin(), echoes.begin() + std::ptrdiff_t(count), [](const Echo& a, const Echo& b) { return a.distance < b.distance; });
    if (path.hard.found() && (path.hard.part != Part::water || water_answers(ray.direction, random)))
        echoes[count++] = {.distance = path.hard.distance, .share = 1.0, .point = ray.at(path.hard.distance), .normal = path.hard.normal, .part = path.hard.part, .shade = {}};

    // Each takes its share of what is left; what is strong enough and apart from the echo before it is recorded.
    size_t kept = 0;
    double left = 1.0;
    for (size_t i = 0; i < count && kept < size_t(model.most_returns); ++i) {
        Echo echo = echoes[i];
        const double taken = echo.share * left;
        left -= taken;
        echo.share = taken;
        if (taken < kFaintest || (kept > 0 && echo.distance - echoes[kept - 1].distance < model.range_resolution)) continue;
        if (echo.part != Part::leaf) {
            RayHit hit = path.hard;
            if (echo.part == Part::wire) hit = RayHit{.distance = echo.distance, .normal = echo.normal, .part = Part::wire};
            echo.shade = probe.shade(hit, echo.point, *path.tile);
            // Daylight: sky from everywhere, the sun from the south-west.
            echo.shade.color *= float(0.74 + 0.34 * std::max(0.0, echo.normal.dot(kSun)));
        }
        echoes[kept++] = echo;
    }

    Random noise(mix_bits(pulse ^ 0x6e6f697365u));
    for (size_t i = 0; i < kept; ++i) {
        const Echo& echo = echoes[i];
        ScanPoint point = fields;
        point.position = echo.point;
        if (model.noise > 0.0) point.position += model.noise * noise.normal() * ray.direction;
        const double incidence = echo.part == Part::leaf ? 0.6 : std::abs(echo.normal.dot(ray.direction));
        const double spread = model.reference_range / std::max(echo.distance, 0.35 * model.reference_range);
        point.intensity = uint16_t(std::clamp(60000.0 * echo.shade.reflectance * incidence * echo.share * spread * spread, 1.0, 65535.0));
        point.red = full_scale(echo.shade.color.x());
        point.green = full_scale(echo.shade.color.y());
        point.blue = full_scale(echo.shade.color.z());
        point.return_number = uint8_t(i + 1);
        point.return_count = uint8_t(kept);
        point.classification = echo.shade.classification;
        point.part = echo.part;
        out.push_back(point);
    }
}

}  // namespace strata
