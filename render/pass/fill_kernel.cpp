#include "render/pass/fill_kernel.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/parallel.h"
#include "core/simd_target.h"
#include "render/pass/edl_settings.h"
#include "render/pass/fill_criteria.h"
#include "render/srgb.h"

namespace strata {
namespace {

using namespace fill_criteria;

// What a ray from a pixel meets: the rim of a surface, and a place a little inside it.
struct Side {
    int rim_steps = 0, inner_steps = 0;  // of the line; 0: nothing
    size_t rim = 0, inner = 0;           // pixels
    float depth = 0.0f, splat = 0.0f;
};

// A pixel that may be a hole, and the lines on which both sides may be nearer, a bit for each.
struct Candidate {
    int x, y;
    uint32_t lines;
};

using Sides = std::array<Side, size_t(2) * kLines>;  // forwards and backwards along each line

struct Filled {
    size_t pixel = 0;
    Rgba8 color = 0;
    float depth = 0.0f;
    uint8_t splat_px = 0;
    PixelId id = kNoPixelId;
};

class HoleFiller {
public:
    HoleFiller(const GBuffer& in, const FillSettings& settings, const Camera& camera, uint32_t height_px)
        : in_(in), settings_(settings), perspective_(camera.projection == Projection::perspective),
          pixel_world_(pixel_world_size(camera, height_px)) {
        for (size_t splat = 0; splat < reach_px_.size(); ++splat) reach_px_[splat] = trace_px(float(splat));
    }

    // The widest gap beside splats of that diameter, and how wide it may be along a line that is not the best to cross it.
    float gap_px(float splat) const { return settings_.follow_splats ? std::min(settings_.gap_px, splat) : settings_.gap_px; }
    float slanted_px(float gap) const { return gap > 0.0f ? std::max(kSlantedGap * gap, kLeastGap) : 0.0f; }
    // How far rays see where splats are no wider.
    float trace_px(float widest_splat) const { return slanted_px(gap_px(widest_splat)); }
    float unit(float depth) const { return pixel_world_.x() * depth + pixel_world_.y(); }
    // What is linear across the picture on a plane: larger is nearer.
    float nearness(float depth) const { return perspective_ ? 1.0f / depth : -depth; }
    // Nearness that must be exceeded around a pixel for it to be a hole; a little less, for rounding.
    float least_nearness(float depth, float splat) const {
        const float margin = 0.99f * (kHoleDepth * splat + kHoleSlope);
        return perspective_ ? (1.0f + pixel_world_.x() * margin) / depth : pixel_world_.y() * margin - depth;
    }

    std::optional<Filled> fill(const Candidate& candidate, float trace_px) const;

private:
    Side trace(int x, int y, const Line& line, int sign, int steps) const;
    std::optional<Filled> blend(size_t pixel, const Sides& sides) const;

