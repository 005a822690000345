#include "render/pass/ssao_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/parallel.h"
#include "core/simd_target.h"
#include "render/pass/edl_settings.h"
#include "render/pass/ssao_directions.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr size_t kBlockRows = 8;
constexpr float kFullRadius = 0.6f;    // share of the radius within which occluders count in full
constexpr float kRelief = 0.05f;        // pixels of height, and
constexpr float kSplatRelief = 0.05f;   // splats of height, that do not occlude: what smoothing leaves of the samples' relief
constexpr float kBlurDepth = 2.0f;     // pixels of height off a pixel's plane, and
constexpr float kBlurSplats = 1.0f;    // splats, from which on another pixel is on another surface
constexpr int kBlurRows = 2;           // above and below

// atan for any value. source: Abramowitz and Stegun 4.4.49, error 1e-5
inline float arc_tangent(float x) {
    const float size = std::abs(x), t = size > 1.0f ? 1.0f / size : size, t2 = t * t;
    const float part = t * (0.9998660f + t2 * (-0.3302995f + t2 * (0.1801410f + t2 * (-0.0851330f + t2 * 0.0208351f))));
    return std::copysign(size > 1.0f ? float(std::numbers::pi / 2) - part : part, x);
}

// Where a row's pixels lie, for rays from the eye: (x, y, 1) in perspective. In orthographic projection they are parallel.
struct RowView {
    float first_x, step_x, y;
};

// The values of a row that all its directions need.
struct RowValues {
    explicit RowValues(int width)
        : rise(size_t(width)), least(size_t(width)), inverse_square(size_t(width)) {
        for (std::vector<float>& side : highest) side.resize(size_t(width));
    }

    std::vector<float> rise;            // heights of nearness 0 over the pixels
    std::vector<float> least;           // heights that do not occlude
    std::vector<float> inverse_square;  // of the radius in pixels
    std::array<std::vector<float>, 4> highest;  // slopes over the surface, for each direction
};

// Raises a row's highest slopes by what lies at an offset.
inline void look(const float* __restrict nearness, const float* __restrict scale, const float* __restrict slope_x,
          const float* __restrict slope_y, const float* __restrict rise, const float* __restrict least,
          const float* __restrict inverse_square, ptrdiff_t offset, float x_px, float y_px, float length_px, int width,
          float* __restrict highest) {
    const float square = length_px * length_px, inverse = 1.0f / length_px;
    constexpr float kFade = 1.0f / (1.0f - kFullRadius * kFullRadius);
    for (int x = 0; x < width; ++x) {
        const float height = scale[x] * nearness[x + offset] + rise[x];
        const float over = height - (slope_x[x] * x_px + slope_y[x] * y_px) - least[x];
        const float inside = kFade * (1.0f - (height * height + square) * inverse_square[x]);
        const float weight = inside < 0.0f ? 0.0f : inside > 1.0f ? 1.0f : inside;
        const float slope = over * inverse * weight;
        highest[x] = slope > highest[x] ? slope : highest[x];
    }
}

// Of light from one half of a slice: the part below the horizon `horizon` (a cotangent to the ray), and the part that an open surface of
// cotangent `tangent` gets. cosine, sine: of the angle from the ray to the normal in the slice, positive to this half's side
inline float light(float horizon, float cosine, float sine) {
    const float square = 1.0f / (1.0f + horizon * horizon);
    const float cos_double = (horizon * horizon - 1.0f) * square, sin_double = 2.0f * horizon * square;
    const float angle = float(std::numbers::pi / 2) - arc_tangent(horizon);
    return 0.25f * (cosine - cos_double * cosine - sin_double * sine + 2.0f * angle * sine);
}

