#include "render/pass/points_kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/simd_target.h"
#include "render/pass/point_block.h"

namespace strata {
namespace {

// Rows of a block's points, from the first row of the target; none: first > last.
struct RowRange {
    int32_t first, last;
};

inline void raise(uint64_t& word, uint64_t value) { word = value > word ? value : word; }

inline uint64_t make_word(float key, uint32_t rank) { return uint64_t{std::bit_cast<uint32_t>(key)} << 32 | uint32_t(~rank); }

inline void draw_pixels(const WordRows& target, const PointBlock& block, size_t count, uint32_t rank) {
    alignas(64) uint64_t words[kPointBlock];
    alignas(64) int32_t rows[kPointBlock], columns[kPointBlock];
    const float width = float(target.width), top = float(target.first_row), bottom = float(target.first_row + target.rows);
    const int32_t first_row = int32_t(target.first_row);
    RowRange range = {INT32_MAX, -1};
    for (size_t i = 0; i < count; ++i) {
        const float x = block.x_px[i], y = block.y_px[i];
        const bool seen = (block.key[i] > 0.0f) & (x >= 0.0f) & (x < width) & (y >= top) & (y < bottom);
        rows[i] = seen ? int32_t(seen ? y : 0.0f) - first_row : -1;
        columns[i] = int32_t(seen ? x : 0.0f);
        words[i] = seen ? make_word(block.key[i], rank + uint32_t(i)) : 0;
        range.first = std::min(range.first, seen ? rows[i] : INT32_MAX);
        range.last = std::max(range.last, rows[i]);
    }
    if (range.first > range.last) return;
    // Points that are not seen raise a pixel of the rows that are held by nothing.
    alignas(64) uint32_t pixels[kPointBlock];
    for (size_t i = 0; i < count; ++i)
        pixels[i] = uint32_t(std::max(rows[i], range.first)) * target.stride + uint32_t(columns[i]);
    const BandLocks::Hold hold(target.locks, uint32_t(range.first), uint32_t(range.last));
    for (size_t i = 0; i < count; ++i) raise(target.words[pixels[i]], words[i]);
}

// What each splat of a block covers: columns [left, right) and rows [above, below), counted from the target's first row.
struct Covered {
    alignas(64) int32_t left[kPointBlock];
    alignas(64) int32_t right[kPointBlock];
    alignas(64) int32_t above[kPointBlock];
    alignas(64) int32_t below[kPointBlock];
};

inline RowRange cover_block(const WordRows& target, const PointBlock& block, size_t count, Covered& out) {
    const float width = float(target.width), top = float(target.first_row), bottom = float(target.first_row + target.rows);
    const int32_t first_row = int32_t(target.first_row);
    RowRange range = {INT32_MAX, -1};
    for (size_t i = 0; i < count; ++i) {
        const float x = block.x_px[i], y = block.y_px[i], radius = 0.5f * block.size_px[i];
        // Centers c + 0.5 in (x - radius, x + radius]; at one pixel that is the pixel of the point.
        const float left = std::max(x + (0.5f - radius), 0.0f), right = std::min(x + (0.5f + radius), width);
        const float above = std::max(y + (0.5f - radius), top), below = std::min(y + (0.5f + radius), bottom);
        const bool seen = (block.key[i] > 0.0f) & (left < right) & (above < below);
        out.left[i] = int32_t(seen ? left : 0.0f);
        out.right[i] = int32_t(seen ? right : 0.0f);
        out.above[i] = seen ? int32_t(seen ? above : 0.0f) - first_row : 0;
        out.below[i] = seen ? int32_t(seen ? below : 0.0f) - first_row : 0;
        const bool some = out.above[i] < out.below[i];
        range.first = std::min(range.first, some ? out.above[i] : INT32_MAX);
        range.last = std::max(range.last, some ? out.below[i] - 1 : -1);
    }
    return range;
}

template <SplatShape shape, bool perspective>
inline void draw_splats(const WordRows& target, const PointProjection& view, const PointBlock& block, size_t count, uint32_t rank) {
    Covered covered;
    const RowRange range = cover_block(target, block, count, covered);
    if (range.first > range.last) return;
    const BandLocks::Hold hold(target.locks, uint32_t(range.first), uint32_t(range.last));
    const float inverse_unit = 1.0f / view.pixels_per_unit;
    for (size_t i = 0; i < count; ++i) {
        const float radius = 0.5f * block.size_px[i], key = block.key[i];
        const uint64_t word = make_word(key, rank + uint32_t(i));
        // Below this diameter a disc may miss every center, and the square covers two by two at most.
        const bool round = shape != SplatShape::square && radius > 0.75f;
        const float inverse_square = 1.0f / (radius * radius);
        // Behind the plane the key falls with the square of the distance, by a depth of one radius at the rim, at most to half.
        const float rim = std::min(radius * inverse_unit, 0.5f);
        const float slope_x = block.slope_x[i], slope_y = block.slope_y[i];
        for (int32_t row = covered.above[i]; row < covered.below[i]; ++row) {
            uint64_t* const line = target.words + size_t(row) * target.stride;
            const float dy = float(row + int32_t(target.first_row)) + 0.5f - block.y_px[i];
            for (int32_t column = covered.left[i]; column < covered.right[i]; ++column) {
                uint64_t value = word;
                if (round) {
                    const float dx = float(column) + 0.5f - block.x_px[i];
                    float square = dx * dx + dy * dy;
                    if constexpr (shape == SplatShape::paraboloid) {
                        const float rise = slope_x * dx + slope_y * dy;
                        square = (square + rise * rise) * inverse_square;
                        const float on_plane = key_on_plane<perspective>(view, key, rise, inverse_unit);
                        const float behind = perspective ? on_plane - on_plane * (rim * square) : on_plane + view.key_scale * (rim * square);
                        value = make_word(std::max(behind, kLeastKey), rank + uint32_t(i));
                    } else {
                        square *= inverse_square;
                    }
                    if (square > 1.0f) value = 0;
                }
                raise(line[column], value);
            }
        }
    }
}

template <bool perspective, bool near>
inline void draw_run(const WordRows& target, const PointNode& node, size_t begin, size_t end, const PointProjection& view,
                     const SplatStyle& style) {
    PointBlock block;
    const bool one_pixel = style.fixed_px > 0.0f && style.fixed_px <= 1.0f;
    if (style.fixed_px > 0.0f) {
        std::fill(std::begin(block.size_px), std::end(block.size_px), style.fixed_px);
        std::fill(std::begin(block.slope_x), std::end(block.slope_x), 0.0f);
        std::fill(std::begin(block.slope_y), std::end(block.slope_y), 0.0f);
    }
    const ResidentNode& points = *node.points;
    for (; begin < end; begin += kPointBlock) {
        const size_t count = std::min(kPointBlock, end - begin);
        project_block<perspective, near>(view, &points.x[begin], &points.y[begin], &points.z[begin], count, block);
        const uint32_t rank = node.first_rank + uint32_t(begin);
        if (one_pixel) {
            draw_pixels(target, block, count, rank);
            continue;
        }
        if (style.fixed_px <= 0.0f) shape_block<perspective>(view, style, &points.shapes[begin], count, block);
        switch (style.shape) {
            case SplatShape::square: draw_splats<SplatShape::square, perspective>(target, view, block, count, rank); break;
            case SplatShape::disc: draw_splats<SplatShape::disc, perspective>(target, view, block, count, rank); break;
            case SplatShape::paraboloid: draw_splats<SplatShape::paraboloid, perspective>(target, view, block, count, rank); break;
        }
    }
}

inline void draw_any(const WordRows& target, const PointNode& node, size_t begin, size_t end, const PointProjection& view,
                     const SplatStyle& style) {
    const bool near = is_near(*node.points, view);
    if (view.perspective) {
        if (near)
            draw_run<true, true>(target, node, begin, end, view, style);
        else
            draw_run<true, false>(target, node, begin, end, view, style);
    } else {
        if (near)
            draw_run<false, true>(target, node, begin, end, view, style);
        else
            draw_run<false, false>(target, node, begin, end, view, style);
    }
}

STRATA_KERNEL_BASELINE void draw_baseline(const WordRows& target, const PointNode& node, size_t begin, size_t end,
                                          const PointProjection& view, const SplatStyle& style) {
    draw_any(target, node, begin, end, view, style);
}
STRATA_KERNEL_AVX2 void draw_avx2(const WordRows& target, const PointNode& node, size_t begin, size_t end,
                                  const PointProjection& view, const SplatStyle& style) {
    draw_any(target, node, begin, end, view, style);
}
STRATA_KERNEL_AVX512 void draw_avx512(const WordRows& target, const PointNode& node, size_t begin, size_t end,
                                      const PointProjection& view, const SplatStyle& style) {
    draw_any(target, node, begin, end, view, style);
}

}  // namespace

DrawPoints points_kernel(SimdLevel level) {
    switch (level) {
        case SimdLevel::baseline: return draw_baseline;
        case SimdLevel::avx2: return draw_avx2;
        case SimdLevel::avx512: return draw_avx512;
    }
    return draw_baseline;
}

}  // namespace strata