    const GBuffer& in_;
    FillSettings settings_;
    bool perspective_;
    Vec2f pixel_world_;
    std::array<float, 256> reach_px_;  // how far from a sample it may close a gap, by its diameter
};

// Steps until a coordinate that moves by `step` leaves [0, size).
int steps_inside(int from, int step, int size) { return step == 0 ? size : step > 0 ? (size - 1 - from) / step : from / -step; }

Side HoleFiller::trace(int x, int y, const Line& line, int sign, int steps) const {
    Side side;
    const int step_x = sign * line.x, step_y = sign * line.y;
    const int inside = std::min(steps_inside(x, step_x, int(in_.width)), steps_inside(y, step_y, int(in_.rows)));
    const ptrdiff_t step = ptrdiff_t(step_y) * in_.width + step_x;
    const size_t pixel = size_t(y) * in_.width + size_t(x);
    const float own_depth = in_.depths[pixel], own_splat = float(in_.splat_px[pixel]);
    float before = own_depth;  // what a sample must lie before to count
    size_t q = pixel;
    for (int k = 1; k <= std::min(steps, inside); ++k) {
        q += size_t(step);
        const float depth = in_.depths[q];
        if (!(depth < before)) continue;
        const float splat = float(in_.splat_px[q]), u = unit(depth), distance = float(k) * line.length;
        if (distance > reach_px_[in_.splat_px[q]]) continue;
        if (!(own_depth - depth > u * (kHoleDepth * std::max(splat, own_splat) + kHoleSlope * distance))) continue;
        // A later sample counts where it lies clearly before the surface found so far.
        if (side.rim_steps > 0 &&
            !(side.depth - depth > u * (kHoleDepth * splat + kSteepest * float(k - side.rim_steps) * line.length)))
            continue;
        const int deeper = std::max(1, int(std::min(kSupport * splat, kMostSupport) / line.length + 0.5f));
        if (k + deeper > inside) continue;
        const size_t inner = q + size_t(deeper * step);
        if (!(std::abs(in_.depths[inner] - depth) <= u * (kSameDepth * splat + kSteepest * float(deeper) * line.length))) continue;
        side = {k, k + deeper, q, inner, depth, splat};
        before = depth;
    }
    return side;
}

std::optional<Filled> HoleFiller::fill(const Candidate& candidate, float trace_px) const {
    const auto [x, y, lines] = candidate;
    int left = std::popcount(lines);  // lines that are not refused yet
    Sides sides;
    bool narrow = false;
    for (int i = 0; i < kLines; ++i) {
        if ((lines >> i & 1u) == 0) continue;
        const Line& line = kLine[i];
        Side& a = sides[size_t(2 * i)];
        Side& b = sides[size_t(2 * i + 1)];
        const int steps = int(trace_px / line.length), most_steps = int(slanted_px(settings_.gap_px) / line.length);
        a = trace(x, y, line, 1, steps);
        b = a.rim_steps == 0 ? Side() : trace(x, y, line, -1, std::min(steps, most_steps + 1 - a.rim_steps));
        const float gap = float(a.rim_steps + b.rim_steps - 1) * line.length, widest = gap_px(0.5f * (a.splat + b.splat));
        const float apart = unit(std::min(a.depth, b.depth)) * (kSameDepth * std::max(a.splat, b.splat) + kSteepest * gap);
        if (b.rim_steps == 0 || gap > slanted_px(widest) || !(std::abs(a.depth - b.depth) <= apart)) {
            a.rim_steps = b.rim_steps = 0;
            if (--left < kLeastLines) return std::nullopt;
            continue;
        }
        narrow |= gap <= widest;
    }
    if (!narrow) return std::nullopt;
    return blend(size_t(y) * in_.width + size_t(x), sides);
}

// The weighted least-squares plane nearness = at + x * slope.x + y * slope.y, and how far its samples lie off it.
struct Plane {
    float at, slope_x, slope_y, off;
};

class PlaneSamples {
public:
    void add(float x, float y, float nearness, float weight) { samples_[size_++] = {x, y, nearness, weight}; }
    Plane fit() const;

private:
    struct Sample {
        float x, y, nearness, weight;
    };
    std::array<Sample, size_t(4) * kLines> samples_;
    size_t size_ = 0;
};

Plane PlaneSamples::fit() const {
    Sample mean = {};
    for (const Sample& s : std::span(samples_).first(size_)) {
        mean.weight += s.weight;
        mean.x += s.weight * s.x;
        mean.y += s.weight * s.y;
        mean.nearness += s.weight * (s.nearness - samples_[0].nearness);
    }
    mean.x /= mean.weight, mean.y /= mean.weight;
    mean.nearness = samples_[0].nearness + mean.nearness / mean.weight;
    float xx = 0.0f, xy = 0.0f, yy = 0.0f, xf = 0.0f, yf = 0.0f;
    for (const Sample& s : std::span(samples_).first(size_)) {
        const float x = s.x - mean.x, y = s.y - mean.y, f = s.nearness - mean.nearness;
        xx += s.weight * x * x, xy += s.weight * x * y, yy += s.weight * y * y;
        xf += s.weight * x * f, yf += s.weight * y * f;
    }
    const float determinant = xx * yy - xy * xy;  // five lines in the plane: far from 0
    Plane plane;
    plane.slope_x = (xf * yy - yf * xy) / determinant;
    plane.slope_y = (yf * xx - xf * xy) / determinant;
    plane.at = mean.nearness - plane.slope_x * mean.x - plane.slope_y * mean.y;
    float squares = 0.0f;
    for (const Sample& s : std::span(samples_).first(size_)) {
        const float off = s.nearness - mean.nearness - plane.slope_x * (s.x - mean.x) - plane.slope_y * (s.y - mean.y);
        squares += s.weight * off * off;
    }
    plane.off = std::sqrt(squares / mean.weight);
    return plane;
}

std::optional<Filled> HoleFiller::blend(size_t pixel, const Sides& sides) const {
    const auto& linear = linear_from_srgb8();
    PlaneSamples samples;
    float weights = 0.0f, red = 0.0f, green = 0.0f, blue = 0.0f, splat = 0.0f, nearest = 0.0f;
    size_t source = pixel;
    for (size_t i = 0; i < sides.size(); ++i) {
        const Side& side = sides[i];
        if (side.rim_steps == 0) continue;
        const Line& line = kLine[i / 2];
        const float sign = i % 2 == 0 ? 1.0f : -1.0f, distance = float(side.rim_steps) * line.length;
        const float weight = 1.0f / (distance * distance);
        const float rim = sign * float(side.rim_steps), inner = sign * float(side.inner_steps);
        samples.add(inner * float(line.x), inner * float(line.y), nearness(in_.depths[side.inner]), weight);
        samples.add(rim * float(line.x), rim * float(line.y), nearness(side.depth), kRimWeight * weight);
        const Rgba8 color = in_.colors[side.rim];
        red += weight * linear[red_of(color)];
        green += weight * linear[green_of(color)];
        blue += weight * linear[blue_of(color)];
        splat += weight * side.splat;
        weights += weight;
        if (weight > nearest) {
            nearest = weight;
            source = side.rim;
        }
    }
    const Plane plane = samples.fit();
    const float depth = perspective_ ? 1.0f / plane.at : -plane.at;
    if (!(depth > 0.0f) || (perspective_ && depth == kNoDepth)) return std::nullopt;
    const float depth_per_nearness = perspective_ ? depth * depth : 1.0f, u = unit(depth);
    const float slope = std::hypot(plane.slope_x, plane.slope_y) * depth_per_nearness / u;
    if (!(plane.off * depth_per_nearness <= u * (splat / weights) * (kRough + kRoughSlope * slope))) return std::nullopt;
    const Rgba8 color = make_rgba(srgb8_from_linear(red / weights), srgb8_from_linear(green / weights),
                                  srgb8_from_linear(blue / weights), alpha_of(in_.colors[source]));
    return Filled{pixel, color, depth, in_.splat_px[source], in_.ids.empty() ? kNoPixelId : in_.ids[source]};
}

constexpr int kTile = 128;
constexpr size_t kTilesAtOnce = 4;
constexpr int32_t kCount = 1 << kLines;
constexpr float kFarthest = std::numeric_limits<float>::lowest();

// out[i] = the larger, or the smaller, of two values.
template <bool larger>
inline void pick(const float* __restrict a, const float* __restrict b, float* __restrict out, int count) {
    for (int i = 0; i < count; ++i) out[i] = (larger ? a[i] > b[i] : a[i] < b[i]) ? a[i] : b[i];
}
// counts[i] += amount where the value is above its level.
inline void count_above(const float* __restrict values, const float* __restrict levels, int32_t amount, int32_t* __restrict counts,
                 int count) {
    for (int i = 0; i < count; ++i) counts[i] += values[i] > levels[i] ? amount : 0;
}

// Finds the pixels of a tile that may be holes: on 5 lines both sides are nearer, with a gap between them that is not too
// wide. For all pixels at once, that is a morphological closing of nearness along each line.
class CandidateFinder {
public:
    CandidateFinder(const GBuffer& in, const HoleFiller& filler, SimdLevel level)
        : in_(in), filler_(filler),
          close_(level == SimdLevel::avx512 ? close_avx512 : level == SimdLevel::avx2 ? close_avx2 : close_baseline) {}