// Visibility from the highest slopes of two slices.
inline void integrate(const RowValues& row, const float* __restrict slope_x, const float* __restrict slope_y, const RowView& view,
               const SsaoDirections& directions, int width, float* __restrict out) {
    const float* __restrict const h0 = row.highest[0].data();
    const float* __restrict const h1 = row.highest[1].data();
    const float* __restrict const h2 = row.highest[2].data();
    const float* __restrict const h3 = row.highest[3].data();
    const float ax = directions[0].x, ay = directions[0].y, bx = directions[2].x, by = directions[2].y;
    for (int x = 0; x < width; ++x) {
        const float ray_x = view.first_x + view.step_x * float(x);
        const float ray = 1.0f + ray_x * ray_x + view.y * view.y, length = std::sqrt(ray);
        // Slopes are towards the eye's plane; the slices contain the ray.
        const float along_a = ax * ray_x + ay * view.y, along_b = bx * ray_x + by * view.y;
        const float scale_a = length / std::sqrt(1.0f - along_a * along_a / ray);
        const float scale_b = length / std::sqrt(1.0f - along_b * along_b / ray);
        const float tangent_a = scale_a * ((ax * slope_x[x] + ay * slope_y[x]) - along_a / ray);
        const float tangent_b = scale_b * ((bx * slope_x[x] + by * slope_y[x]) - along_b / ray);
        const float square_a = 1.0f + tangent_a * tangent_a, square_b = 1.0f + tangent_b * tangent_b;
        const float cosine_a = 1.0f / std::sqrt(square_a), cosine_b = 1.0f / std::sqrt(square_b);
        const float sine_a = -tangent_a * cosine_a, sine_b = -tangent_b * cosine_b;
        // The normal's length in each slice, but for a factor that both share.
        const float weight_a = std::sqrt(square_a), weight_b = std::sqrt(square_b);
        const float got = weight_a * (light(tangent_a + scale_a * h0[x], cosine_a, sine_a) +
                                      light(-tangent_a + scale_a * h1[x], cosine_a, -sine_a)) +
                          weight_b * (light(tangent_b + scale_b * h2[x], cosine_b, sine_b) +
                                      light(-tangent_b + scale_b * h3[x], cosine_b, -sine_b));
        const float open = weight_a * (light(tangent_a, cosine_a, sine_a) + light(-tangent_a, cosine_a, -sine_a)) +
                           weight_b * (light(tangent_b, cosine_b, sine_b) + light(-tangent_b, cosine_b, -sine_b));
        out[x] = std::min(std::max(got / open, 0.0f), 1.0f);
    }
}

// What each 8-bit color becomes in each of 256 steps of visibility.
const std::array<std::array<uint8_t, 256>, 256>& dimmed() {
    static const auto table = [] {
        std::array<std::array<uint8_t, 256>, 256> made;
        for (size_t step = 0; step < 256; ++step)
            for (size_t color = 0; color < 256; ++color)
                made[step][color] = srgb8_from_linear(linear_from_srgb8()[color] * (float(step) / 255.0f));
        return made;
    }();
    return table;
}

// What the kernels work on: rows [begin, end) of one stage.
struct Stage {
    const HalfSurface& surface;
    const GBuffer& gbuffer;
    float radius;
    bool perspective;
    Vec2f pixel_world;
    uint32_t height_px;
    const std::array<SsaoDirections, kSsaoPhases>& directions;
};

// The even or the odd pixels of a row of the picture, and what the samples around them say. [width of the half surface]
struct SpreadRow {
    float *nearness, *inverse, *sum, *weights, *least, *nearest;
};

constexpr float kNoSample = 1e15f;  // more than any sample may be off

// Adds a sample to each pixel: that at `sample` to the first. across, down: from the samples to the pixels, in pixels
inline void spread_sample(const HalfSurface& surface, const float* __restrict open, size_t sample, float across, float down, int count,
                          const SpreadRow& row) {
    const float* __restrict const nearness = surface.nearness.data() + sample;
    const float* __restrict const scale = surface.px_per_nearness.data() + sample;
    const float* __restrict const slope_x = surface.slope_x.data() + sample;
    const float* __restrict const slope_y = surface.slope_y.data() + sample;
    const float* __restrict const own = row.nearness;
    const float* __restrict const inverse = row.inverse;
    float* __restrict const sum = row.sum;
    float* __restrict const weights = row.weights;
    float* __restrict const least = row.least;
    float* __restrict const nearest = row.nearest;
    open += sample;
    for (int i = 0; i < count; ++i) {
        const float height = scale[i] * (own[i] - nearness[i]) - (across * slope_x[i] + down * slope_y[i]);
        const float off = nearness[i] == HalfSurface::kNothing ? kNoSample : std::abs(height * inverse[i]);
        const float inside = 1.0f - off * off, weight = inside > 0.0f ? inside : 0.0f;
        sum[i] += weight * open[i];
        weights[i] += weight;
        nearest[i] = off < least[i] ? open[i] : nearest[i];
        least[i] = off < least[i] ? off : least[i];
    }
}

