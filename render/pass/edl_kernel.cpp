#include "render/pass/edl_kernel.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "core/parallel.h"
#include "core/simd_target.h"
#include "render/srgb.h"

namespace strata {
namespace {

constexpr int kSegment = 64;     // pixels of a row shaded at a time: their values stay in the nearest cache
constexpr float kOutside = std::numeric_limits<float>::quiet_NaN();

struct EdlInput {
    const GBuffer& gbuffer;
    std::array<int, EdlSettings::kScales> reach_px;
    float strength, most_response;
    bool follow_splats;
    Vec2f pixel_world;
};

using Lane = std::array<float, kSegment>;

// Pixels of a segment, and the sums over their neighbors.
struct Segment {
    alignas(64) Lane depth, inverse_unit, sum, counted;
    alignas(64) std::array<int32_t, kSegment> reach;
};

// e^x for x in [-87, 0], to 2 units of the last place: plain operations alone, so that every instruction set rounds alike.
// source  the range reduction of W. Cody and W. Waite; the Taylor series of 7 terms errs by 2e-8 for |r| <= ln 2 / 2
inline float exp_below_zero(float x) {
    x = std::max(x, -87.0f);
    const float shifted = x * 1.44269504f + 12582912.0f;  // 1.5 * 2^23: the sum's last bits are the nearest integer
    const float n = shifted - 12582912.0f;
    const float r = (x - n * 0.693359375f) - n * -2.12194440e-4f;
    float p = 1.0f / 5040.0f;
    p = p * r + 1.0f / 720.0f;
    p = p * r + 1.0f / 120.0f;
    p = p * r + 1.0f / 24.0f;
    p = p * r + 1.0f / 6.0f;
    p = p * r + 0.5f;
    p = p * r + 1.0f;
    p = p * r + 1.0f;
    return p * std::bit_cast<float>((std::bit_cast<int32_t>(shifted) + (127 - 0x4b400000)) << 23);
}

inline float within(float slope, float most) { return std::min(std::max(slope, 0.0f), most); }

// Adds the responses of a pixel's two neighbors on opposite sides to those lanes that look so far.
// before, after  depths of the neighbors of lane 0 on
// border         whether some may be outside
template <bool border>
inline void add_pair(Segment& s, int reach, const float* before, const float* after, float inverse_length, float most) {
    for (int i = 0; i < kSegment; ++i) {
        const float scale = inverse_length * s.inverse_unit[size_t(i)], depth = s.depth[size_t(i)];
        const float a = (depth - before[i]) * scale, b = (depth - after[i]) * scale;
        float pair = within(a, most) + within(b, most);
        float count = 2.0f;
        if constexpr (border) {
            const bool no_a = before[i] != before[i], no_b = after[i] != after[i];
            const float known = no_a ? b : a;  // of a pair of which one is outside
            const float one = within(known, most) + (-known <= most ? within(-known, most) : 0.0f);
            pair = no_a | no_b ? one : pair;
            pair = no_a & no_b ? 0.0f : pair;
            count = no_a & no_b ? 0.0f : count;
        }
        const bool wanted = s.reach[size_t(i)] == reach;
        s.sum[size_t(i)] += wanted ? pair : 0.0f;
        if constexpr (border) s.counted[size_t(i)] += wanted ? count : 0.0f;
    }
}

// Copies depths of a row from column x on; what lies beyond the picture is kOutside.
inline const float* copy_row(const GBuffer& in, int x, int y, float* out) {
    if (y < 0 || y >= int(in.rows)) {
        std::fill(out, out + kSegment, kOutside);
        return out;
    }
    const float* const row = in.depths.data() + size_t(y) * in.width;
    const int begin = std::clamp(-x, 0, kSegment), end = std::clamp(int(in.width) - x, begin, kSegment);
    std::fill(out, out + begin, kOutside);
    std::copy(row + x + begin, row + x + end, out + begin);
    std::fill(out + end, out + kSegment, kOutside);
    return out;
}

// All neighbors at one reach of the segment that begins at (x, y).
inline void add_neighbors(const GBuffer& in, int x, int y, int reach, float most, Segment& s) {
    const int d = diagonal_px(reach);
    const float axis = 1.0f / float(reach), diagonal = 1.0f / (float(d) * 1.41421356f);
    const bool inside = x >= reach && x + kSegment + reach <= int(in.width) && y >= reach && y + reach < int(in.rows);
    if (inside) {
        const float* const center = in.depths.data() + size_t(y) * in.width + size_t(x);
        const ptrdiff_t width = ptrdiff_t(in.width);
        add_pair<false>(s, reach, center - reach, center + reach, axis, most);
        add_pair<false>(s, reach, center - reach * width, center + reach * width, axis, most);
        add_pair<false>(s, reach, center - d * width - d, center + d * width + d, diagonal, most);
        add_pair<false>(s, reach, center - d * width + d, center + d * width - d, diagonal, most);
        for (int i = 0; i < kSegment; ++i) s.counted[size_t(i)] += s.reach[size_t(i)] == reach ? 8.0f : 0.0f;
        return;
    }
    alignas(64) Lane before, after;
    const auto add = [&](int step_x, int step_y, float inverse_length) {
        copy_row(in, x - step_x, y - step_y, before.data());
        copy_row(in, x + step_x, y + step_y, after.data());
        add_pair<true>(s, reach, before.data(), after.data(), inverse_length, most);
    };
    add(reach, 0, axis);
    add(0, reach, axis);
    add(d, d, diagonal);
    add(d, -d, diagonal);
}

// Darkens colors by what the segment's sums say.
//   linear light * s, encoded: where input and output lie on the curve's power part that is (code + 14.025) s^(1/2.4) - 14.025,
//   without a table; dark outputs lie on its linear part.
inline void shade_segment(const Segment& s, float strength, const Rgba8* in, Rgba8* out, int count, const float* linear) {
    constexpr float kOffset = 0.055f * 255.0f, kDarkest = 0.0031308f;
    for (int i = 0; i < count; ++i) {
        const float light = -strength * (s.sum[size_t(i)] / std::max(s.counted[size_t(i)], 1.0f));
        const float shade = exp_below_zero(light), encoded_shade = exp_below_zero(light * (1.0f / 2.4f));
        const Rgba8 color = in[i];
        const auto channel = [&](int shift) {
            const uint32_t code = color >> shift & 255;
            const float value = linear[code] * shade;
            const float bright = (float(code) + kOffset) * encoded_shade - kOffset;
            return Rgba8(int32_t((value <= kDarkest ? value * (12.92f * 255.0f) : bright) + 0.5f)) << shift;
        };
        const Rgba8 shaded = channel(0) | channel(8) | channel(16) | (color & 0xff000000u);
        out[i] = s.sum[size_t(i)] > 0.0f ? shaded : color;
    }
}

inline void shade_row(const EdlInput& input, uint32_t y, Rgba8* out) {
    const GBuffer& in = input.gbuffer;
    const float* const linear = linear_from_srgb8().data();
    for (uint32_t x = 0; x < in.width; x += kSegment) {
        const int count = int(std::min<uint32_t>(kSegment, in.width - x));
        const size_t pixel = size_t(y) * in.width + x;
        Segment s;
        bool any = false;
        for (int i = 0; i < kSegment; ++i) {
            const float depth = i < count ? in.depths[pixel + size_t(i)] : kNoDepth;
            const bool drawn = depth != kNoDepth;
            any |= drawn;
            // Pixels that show nothing are nearer than all, so that nothing darkens them.
            s.depth[size_t(i)] = drawn ? depth : -kNoDepth;
            s.inverse_unit[size_t(i)] = 1.0f / (input.pixel_world.x() * (drawn ? depth : 1.0f) + input.pixel_world.y());
            s.sum[size_t(i)] = 0.0f;
            s.counted[size_t(i)] = 0.0f;
        }
        if (!any) {
            std::copy_n(in.colors.data() + pixel, count, out + x);
            continue;
        }
        for (const int least : input.reach_px) {
            int low = INT32_MAX, high = 0;
            for (int i = 0; i < kSegment; ++i) {
                const bool drawn = s.depth[size_t(i)] >= 0.0f;
                const int splat = input.follow_splats && i < count ? in.splat_px[pixel + size_t(i)] : 0;
                s.reach[size_t(i)] = drawn ? std::max(least, splat) : 0;
                low = std::min(low, drawn ? s.reach[size_t(i)] : INT32_MAX);
                high = std::max(high, s.reach[size_t(i)]);
            }
            for (int reach = low; reach <= high; ++reach)
                if (reach == low || reach == high || std::find(s.reach.begin(), s.reach.end(), reach) != s.reach.end())
                    add_neighbors(in, int(x), int(y), reach, input.most_response, s);
        }
        shade_segment(s, input.strength, in.colors.data() + pixel, out + x, count, linear);
    }
}

STRATA_KERNEL_BASELINE void shade_row_baseline(const EdlInput& input, uint32_t y, Rgba8* out) { shade_row(input, y, out); }
STRATA_KERNEL_AVX2 void shade_row_avx2(const EdlInput& input, uint32_t y, Rgba8* out) { shade_row(input, y, out); }
STRATA_KERNEL_AVX512 void shade_row_avx512(const EdlInput& input, uint32_t y, Rgba8* out) { shade_row(input, y, out); }

}  // namespace

void shade_edl(const GBuffer& in, const EdlSettings& settings, const Camera& camera, uint32_t height_px, uint32_t first,
               uint32_t rows, int threads, std::span<Rgba8> out, SimdLevel level) {
    EdlInput input = {in, {}, settings.strength, settings.most_response, settings.follow_splats, pixel_world_size(camera, height_px)};
    for (int scale = 0; scale < EdlSettings::kScales; ++scale) input.reach_px[size_t(scale)] = settings.reach_px(height_px, scale);
    const auto kernel = level == SimdLevel::avx512 ? shade_row_avx512 : level == SimdLevel::avx2 ? shade_row_avx2 : shade_row_baseline;
    parallel_blocks(threads, rows, 8, [&](size_t begin, size_t end) {
        for (size_t row = begin; row < end; ++row) kernel(input, first + uint32_t(row), out.data() + row * in.width);
    });
}

}  // namespace strata
