#include "core/simulate/beam.h"

#include <algorithm>
#include <cmath>

#include "core/simulate/waves.h"

namespace strata {
namespace {

const Vec3d kSun = Vec3d(-0.42, -0.48, 0.77).normalized();
constexpr double kFaintest = 0.06;   // share of the pulse that still makes an echo
constexpr double kWireShare = 0.35;  // of a beam that touches a wire
constexpr uint64_t kEchoStream = 0x6563686f00000000u, kNoiseStream = 0x6e6f697300000000u;  // of a pulse's random numbers

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

// A still pond mirrors, wind ripples it: most beams that fall straight down come back, fewer the flatter they fall.
bool water_answers(const Vec3d& direction, Random& random) {
    const double fall = direction.z() * direction.z(), fall4 = fall * fall;
    return random.uniform() < 0.55 * fall4 + 0.35 * fall4 * fall4 * fall4 * fall4;
}

uint16_t full_scale(double value) { return uint16_t(std::clamp(value, 0.0, 1.0) * 65535.0 + 0.5); }

}  // namespace

// Places along a span where leaves stop a part of the beam, by Woodcock's tracking through the crown's density.
void BeamScanner::meet_leaves(const LeafSpan& span, const Ray& ray, Random& random, size_t most, size_t& count) {
    double open = 1.0;
    double t = span.enter;
    while (count < most && open > kFaintest) {
        t -= natural_log(1.0 - random.uniform()) / Crown::kDensest;
        if (t >= span.leave) break;
        const Vec3d p = ray.at(t);
        if (!span.crown->leaves_at(p, random.uniform())) continue;
        const double share = random.uniform(0.3, 0.85);
        echoes_[count++] = {t, share, p, -ray.direction, Part::leaf, &span};
        open *= 1.0 - share;
    }
}

// All that the beam may echo from, by distance.
size_t BeamScanner::gather_echoes(const Ray& ray, Random& random) {
    constexpr size_t kLeavesOfCrown = 12;
    constexpr size_t kLeaves = kMostEchoes - std::tuple_size_v<decltype(BeamPath::wires)> - 1;
    size_t count = 0;
    for (size_t i = 0; i < path_.leaf_count; ++i) meet_leaves(path_.leaves[i], ray, random, std::min(kLeaves, count + kLeavesOfCrown), count);
    for (size_t i = 0; i < path_.wire_count; ++i) {
        const WireTouch& touch = path_.wires[i];
        echoes_[count++] = {touch.hit.distance, kWireShare, touch.point, touch.hit.normal, Part::wire, nullptr};
    }
    if (count > 1) std::sort(echoes_.begin(), echoes_.begin() + std::ptrdiff_t(count), [](const Echo& a, const Echo& b) { return a.distance < b.distance; });
    const RayHit& hard = path_.hard;
    if (hard.found() && (hard.part != Part::water || water_answers(ray.direction, random)))
        echoes_[count++] = {hard.distance, 1.0, ray.at(hard.distance), hard.normal, hard.part, nullptr};
    return count;
}

// Each takes its share of what is left; what is strong enough and apart from the echo before it is kept.
size_t BeamScanner::record_echoes(size_t count, const BeamModel& model) {
    size_t kept = 0;
    double left = 1.0;
    for (size_t i = 0; i < count && kept < size_t(model.most_returns); ++i) {
        Echo echo = echoes_[i];
        echo.share *= left;
        left -= echo.share;
        if (echo.share < kFaintest || (kept > 0 && echo.distance - echoes_[kept - 1].distance < model.range_resolution)) continue;
        echoes_[kept++] = echo;
    }
    return kept;
}

Shade BeamScanner::shade(const Echo& echo) const {
    if (echo.part == Part::leaf) return shade_leaf(*echo.leaves->crown, *echo.leaves->look, echo.point);
    Shade shade = probe_.shade(echo.part == path_.hard.part ? path_.hard : RayHit{.part = echo.part}, echo.point, path_.tile);
    // Daylight: sky from everywhere, the sun from the south-west.
    shade.color *= float(0.74 + 0.34 * std::max(0.0, echo.normal.dot(kSun)));
    return shade;
}

void BeamScanner::fire(const Ray& ray, const BeamModel& model, uint64_t pulse, const ScanPoint& fields, std::vector<ScanPoint>& out) {
    probe_.trace(ray, model.farthest, model.beam_radius, path_);
    Random random(pulse ^ kEchoStream);
    const size_t kept = record_echoes(gather_echoes(ray, random), model);
    Random noise(pulse ^ kNoiseStream);
    for (size_t i = 0; i < kept; ++i) {
        const Echo& echo = echoes_[i];
        const Shade surface = shade(echo);
        ScanPoint& point = out.emplace_back(fields);
        point.position = echo.point;
        if (model.noise > 0.0) point.position += model.noise * noise.normal() * ray.direction;
        const double incidence = echo.part == Part::leaf ? 0.6 : std::abs(echo.normal.dot(ray.direction));
        const double spread = model.reference_range / std::max(echo.distance, 0.35 * model.reference_range);
        point.intensity = uint16_t(std::clamp(60000.0 * surface.reflectance * incidence * echo.share * spread * spread, 1.0, 65535.0));
        point.red = full_scale(surface.color.x());
        point.green = full_scale(surface.color.y());
        point.blue = full_scale(surface.color.z());
        point.return_number = uint8_t(i + 1);
        point.return_count = uint8_t(kept);
        point.classification = surface.classification;
        point.part = echo.part;
    }
}

}  // namespace strata