// What every second pixel begins with: no sample yet. depths, splats: of the first of them
inline void begin_spread(const float* __restrict depths, const uint8_t* __restrict splats, bool perspective, int count,
                         float* __restrict nearness, float* __restrict inverse, const SpreadRow& row) {
    for (int i = 0; i < count; ++i) {
        const float depth = depths[2 * i];
        nearness[i] = perspective ? 1.0f / depth : -depth;
        inverse[i] = 1.0f / (kBlurDepth + kBlurSplats * float(splats[2 * i]));
    }
    std::fill_n(row.sum, count, 0.0f);
    std::fill_n(row.weights, count, 0.0f);
    std::fill_n(row.least, count, kNoSample);
    std::fill_n(row.nearest, count, 1.0f);
}

// A pixel of its own, such as a wire's, takes what lies nearest; with nothing around it, it is open.
inline void end_spread(const float* __restrict depths, const float* __restrict sum, const float* __restrict weights,
                       const float* __restrict nearest, int count, float* __restrict out) {
    for (int i = 0; i < count; ++i) {
        const float mean = sum[i] / (weights[i] > 0.0f ? weights[i] : 1.0f), seen = weights[i] > 0.0f ? mean : nearest[i];
        out[2 * i] = depths[2 * i] == kNoDepth ? 1.0f : seen;
    }
}

// Visibility of a row of the whole picture, from the samples around each pixel that lie on its surface.
inline void spread_row(const Stage& stage, const float* open, int y, float* out) {
    const GBuffer& gbuffer = stage.gbuffer;
    const float* const depths = gbuffer.depths.data() + size_t(y) * gbuffer.width;
    const uint8_t* const splats = gbuffer.splat_px.data() + size_t(y) * gbuffer.width;
    const int picture_row = int(gbuffer.first_row) + y, upper = picture_row / 2 - stage.surface.first_row();
    const size_t size = size_t(stage.surface.width());
    std::vector<float> memory(6 * size);
    float* const values = memory.data();
    const SpreadRow row = {values, values + size, values + 2 * size, values + 3 * size, values + 4 * size, values + 5 * size};
    for (int odd = 0; odd < 2; ++odd) {
        const int count = (int(gbuffer.width) - odd + 1) / 2;
        begin_spread(depths + odd, splats + odd, stage.perspective, count, row.nearness, row.inverse, row);
        for (int below = 0; below <= picture_row % 2; ++below)
            for (int right = 0; right <= odd; ++right)
                spread_sample(stage.surface, open, stage.surface.at(right, upper + below), float(odd - 2 * right),
                              float(picture_row % 2 - 2 * below), count, row);
        end_spread(depths + odd, row.sum, row.weights, row.nearest, count, out + odd);
    }
}

