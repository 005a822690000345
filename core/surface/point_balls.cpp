#include "core/surface/point_balls.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr double kBand = 2.0;         // spacings
constexpr double kMostRadius = 6.0;   // spacings, so that a ball reaches no farther than into the next layer

int32_t brick_of(float place) { return int32_t(std::floor(place)) >> 3; }

PointGrid grid_of(const Box3d& bounds, const PointBallsSettings& settings) {
    const double steps = settings.radius / settings.spacing;
    if (!(settings.spacing > 0.0 && steps >= 1.0 && steps <= kMostRadius))
        throw Error(ErrorKind::usage, "the radius of balls is from 1 to 6 spacings of samples");
    return PointGrid::around(bounds, settings.spacing, steps + kBand);
}

}  // namespace

PointBalls::PointBalls(const PointSource& points, const Box3d& bounds, const PointBallsSettings& settings)
    : settings_(settings),
      reach_(float(settings.radius / settings.spacing + kBand)),
      scratch_(settings.scratch),
      layers_(grid_of(bounds, settings), settings.form, settings.memory_bytes / 2, scratch_) {
    layers_.distribute(points, settings.threads, settings.on_points);
}

float PointBalls::background() const { return float(kBand * settings_.spacing); }

void PointBalls::load(size_t layer) {
    near_[layer % 3].clear();
    if (layers_.points(layer) == 0) return;
    if (settings_.keep_points) {
        const uint64_t held = std::min(window_.memory_bytes(), settings_.memory_bytes);
        window_.put(layer, std::make_shared<PointLayer>(layers_.take(layer, true, settings_.memory_bytes - held, &near_[layer % 3])));
    } else {
        layers_.take_places(layer, near_[layer % 3]);
    }
}

bool PointBalls::next_layer(FieldBrickLayer& out) {
    for (; next_ < layers_.size(); ++next_) {
        if (next_ == 0) load(0);
        load(next_ + 1);
        if (near_[0].empty() && near_[1].empty() && near_[2].empty()) continue;
        out.k = int32_t(next_) * kFieldBrickSide;
        out.corners.clear();
        out.values.clear();
        fill(out);
        if (out.corners.empty()) continue;
        ++next_;
        return true;
    }
    return false;
}

// The bricks of the layer that balls reach into, and the nearest center to each of their samples.
void PointBalls::fill(FieldBrickLayer& out) {
    struct Part {
        uint64_t brick;  // j above i
        std::array<float, 3> center;
    };
    std::vector<Part> parts;
    const float low = float(out.k) - reach_, high = float(out.k + kFieldBrickSide - 1) + reach_;
    const double units = layers_.grid().units;
    for (const std::vector<std::array<int32_t, 3>>& centers : near_)
        for (const std::array<int32_t, 3>& center : centers) {
            const std::array<float, 3> c = {float(center[0] / units), float(center[1] / units), float(center[2] / units)};
            if (c[2] < low || c[2] > high) continue;
            for (int32_t j = brick_of(c[1] - reach_); j <= brick_of(c[1] + reach_); ++j)
                for (int32_t i = brick_of(c[0] - reach_); i <= brick_of(c[0] + reach_); ++i)
                    parts.push_back({uint64_t(uint32_t(j)) << 32 | uint32_t(i), c});
            if (parts.size() * sizeof(Part) > settings_.memory_bytes)
                throw Error(
                    ErrorKind::limit,
                    "the balls of one layer of bricks need more than the allowed memory; a larger spacing, or fewer points, need less");
        }
    std::sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.brick < b.brick; });
    std::vector<size_t> begins;
    for (size_t i = 0; i < parts.size(); ++i)
        if (i == 0 || parts[i].brick != parts[i - 1].brick) begins.push_back(i);
    begins.push_back(parts.size());
    const size_t bricks = begins.size() - 1;
    if (bricks * kFieldBrickSamples * sizeof(float) > settings_.memory_bytes)
        throw Error(ErrorKind::limit, "one layer of bricks needs " + std::to_string(bricks * kFieldBrickSamples * sizeof(float)) +
                                          " bytes of memory, " + std::to_string(settings_.memory_bytes) +
                                          " are allowed; a larger spacing needs less");
    out.values.resize(bricks * kFieldBrickSamples);
    std::vector<uint8_t> reached(bricks);
    const float radius = float(settings_.radius / settings_.spacing), most_square = reach_ * reach_, spacing = float(settings_.spacing);
    parallel_blocks(settings_.threads, bricks, 16, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b) {
            float* const squares = out.values.data() + b * kFieldBrickSamples;
            std::fill_n(squares, kFieldBrickSamples, most_square);
            const uint64_t brick = parts[begins[b]].brick;
            const float first_i = float(8 * int32_t(uint32_t(brick))), first_j = float(8 * int32_t(uint32_t(brick >> 32)));
            for (size_t n = begins[b]; n < begins[b + 1]; ++n) {
                const std::array<float, 3>& c = parts[n].center;
                float across[8];
                for (int x = 0; x < 8; ++x) across[x] = (first_i + float(x) - c[0]) * (first_i + float(x) - c[0]);
                for (int z = 0; z < 8; ++z)
                    for (int y = 0; y < 8; ++y) {
                        const float dy = first_j + float(y) - c[1], dz = float(out.k + z) - c[2], rest = dy * dy + dz * dz;
                        if (rest >= most_square) continue;
                        float* const row = squares + (z << 6 | y << 3);
                        for (int x = 0; x < 8; ++x) row[x] = std::min(row[x], rest + across[x]);
                    }
            }
            for (int n = 0; n < kFieldBrickSamples; ++n) {
                reached[b] |= squares[n] < most_square;
                squares[n] = spacing * std::clamp(std::sqrt(squares[n]) - radius, -float(kBand), float(kBand));
            }
        }
    });
    // Those that no ball reaches after all are background.
    size_t kept = 0;
    for (size_t b = 0; b < bricks; ++b) {
        if (reached[b] == 0) continue;
        const uint64_t brick = parts[begins[b]].brick;
        out.corners.push_back({8 * int32_t(uint32_t(brick)), 8 * int32_t(uint32_t(brick >> 32))});
        if (kept != b)
            std::copy_n(out.values.data() + b * kFieldBrickSamples, kFieldBrickSamples, out.values.data() + kept * kFieldBrickSamples);
        ++kept;
    }
    out.values.resize(kept * kFieldBrickSamples);
}

}  // namespace strata
