#include "render/pass/depth_normals.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "render/pass/edl_settings.h"

namespace strata {
namespace {

constexpr size_t kBlockRows = 16;
constexpr float kSoft = 1e-2f;        // px^2: extrapolation errors below this do not tell sides apart
constexpr float kMostError = 8.0f;    // px: what both sides fail to extrapolate has no slope
constexpr float kSmoothSplats = 1.0f;  // heights, in splats, beyond which a sample is on another surface; and
constexpr float kSmoothSlope = 3.0f;   // for each pixel of distance

// One pass of an a-trous filter over a row: the 3 x 3 binomial with its samples `step` apart, of those on the same surface. Weights are even
// in the difference, so that a plane stays a plane.
void smooth_row(const float* __restrict nearness, const float* __restrict scale, const float* __restrict splat, int step,
                ptrdiff_t stride, int width, float* __restrict out) {
    const float least_splat = 2.0f * float(step);
    for (int x = 0; x < width; ++x) {
        const float center = nearness[x], reach = kSmoothSplats * splat[x] + kSmoothSlope * 2.0f * float(step);
        const float inverse = scale[x] / reach;
        float sum = 0.0f, weights = 4.0f;
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                if (dx == 0 && dy == 0) continue;
                const float difference = nearness[x + dy * step * stride + dx * step] - center;
                const float off = difference * inverse;
                const float inside = 1.0f - off * off;
                const float weight = (dx == 0 || dy == 0 ? 2.0f : 1.0f) * (inside > 0.0f ? inside : 0.0f);
                sum += weight * difference;
                weights += weight;
            }
        out[x] = splat[x] > least_splat ? center + sum / weights : center;
    }
}

// The slope to the side that extrapolates better: over an edge it does not.
void slope_row(const float* __restrict nearness, const float* __restrict scale, ptrdiff_t step, int width, float* __restrict out) {
    for (int x = 0; x < width; ++x) {
        const float center = nearness[x], a = nearness[x - step], b = nearness[x + step];
        const float before = (center - a) * scale[x], after = (b - center) * scale[x];
        const float error_a = before - (a - nearness[x - 2 * step]) * scale[x];
        const float error_b = (nearness[x + 2 * step] - b) * scale[x] - after;
        const float square_a = error_a * error_a, square_b = error_b * error_b;
        // Each side counts by the error of the other; neither does over a jump.
        const float weight_a = square_a < kMostError * kMostError ? std::min(square_b, kMostError * kMostError) + kSoft : 0.0f;
        const float weight_b = square_b < kMostError * kMostError ? std::min(square_a, kMostError * kMostError) + kSoft : 0.0f;
        out[x] = 0.5f * (weight_a * before + weight_b * after) / std::max(weight_a + weight_b, kSoft);
    }
}

}  // namespace

void HalfSurface::build(const GBuffer& gbuffer, const Camera& camera, uint32_t height_px, int threads) {
    sample(gbuffer, camera, height_px, threads);
    for (const int step : {1, 2, 4}) smooth(step, threads);
    measure_slopes(threads);
}

void HalfSurface::sample(const GBuffer& gbuffer, const Camera& camera, uint32_t height_px, int threads) {
    const int first_odd = int(gbuffer.first_row % 2);
    width_ = int(gbuffer.width + 1) / 2;
    first_row_ = int(gbuffer.first_row + 1) / 2;
    rows_ = (int(gbuffer.rows) - first_odd + 1) / 2;
    stride_ = width_ + 2 * kPad;
    const size_t size = size_t(stride_) * size_t(rows_ + 2 * kPad);
    nearness.assign(size, kNothing);
    px_per_nearness.assign(size, 0.0f);
    splat_px.assign(size, 0.0f);
    slope_x.resize(size);
    slope_y.resize(size);
    const bool perspective = camera.projection == Projection::perspective;
    const Vec2f pixel_world = pixel_world_size(camera, height_px);
    parallel_blocks(threads, size_t(rows_), kBlockRows, [&](size_t begin, size_t end) {
        for (size_t y = begin; y < end; ++y) {
            const size_t row = (2 * y + size_t(first_odd)) * gbuffer.width, out = at(0, int(y));
            for (size_t x = 0; x < size_t(width_); ++x) {
                const float depth = gbuffer.depths[row + 2 * x];
                const bool empty = depth == kNoDepth;
                nearness[out + x] = empty ? kNothing : perspective ? 1.0f / depth : -depth;
                px_per_nearness[out + x] = empty ? 0.0f : perspective ? depth / pixel_world.x() : 1.0f / pixel_world.y();
                splat_px[out + x] = float(gbuffer.splat_px[row + 2 * x]);
            }
        }
    });
}

void HalfSurface::smooth(int step, int threads) {
    // Splats no wider than two samples have no relief at this scale.
    if (*std::max_element(splat_px.begin(), splat_px.end()) <= 2.0f * float(step)) return;
    smoothed_ = nearness;
    parallel_blocks(threads, size_t(rows_), kBlockRows, [&](size_t begin, size_t end) {
        for (size_t y = begin; y < end; ++y) {
            const size_t row = at(0, int(y));
            smooth_row(&nearness[row], &px_per_nearness[row], &splat_px[row], step, stride_, width_, &smoothed_[row]);
        }
    });
    nearness.swap(smoothed_);
}

void HalfSurface::measure_slopes(int threads) {
    parallel_blocks(threads, size_t(rows_), kBlockRows, [&](size_t begin, size_t end) {
        for (size_t y = begin; y < end; ++y) {
            const size_t row = at(0, int(y));
            slope_row(&nearness[row], &px_per_nearness[row], 1, width_, &slope_x[row]);
            slope_row(&nearness[row], &px_per_nearness[row], stride_, width_, &slope_y[row]);
        }
    });
}

}  // namespace strata