inline void occlude_rows(const Stage& stage, int begin, int end, float* open) {
    const HalfSurface& surface = stage.surface;
    const int width = surface.width();
    const Vec2f pixel_world = stage.pixel_world;
    RowValues row(width);
    for (int y = begin; y < end; ++y) {
        const size_t first = surface.at(0, y);
        const float* const nearness = surface.nearness.data() + first;
        const float* const scale = surface.px_per_nearness.data() + first;
        const float* const splat = surface.splat_px.data() + first;
        for (int x = 0; x < width; ++x) {
            row.rise[size_t(x)] = -scale[x] * nearness[x];
            row.least[size_t(x)] = kRelief + kSplatRelief * splat[x];
            const float unit = stage.perspective ? pixel_world.x() / nearness[x] : pixel_world.y();
            const float radius_px = std::min(std::abs(stage.radius / unit), float(SsaoSettings::kMostPx));
            row.inverse_square[size_t(x)] = 1.0f / (radius_px * radius_px);
        }
        const int half_row = surface.first_row() + y;  // of the whole picture: strips do not show
        const auto& turned = stage.directions[size_t(half_row % kSsaoPhases)];
        for (size_t i = 0; i < turned.size(); ++i) {
            std::fill(row.highest[i].begin(), row.highest[i].end(), 0.0f);
            for (const SsaoOffset& offset : turned[i].offsets)
                look(nearness, scale, &surface.slope_x[first], &surface.slope_y[first], row.rise.data(), row.least.data(),
                     row.inverse_square.data(), offset.y * ptrdiff_t(surface.stride()) + offset.x, 2.0f * float(offset.x),
                     2.0f * float(offset.y), offset.length_px, width, row.highest[i].data());
        }
        const RowView view = stage.perspective
                                 ? RowView{pixel_world.x() * (0.5f - 0.5f * float(stage.gbuffer.width)), 2.0f * pixel_world.x(),
                                           pixel_world.x() * (float(2 * half_row) + 0.5f - 0.5f * float(stage.height_px))}
                                 : RowView{0.0f, 0.0f, 0.0f};
        integrate(row, &surface.slope_x[first], &surface.slope_y[first], view, turned, width, open + first);
    }
}

// Adds to each pixel of a row what lies at an offset, as far as it lies on the pixel's plane. x_px, y_px: the offset, in pixels of the picture
inline void blur_sample(const float* __restrict nearness, const float* __restrict scale, const float* __restrict slope_x,
                        const float* __restrict slope_y, const float* __restrict splat, const float* __restrict open,
                        ptrdiff_t offset, float x_px, float y_px, float share, int width, float* __restrict sum,
                        float* __restrict weights) {
    for (int x = 0; x < width; ++x) {
        const float height = scale[x] * (nearness[x + offset] - nearness[x]) - (x_px * slope_x[x] + y_px * slope_y[x]);
        const float off = height / (kBlurDepth + kBlurSplats * splat[x]), inside = 1.0f - off * off;
        const float weight = share * (inside > 0.0f ? inside : 0.0f);
        sum[x] += weight * open[x + offset];
        weights[x] += weight;
    }
}

