#include "core/surface/point_paint.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "core/parallel.h"

namespace strata {
namespace {

constexpr std::array<uint8_t, 4> kUnknownColor = {128, 128, 128, 255};

// The points that have a say at a place, with their weights.
struct Say {
    const PointLayer* layer;
    uint32_t point;
    double weight;
};

// The value of most weight; the least of such. `values` is sorted.
float weightiest(std::vector<std::pair<float, double>>& values) {
    std::sort(values.begin(), values.end());
    float found = std::numeric_limits<float>::quiet_NaN();
    double most = 0.0;
    for (size_t begin = 0, end; begin < values.size(); begin = end) {
        double weight = 0.0;
        for (end = begin; end < values.size() && values[end].first == values[begin].first; ++end) weight += values[end].second;
        if (weight > most) {
            most = weight;
            found = values[begin].first;
        }
    }
    return found;
}

}  // namespace

void PointPaint::add(const SurfacePiece& piece) {
    const size_t count = piece.positions.size(), scalars = settings_.form.scalars.size();
    const PointGrid& grid = settings_.grid;
    colors_.assign(settings_.form.colors ? count : 0, kUnknownColor);
    scalars_.resize(scalars);
    for (std::vector<float>& values : scalars_) values.assign(count, std::numeric_limits<float>::quiet_NaN());
    const auto index_of = [&](const Vec3f& position) { return Vec3d((piece.origin - grid.placement.origin + position.cast<double>()) / grid.spacing); };
    const auto layer_of = [&](const Vec3f& position) { return size_t(std::max(index_of(position).z(), 0.0)) / size_t(kFieldBrickSide); };
    const double radius = settings_.radius / grid.spacing, scale = 1.0 / (radius * radius);
    size_t lowest = std::numeric_limits<size_t>::max();
    for (const Vec3f& position : piece.positions) lowest = std::min(lowest, layer_of(position));
    std::atomic<uint64_t> unknown = 0;
    parallel_blocks(settings_.threads, count, 1024, [&](size_t begin, size_t end) {
        std::vector<Say> say;
        std::vector<std::pair<float, double>> values;
        std::array<std::shared_ptr<const PointLayer>, 3> layers;
        size_t held = std::numeric_limits<size_t>::max();
        for (size_t v = begin; v < end; ++v) {
            const Vec3d place = index_of(piece.positions[v]);
            if (const size_t layer = layer_of(piece.positions[v]); layer != held) layers = window_.around(held = layer);
            say.clear();
            const auto least_brick = [&](int axis) { return int32_t(std::floor((place[axis] - radius) / kFieldBrickSide)) * kFieldBrickSide; };
            for (size_t l = 0; l < 3; ++l) {
                if (!layers[l]) continue;
                const double k = double(held + l - 1) * kFieldBrickSide;
                if (place.z() + radius < k || place.z() - radius >= k + kFieldBrickSide) continue;
                for (int32_t j = least_brick(1); j <= place.y() + radius; j += kFieldBrickSide)
                    for (int32_t i = least_brick(0); i <= place.x() + radius; i += kFieldBrickSide) {
                        const size_t brick = layers[l]->find({i, j});
                        if (brick == layers[l]->corners.size()) continue;
                        const Vec3f from = (place - Vec3d(i, j, k)).cast<float>();
                        for (uint32_t p = layers[l]->begins[brick]; p < layers[l]->begins[brick + 1]; ++p) {
                            const double rest = 1.0 - double((layers[l]->places[p] - from).squaredNorm()) * scale;
                            if (rest > 0.0) say.push_back({layers[l].get(), p, rest * rest * rest * rest});
                        }
                    }
            }
            if (say.empty()) {
                ++unknown;
                continue;
            }
            if (settings_.form.colors) {
                Vec3d sum = Vec3d::Zero();
                double weight = 0.0;
                for (const Say& one : say) {
                    const std::array<uint16_t, 3>& color = one.layer->colors[one.point];
                    sum += one.weight * Vec3d(color[0], color[1], color[2]);
                    weight += one.weight;
                }
                const double steps = settings_.color_bits == 16 ? 257.0 : 1.0;
                for (size_t c = 0; c < 3; ++c) colors_[v][c] = uint8_t(std::clamp(std::lround(sum[int(c)] / weight / steps), 0l, 255l));
            }
            for (size_t s = 0; s < scalars; ++s) {
                values.clear();
                double sum = 0.0, weight = 0.0;
                for (const Say& one : say) {
                    const float value = one.layer->scalars[one.point * scalars + s];
                    if (std::isnan(value)) continue;
                    values.emplace_back(value, one.weight);
                    sum += one.weight * double(value);
                    weight += one.weight;
                }
                if (values.empty()) continue;
                scalars_[s][v] = settings_.form.scalars[s].is_class ? weightiest(values) : float(sum / weight);
            }
        }
    });
    unknown_ += unknown;
    std::vector<VertexScalars> named(piece.scalars.begin(), piece.scalars.end());
    for (size_t s = 0; s < scalars; ++s) named.push_back({settings_.form.scalars[s].name, scalars_[s]});
    SurfacePiece painted = piece;
    if (settings_.form.colors) painted.colors = colors_;
    painted.scalars = named;
    next_.add(painted);
    if (lowest != std::numeric_limits<size_t>::max() && lowest > 0) window_.forget_below(lowest - 1);
}

}  // namespace strata