    // How far rays from the tile found last need to see.
    float trace_px() const { return trace_px_; }
    // Pixels of the tile at (left, top), in the order of the picture.
    const std::vector<Candidate>& find(int left, int top);

private:
    float widest_splat(int left, int top) const;
    void load(int left, int top);
    void close_along(int line_index);
    static void close_baseline(CandidateFinder& finder, int line);
    static void close_avx2(CandidateFinder& finder, int line);
    static void close_avx512(CandidateFinder& finder, int line);

    struct Box {
        int left, top, right, bottom;  // from the tile's first pixel
    };
    // The tile and kPad pixels around it.
    static constexpr int kPad = int(FillSettings::kWidestGap * kSlantedGap);
    static constexpr int kSide = kTile + 2 * kPad;
    using Plate = std::array<float, size_t(kSide) * kSide>;
    static size_t at(int x, int y) { return size_t(y + kPad) * kSide + size_t(x + kPad); }
    template <bool larger>
    static void fold(const Box& box, int run, int step_x, int step_y, const Plate*& from, Plate*& to, Plate*& spare);

    const GBuffer& in_;
    const HoleFiller& filler_;
    void (*const close_)(CandidateFinder&, int line);
    int width_ = 0, rows_ = 0;  // of the tile
    float trace_px_ = 0.0f;
    Plate nearness_ = {}, levels_ = {}, first_ = {}, second_ = {};
    std::array<int32_t, size_t(kSide) * kSide> lines_ = {};  // that cross a gap at the pixel: their number times kCount, and a bit for each
    std::vector<Candidate> found_;
};

float CandidateFinder::widest_splat(int left, int top) const {
    uint8_t widest = 0;
    const int begin = std::max(left - kPad, 0), end = std::min(left + width_ + kPad, int(in_.width));
    for (int y = std::max(top - kPad, 0); y < std::min(top + rows_ + kPad, int(in_.rows)); ++y) {
        const uint8_t* const row = in_.splat_px.data() + size_t(y) * in_.width;
        for (int x = begin; x < end; ++x) widest = std::max(widest, row[x]);
    }
    return float(widest);
}

void CandidateFinder::load(int left, int top) {
    nearness_.fill(kFarthest);
    for (int y = std::max(-kPad, -top); y < std::min(rows_ + kPad, int(in_.rows) - top); ++y) {
        const size_t row = size_t(top + y) * in_.width + size_t(left);
        const int begin = std::max(-kPad, -left), end = std::min(width_ + kPad, int(in_.width) - left);
        const float* const depths = in_.depths.data() + row;
        float* const nearness = nearness_.data() + at(0, y);
        for (int x = begin; x < end; ++x) nearness[x] = depths[x] == kNoDepth ? kFarthest : filler_.nearness(depths[x]);
        if (y < 0 || y >= rows_) continue;
        float* const levels = levels_.data() + at(0, y);
        for (int x = 0; x < width_; ++x)
            levels[x] = depths[x] == kNoDepth ? kFarthest : filler_.least_nearness(depths[x], float(in_.splat_px[row + size_t(x)]));
    }
}

// Of each value and the `run` - 1 that follow it, a step of the line apart, the picked one. Only windows inside the box are
// whole; those of the tile are.
template <bool larger>
void CandidateFinder::fold(const Box& box, int run, int step_x, int step_y, const Plate*& from, Plate*& to, Plate*& spare) {
    for (int covered = 1; covered < run;) {
        const int step = std::min(covered, run - covered), sx = step * step_x, sy = step * step_y;
        const int begin = std::max(box.left, box.left - sx), end = std::min(box.right, box.right - sx);
        for (int y = std::max(box.top, box.top - sy); y < std::min(box.bottom, box.bottom - sy); ++y)
            pick<larger>(from->data() + at(begin, y), from->data() + at(begin + sx, y + sy), to->data() + at(begin, y), end - begin);
        covered += step;
        from = to;
        std::swap(to, spare);
    }
}

void CandidateFinder::close_along(int line_index) {
    const Line& line = kLine[line_index];
    // The samples strictly between the two sides of a gap that counts are fewer than these.
    const int run = int(trace_px_ / line.length) + 1;
    if (run < 2) return;
    const int across = (run - 1) * std::abs(line.x), down = (run - 1) * std::abs(line.y);
    const Box box = {-across, -down, width_ + across, rows_ + down};
    const Plate* closed = &nearness_;
    Plate *to = &first_, *spare = &second_;
    fold<true>(box, run, line.x, line.y, closed, to, spare);
    fold<false>(box, run, -line.x, -line.y, closed, to, spare);
    for (int y = 0; y < rows_; ++y)
        count_above(closed->data() + at(0, y), levels_.data() + at(0, y), kCount | 1 << line_index, lines_.data() + at(0, y), width_);
}

STRATA_KERNEL_BASELINE void CandidateFinder::close_baseline(CandidateFinder& finder, int line) { finder.close_along(line); }
STRATA_KERNEL_AVX2 void CandidateFinder::close_avx2(CandidateFinder& finder, int line) { finder.close_along(line); }
STRATA_KERNEL_AVX512 void CandidateFinder::close_avx512(CandidateFinder& finder, int line) { finder.close_along(line); }

const std::vector<Candidate>& CandidateFinder::find(int left, int top) {
    found_.clear();
    width_ = std::min(kTile, int(in_.width) - left);
    rows_ = std::min(kTile, int(in_.rows) - top);
    trace_px_ = filler_.trace_px(widest_splat(left, top));
    if (trace_px_ <= 0.0f) return found_;
    load(left, top);
    lines_.fill(0);
    for (int i = 0; i < kLines; ++i) {
        // Somewhere all lines before but three must cross a gap.
        if (i > kLines - kLeastLines && *std::max_element(lines_.begin(), lines_.end()) < kCount * (i - (kLines - kLeastLines)))
            return found_;
        close_(*this, i);
    }
    for (int y = 0; y < rows_; ++y)
        for (int x = 0; x < width_; ++x)
            if (lines_[at(x, y)] >= kCount * kLeastLines) found_.push_back({left + x, top + y, uint32_t(lines_[at(x, y)] % kCount)});
    return found_;
}

}  // namespace

void fill_holes(GBuffer& gbuffer, const FillSettings& settings, const Camera& camera, uint32_t height_px, int threads,
                SimdLevel level) {
    const HoleFiller filler(gbuffer, settings, camera, height_px);
    const size_t across = (gbuffer.width + kTile - 1) / kTile, tiles = across * ((gbuffer.rows + kTile - 1) / kTile);
    // All are found before any is filled, so that neither tiles nor their order show.
    std::vector<std::vector<Filled>> filled(tiles);
    parallel_blocks(threads, tiles, kTilesAtOnce, [&](size_t first, size_t last) {
        const auto finder = std::make_unique<CandidateFinder>(gbuffer, filler, level);
        for (size_t tile = first; tile < last; ++tile)
            for (const Candidate& candidate : finder->find(int(tile % across) * kTile, int(tile / across) * kTile))
                if (const auto found = filler.fill(candidate, finder->trace_px())) filled[tile].push_back(*found);
    });
    for (const std::vector<Filled>& block : filled)
        for (const Filled& pixel : block) {
            gbuffer.colors[pixel.pixel] = pixel.color;
            gbuffer.depths[pixel.pixel] = pixel.depth;
            gbuffer.splat_px[pixel.pixel] = pixel.splat_px;
            if (!gbuffer.ids.empty()) gbuffer.ids[pixel.pixel] = pixel.id;
        }
}

}  // namespace strata