// Mean of the rows above and below, in which each phase has the same weight, and of the columns beside.
inline void blur_rows(const Stage& stage, const float* open, int begin, int end, float* out) {
    const HalfSurface& surface = stage.surface;
    const int width = surface.width();
    std::vector<float> weights(static_cast<size_t>(width));
    for (int y = begin; y < end; ++y) {
        const size_t row = surface.at(0, y);
        float* const sum = out + row;
        std::fill_n(sum, width, 0.0f);
        std::fill(weights.begin(), weights.end(), 0.0f);
        for (int dy = -kBlurRows; dy <= kBlurRows; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
                blur_sample(&surface.nearness[row], &surface.px_per_nearness[row], &surface.slope_x[row], &surface.slope_y[row],
                            &surface.splat_px[row], open + row, dy * ptrdiff_t(surface.stride()) + dx, 2.0f * float(dx),
                            2.0f * float(dy), (std::abs(dy) == kBlurRows ? 0.5f : 1.0f) * (dx == 0 ? 2.0f : 1.0f), width, sum,
                            weights.data());
        // Without weight nothing is drawn there, and nothing asks for it.
        for (int x = 0; x < width; ++x) sum[x] /= weights[size_t(x)] > 0.0f ? weights[size_t(x)] : 1.0f;
    }
}

struct Kernels {
    void (*occlude)(const Stage&, int begin, int end, float* open);
    void (*blur)(const Stage&, const float* open, int begin, int end, float* out);
    void (*spread)(const Stage&, const float* open, int y, float* out);
};

STRATA_KERNEL_BASELINE void occlude_baseline(const Stage& s, int begin, int end, float* open) { occlude_rows(s, begin, end, open); }
STRATA_KERNEL_AVX2 void occlude_avx2(const Stage& s, int begin, int end, float* open) { occlude_rows(s, begin, end, open); }
STRATA_KERNEL_AVX512 void occlude_avx512(const Stage& s, int begin, int end, float* open) { occlude_rows(s, begin, end, open); }
STRATA_KERNEL_BASELINE void blur_baseline(const Stage& s, const float* open, int begin, int end, float* out) {
    blur_rows(s, open, begin, end, out);
}
STRATA_KERNEL_AVX2 void blur_avx2(const Stage& s, const float* open, int begin, int end, float* out) {
    blur_rows(s, open, begin, end, out);
}
STRATA_KERNEL_AVX512 void blur_avx512(const Stage& s, const float* open, int begin, int end, float* out) {
    blur_rows(s, open, begin, end, out);
}

STRATA_KERNEL_BASELINE void spread_baseline(const Stage& s, const float* open, int y, float* out) { spread_row(s, open, y, out); }
STRATA_KERNEL_AVX2 void spread_avx2(const Stage& s, const float* open, int y, float* out) { spread_row(s, open, y, out); }
STRATA_KERNEL_AVX512 void spread_avx512(const Stage& s, const float* open, int y, float* out) { spread_row(s, open, y, out); }

Kernels kernels_of(SimdLevel level) {
    switch (level) {
        case SimdLevel::baseline: break;
        case SimdLevel::avx2: return {occlude_avx2, blur_avx2, spread_avx2};
        case SimdLevel::avx512: return {occlude_avx512, blur_avx512, spread_avx512};
    }
    return {occlude_baseline, blur_baseline, spread_baseline};
}

}  // namespace

int SsaoSettings::reach_px() const {
    // The farthest sample; smoothing by 1 + 2 + 4 samples, slopes by 2, blur by 2 and spreading by 1, each of 2 pixels; and one for alignment.
    return radius > 0.0f ? kMostPx + 2 * (7 + 2 + kBlurRows + 1) + 1 : 0;
}

void SsaoKernel::shade(GBuffer& gbuffer, const SsaoSettings& settings, const Camera& camera, uint32_t height_px, int threads,
                     SimdLevel level) {
    surface_.build(gbuffer, camera, height_px, threads);
    open_.resize(surface_.nearness.size());
    blurred_.resize(surface_.nearness.size());
    const std::array<SsaoDirections, kSsaoPhases> directions = ssao_directions();
    const Stage stage = {surface_, gbuffer, settings.radius, camera.projection == Projection::perspective,
                         pixel_world_size(camera, height_px), height_px, directions};
    const Kernels kernels = kernels_of(level);
    const size_t half_rows = size_t(surface_.rows());
    parallel_blocks(threads, half_rows, kBlockRows,
                    [&](size_t begin, size_t end) { kernels.occlude(stage, int(begin), int(end), open_.data()); });
    parallel_blocks(threads, half_rows, kBlockRows,
                    [&](size_t begin, size_t end) { kernels.blur(stage, open_.data(), int(begin), int(end), blurred_.data()); });
    const auto& table = dimmed();
    parallel_blocks(threads, gbuffer.rows, kBlockRows, [&](size_t begin, size_t end) {
        std::vector<float> visible(gbuffer.width);
        for (size_t y = begin; y < end; ++y) {
            kernels.spread(stage, blurred_.data(), int(y), visible.data());
            for (size_t x = 0; x < gbuffer.width; ++x) {
                Rgba8& color = gbuffer.colors[y * gbuffer.width + x];
                const auto& dim = table[size_t(visible[x] * 255.0f + 0.5f)];
                color = make_rgba(dim[red_of(color)], dim[green_of(color)], dim[blue_of(color)], alpha_of(color));
            }
        }
    });
}

}  // namespace strata
