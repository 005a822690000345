#include "core/surface/point_paint.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "core/surface/surface_parts.h"

namespace strata {
namespace {

constexpr std::array<uint8_t, 4> kUnknownColor = {128, 128, 128, 255};
constexpr size_t kBlock = 1024;  // vertices a thread takes at a time

}  // namespace

// A point that has a say at a place, with its weight.
struct PointPaint::Say {
    const PointLayer* layer;
    uint32_t point;
    double weight;
};

void PointPaint::add(const SurfacePiece& piece) {
    hand_on_in_parts(piece, kMostVertices, next_, [&](SurfacePiece& part, std::vector<VertexScalars>& scalars) {
        paint(part.origin, part.positions);
        if (settings_.form.colors) part.colors = colors_;
        for (size_t s = 0; s < scalars_.size(); ++s) scalars.push_back({settings_.form.scalars[s].name, scalars_[s]});
    });
}

void PointPaint::paint(const Vec3d& origin, std::span<const Vec3f> positions) {
    const size_t count = positions.size(), scalars = settings_.form.scalars.size();
    const PointGrid& grid = settings_.grid;
    colors_.assign(settings_.form.colors ? count : 0, kUnknownColor);
    scalars_.resize(scalars);
    for (std::vector<float>& values : scalars_) values.assign(count, std::numeric_limits<float>::quiet_NaN());
    std::atomic<uint64_t> unknown = 0;
    parallel_blocks(settings_.threads, count, kBlock, [&](size_t begin, size_t end) {
        std::vector<Say> say;
        std::vector<ClassVote> votes;
        std::array<std::shared_ptr<const PointLayer>, 3> layers;
        size_t held = std::numeric_limits<size_t>::max();
        for (size_t v = begin; v < end; ++v) {
            const Vec3d place = (origin - grid.placement.origin + positions[v].cast<double>()) / grid.spacing;
            const size_t layer = size_t(std::max(place.z(), 0.0)) / size_t(kFieldBrickSide);
            if (layer != held) layers = window_.around(held = layer);
            gather(place, layer, layers, say);
            if (say.empty()) {
                ++unknown;
                continue;
            }
            if (settings_.form.colors) colors_[v] = mean_color(say);
            for (size_t s = 0; s < scalars; ++s) scalars_[s][v] = value_of(s, say, votes);
        }
    });
    unknown_ += unknown;
}

// The points around a place in a layer, that one and those below and above it being given.
void PointPaint::gather(const Vec3d& place, size_t layer, const std::array<std::shared_ptr<const PointLayer>, 3>& layers, std::vector<Say>& say) const {
    const double radius = settings_.radius / settings_.grid.spacing, scale = 1.0 / (radius * radius);
    const auto least_brick = [&](int axis) { return int32_t(std::floor((place[axis] - radius) / kFieldBrickSide)) * kFieldBrickSide; };
    say.clear();
    for (size_t l = 0; l < 3; ++l) {
        if (!layers[l]) continue;
        const PointLayer& points = *layers[l];
        const double k = double(layer + l - 1) * kFieldBrickSide;
        if (place.z() + radius < k || place.z() - radius >= k + kFieldBrickSide) continue;
        for (int32_t j = least_brick(1); j <= place.y() + radius; j += kFieldBrickSide)
            for (int32_t i = least_brick(0); i <= place.x() + radius; i += kFieldBrickSide) {
                const size_t brick = points.find({i, j});
                if (brick == points.corners.size()) continue;
                const Vec3f from = (place - Vec3d(i, j, k)).cast<float>();
                for (uint32_t p = points.begins[brick]; p < points.begins[brick + 1]; ++p) {
                    const double rest = 1.0 - double((points.places[p] - from).squaredNorm()) * scale;
                    if (rest > 0.0) say.push_back({&points, p, rest * rest * rest * rest});
                }
            }
    }
}

std::array<uint8_t, 4> PointPaint::mean_color(const std::vector<Say>& say) const {
    Vec3d sum = Vec3d::Zero();
    double weight = 0.0;
    for (const Say& one : say) {
        const std::array<uint16_t, 3>& color = one.layer->colors[one.point];
        sum += one.weight * Vec3d(color[0], color[1], color[2]);
        weight += one.weight;
    }
    const double steps = settings_.color_bits == 16 ? 257.0 : 1.0;
    std::array<uint8_t, 4> mean = kUnknownColor;
    for (size_t c = 0; c < 3; ++c) mean[c] = uint8_t(std::clamp(std::lround(sum[int(c)] / weight / steps), 0l, 255l));
    return mean;
}

// NaN: none of the points knows it.
float PointPaint::value_of(size_t scalar, const std::vector<Say>& say, std::vector<ClassVote>& votes) const {
    const size_t scalars = settings_.form.scalars.size();
    const bool is_class = settings_.form.scalars[scalar].is_class;
    votes.clear();
    double sum = 0.0, weight = 0.0;
    for (const Say& one : say) {
        const float value = one.layer->scalars[one.point * scalars + scalar];
        if (std::isnan(value)) continue;
        if (is_class) votes.push_back({value, one.weight});
        sum += one.weight * double(value);
        weight += one.weight;
    }
    if (is_class) return most_voted(votes);
    return weight > 0.0 ? float(sum / weight) : std::numeric_limits<float>::quiet_NaN();
}

}  // namespace strata
