#include "core/surface/point_balls.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

constexpr double kBand = 2.0;         // spacings
constexpr uint64_t kRecordParts = 8;  // of the memory one is for records of points
constexpr double kMostRadius = 6.0;   // spacings, so that a ball reaches no farther than into the next layer

int32_t brick_of(float place) { return int32_t(std::floor(place)) >> 3; }

PointGrid grid_of(const Box3d& bounds, const PointBallsSettings& settings) {
    const double steps = settings.radius / settings.spacing;
    if (!(settings.spacing > 0.0 && steps >= 1.0 && steps <= kMostRadius))
        throw Error(ErrorKind::usage, "the radius of balls is from 1 to 6 spacings of samples");
    return PointGrid::around(bounds, settings.spacing, steps + kBand);
}

std::unique_ptr<PointLayers> layers_of(const PointSource& points, const PointGrid& grid, const PointBallsSettings& settings, ScratchBlocks& scratch) {
    auto layers = std::make_unique<PointLayers>(grid, settings.form, settings.memory_bytes / kRecordParts, scratch);
    layers->distribute(points, settings.threads, settings.on_points);
    return layers;
}

}  // namespace

PointBalls::PointBalls(const PointSource& points, const Box3d& bounds, const PointBallsSettings& settings)
    : settings_(settings),
      reach_(float(settings.radius / settings.spacing + kBand)),
      scratch_(settings.scratch),
      layers_(layers_of(points, grid_of(bounds, settings), settings, scratch_)) {
    if (layers_->outside() == 0 || !settings.bounds_of_all) return;
    const Box3d all = settings.bounds_of_all(std::exchange(layers_, nullptr)->outside());
    layers_ = layers_of(points, grid_of(all, settings), settings, scratch_);
}

float PointBalls::background() const { return float(kBand * settings_.spacing); }

// What is left beside records, layers of points and places: all of it known from the points alone.
uint64_t PointBalls::room() const {
    uint64_t held = settings_.memory_bytes / kRecordParts + window_.memory_bytes();
    for (const auto& places : near_) held += places.size() * sizeof places[0];
    return settings_.memory_bytes - std::min(held, settings_.memory_bytes);
}

void PointBalls::load(size_t layer) {
    std::vector<std::array<int32_t, 3>>& places = near_[layer % 3];
    places = std::vector<std::array<int32_t, 3>>();  // {} would keep the memory
    if (layers_->points(layer) == 0) return;
    if (settings_.keep_points) window_.put(layer, std::make_shared<PointLayer>(layers_->take(layer, true, room(), &places)));
    else layers_->take_places(layer, room(), places);
}

// The bricks of the layer that balls reach into, and the nearest center to each of their samples.
void PointBalls::fill(FieldBrickLayer& out) {
    struct Part {
        uint32_t brick;  // j above i: of 2^15 bricks at most, an axis
        std::array<float, 3> center;
    };
    const float low = float(out.k) - reach_, high = float(out.k + kFieldBrickSide - 1) + reach_;
    const double units = layers_->grid().units;
    const auto visit_parts = [&](const auto& visit) {
        for (const std::vector<std::array<int32_t, 3>>& centers : near_)
            for (const std::array<int32_t, 3>& center : centers) {
                const std::array<float, 3> c = {float(center[0] / units), float(center[1] / units), float(center[2] / units)};
                if (c[2] < low || c[2] > high) continue;
                for (int32_t j = brick_of(c[1] - reach_); j <= brick_of(c[1] + reach_); ++j)
                    for (int32_t i = brick_of(c[0] - reach_); i <= brick_of(c[0] + reach_); ++i) visit(Part{uint32_t(j) << 16 | uint32_t(i), c});
            }
    };
    const uint64_t room = this->room();
    uint64_t count = 0;
    visit_parts([&](const Part&) { ++count; });
    if (count * sizeof(Part) > room)
        throw Error(ErrorKind::limit, "the balls of one layer of bricks need " + std::to_string(count * sizeof(Part)) + " bytes of memory, " + std::to_string(room) +
                                          " are left of what is allowed; a larger spacing, or fewer points, need less");
    std::vector<Part> parts;
    parts.reserve(count);
    visit_parts([&](const Part& part) { parts.push_back(part); });
    std::sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.brick < b.brick; });
    std::vector<size_t> begins;
    for (size_t i = 0; i < parts.size(); ++i)
        if (i == 0 || parts[i].brick != parts[i - 1].brick) begins.push_back(i);
    begins.push_back(parts.size());
    const size_t bricks = begins.size() - 1;
    const uint64_t brick_bytes = bricks * (kFieldBrickSamples * sizeof(float) + sizeof(size_t) + sizeof out.corners[0]), left = room - count * sizeof(Part);
    if (brick_bytes > left)
        throw Error(ErrorKind::limit, "one layer of bricks needs " + std::to_string(brick_bytes) + " bytes of memory, " + std::to_string(left) +
                                          " are left of what is allowed; a larger spacing needs less");
    out.values.resize(bricks * kFieldBrickSamples);
    std::vector<uint8_t> reached(bricks);
    const float radius = float(settings_.radius / settings_.spacing), most_square = reach_ * reach_, spacing = float(settings_.spacing);
    parallel_blocks(settings_.threads, bricks, 16, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b) {
            float* const squares = out.values.data() + b * kFieldBrickSamples;
            std::fill_n(squares, kFieldBrickSamples, most_square);
            const uint32_t brick = parts[begins[b]].brick;
            const float first_i = float(8 * (brick & 0xffff)), first_j = float(8 * (brick >> 16));
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
        const uint32_t brick = parts[begins[b]].brick;
        out.corners.push_back({8 * int32_t(brick & 0xffff), 8 * int32_t(brick >> 16)});
        if (kept != b)
            std::copy_n(out.values.data() + b * kFieldBrickSamples, kFieldBrickSamples, out.values.data() + kept * kFieldBrickSamples);
        ++kept;
    }
    out.values.resize(kept * kFieldBrickSamples);
}

}  // namespace strata
