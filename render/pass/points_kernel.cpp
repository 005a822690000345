#include "render/pass/points_kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/simd_target.h"
#include "render/pass/point_block.h"

namespace strata {
namespace {

// Rows of a block's points, from the first row of the target; none: last is kNoRow.
struct RowRange {
    int32_t first, last;
};

constexpr int32_t kNoRow = -1;

// From the first and last row of each point, both kNoRow for those that are not seen.
inline RowRange row_range(const int32_t* first, const int32_t* last, size_t count) {
    uint32_t least = UINT32_MAX;  // as unsigned, kNoRow is above all rows
    int32_t most = kNoRow;
    for (size_t i = 0; i < count; ++i) {
        least = std::min(least, uint32_t(first[i]));
        most = std::max(most, last[i]);
    }
    return {int32_t(least), most};
}

inline void raise(uint64_t& word, uint64_t value) { word = value > word ? value : word; }

inline uint64_t make_word(float key, uint32_t rank) { return uint64_t{std::bit_cast<uint32_t>(key)} << 32 | uint32_t(~rank); }

inline void draw_pixels(const WordRows& target, const PointBlock& block, size_t count, uint32_t rank) {
    alignas(64) uint64_t words[kPointBlock];
    alignas(64) int32_t rows[kPointBlock], columns[kPointBlock];
    const float width = float(target.width), top = float(target.first_row), bottom = float(target.first_row + target.rows);
    const int32_t first_row = int32_t(target.first_row);
    for (size_t i = 0; i < count; ++i) {
        const float x = block.x_px[i], y = block.y_px[i];
        const bool seen = (block.key[i] > 0.0f) & (x >= 0.0f) & (x < width) & (y >= top) & (y < bottom);
        const int32_t row = int32_t(seen ? y : 0.0f) - first_row;
        rows[i] = seen ? row : kNoRow;
        columns[i] = int32_t(seen ? x : 0.0f);
    }
    const RowRange range = row_range(rows, rows, count);
    if (range.last < 0) return;
    // Points that are not seen raise a pixel of the rows that are held by nothing.
    alignas(64) uint32_t pixels[kPointBlock];
    for (size_t i = 0; i < count; ++i) {
        const uint64_t word = make_word(block.key[i], rank + uint32_t(i));
        words[i] = rows[i] >= 0 ? word : 0;
        pixels[i] = uint32_t(std::max(rows[i], range.first)) * target.stride + uint32_t(columns[i]);
    }
    const BandLocks::Hold hold(target.locks, uint32_t(range.first), uint32_t(range.last));
    for (size_t i = 0; i < count; ++i) raise(target.words[pixels[i]], words[i]);
}

// What each splat of a block covers: columns [left, right) and rows above to last, counted from the target's first row. Those
// that cover nothing have no columns and the row `above` of one that does.
struct Covered {
    alignas(64) int32_t left[kPointBlock];
    alignas(64) int32_t right[kPointBlock];
    alignas(64) int32_t above[kPointBlock];
    alignas(64) int32_t last[kPointBlock];
};

inline RowRange cover_block(const WordRows& target, const PointBlock& block, size_t count, Covered& out) {
    const float width = float(target.width), top = float(target.first_row), bottom = float(target.first_row + target.rows);
    const int32_t first_row = int32_t(target.first_row);
    for (size_t i = 0; i < count; ++i) {
        const float x = block.x_px[i], y = block.y_px[i], radius = 0.5f * block.size_px[i];
        // Centers c + 0.5 in (x - radius, x + radius]; at one pixel that is the pixel of the point.
        const float left = std::max(x + (0.5f - radius), 0.0f), right = std::min(x + (0.5f + radius), width);
        const float above = std::max(y + (0.5f - radius), top), below = std::min(y + (0.5f + radius), bottom);
        const bool some = (block.key[i] > 0.0f) & (left < right) & (above < below);
        const int32_t columns[2] = {int32_t(some ? left : 0.0f), int32_t(some ? right : 0.0f)};
        const int32_t rows[2] = {int32_t(some ? above : 0.0f), int32_t(some ? below : 0.0f)};
        const bool seen = (columns[0] < columns[1]) & (rows[0] < rows[1]);
        out.left[i] = seen ? columns[0] : 0;
        out.right[i] = seen ? columns[1] : 0;
        out.above[i] = seen ? rows[0] - first_row : kNoRow;
        out.last[i] = seen ? rows[1] - 1 - first_row : kNoRow;
    }
    const RowRange range = row_range(out.above, out.last, count);
    for (size_t i = 0; i < count; ++i) out.above[i] = std::max(out.above[i], range.first);
    return range;
}

// The word that a splat leaves at a pixel, 0 outside of it. All of this is plain arithmetic without a jump, so that loops
// around it become vector code.
template <SplatShape shape, bool perspective>
struct SplatWords {
    const PointProjection& view;
    float inverse_unit = 1.0f / view.pixels_per_unit;

    // x, y  from the splat's center to the pixel's
    uint64_t at(const PointBlock& block, size_t i, float x, float y, uint32_t rank) const {
        const float key = block.key[i];
        if constexpr (shape == SplatShape::square) return make_word(key, rank);
        const float radius = 0.5f * block.size_px[i];
        const float inverse_square = 1.0f / (radius * radius);
        // Below this diameter a disc may miss every center, and the square covers two by two at most.
        const bool round = radius > 0.75f;
        if constexpr (shape == SplatShape::disc) return (x * x + y * y) * inverse_square <= 1.0f || !round ? make_word(key, rank) : 0;
        const float rise = block.slope_x[i] * x + block.slope_y[i] * y;
        const float square = (x * x + y * y + rise * rise) * inverse_square;
        // Behind the plane the key falls with the square of the distance, by a depth of one radius at the rim, at most to half.
        const float fall = std::min(radius * inverse_unit, 0.5f) * square;
        const float on_plane = key_on_plane<perspective>(view, key, rise, inverse_unit);
        const float behind = perspective ? on_plane - on_plane * fall : on_plane + view.key_scale * fall;
        const uint64_t curved = make_word(std::max(behind, kLeastKey), rank);
        return !round ? make_word(key, rank) : square <= 1.0f ? curved : 0;
    }
};

// How many pixels wide or high a splat is, whichever is more; 0: it covers nothing.
inline int32_t side_of(const Covered& covered, size_t i) {
    const int32_t columns = covered.right[i] - covered.left[i], rows = covered.last[i] - covered.above[i] + 1;
    return columns > 0 ? std::max(columns, rows) : 0;
}

// Splats of at most `side` pixels a side: the words of all are computed before any is drawn.
template <int side, SplatShape shape, bool perspective>
inline void draw_small_splats(const WordRows& target, const SplatWords<shape, perspective>& splats, const PointBlock& block,
                              const Covered& covered, size_t count, uint32_t rank) {
    alignas(64) uint64_t words[side * side][kPointBlock];
    alignas(64) uint32_t pixels[kPointBlock], step[kPointBlock];
    const float first_row = float(target.first_row);
    for (size_t i = 0; i < count; ++i) {
        pixels[i] = uint32_t(covered.above[i]) * target.stride + uint32_t(covered.left[i]);
        step[i] = side_of(covered, i) <= side ? target.stride : 0;  // else its rows may not be there
    }
    for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; ++column)
            for (size_t i = 0; i < count; ++i) {
                const int32_t columns = covered.right[i] - covered.left[i], rows = covered.last[i] - covered.above[i] + 1;
                const float x = float(covered.left[i] + column) + 0.5f - block.x_px[i];
                const float y = float(covered.above[i] + row) + first_row + 0.5f - block.y_px[i];
                const uint64_t word = splats.at(block, i, x, y, rank + uint32_t(i));
                words[row * side + column][i] = (columns <= side) & (rows <= side) & (column < columns) & (row < rows) ? word : 0;
            }
    for (size_t i = 0; i < count; ++i) {
        uint64_t* line = target.words + pixels[i];
        for (int row = 0; row < side; ++row) {
            for (int column = 0; column < side; ++column) raise(line[column], words[row * side + column][i]);
            // Rows below the splat may be others' to draw: nothing raises its last row once more instead.
            line += row < covered.last[i] - covered.above[i] ? step[i] : 0;
        }
    }
}

template <SplatShape shape, bool perspective>
inline void draw_large_splat(const WordRows& target, const SplatWords<shape, perspective>& splats, const PointBlock& block,
                             const Covered& covered, size_t i, uint32_t rank) {
    for (int32_t row = covered.above[i]; row <= covered.last[i]; ++row) {
        uint64_t* const line = target.words + size_t(row) * target.stride;
        const float y = float(row + int32_t(target.first_row)) + 0.5f - block.y_px[i];
        for (int32_t column = covered.left[i]; column < covered.right[i]; ++column)
            raise(line[column], splats.at(block, i, float(column) + 0.5f - block.x_px[i], y, rank + uint32_t(i)));
    }
}

template <SplatShape shape, bool perspective>
inline void draw_splats(const WordRows& target, const PointProjection& view, const PointBlock& block, size_t count, uint32_t rank) {
    Covered covered;
    const RowRange range = cover_block(target, block, count, covered);
    if (range.last < 0) return;
    const SplatWords<shape, perspective> splats = {view};
    const BandLocks::Hold hold(target.locks, uint32_t(range.first), uint32_t(range.last));
    uint32_t threes = 0, large = 0;
    for (size_t i = 0; i < count; ++i) {
        threes += side_of(covered, i) == 3;
        large += side_of(covered, i) > 3;
    }
    const bool three = threes > count / 16;  // of fewer it is less work to draw each alone
    if (three)
        draw_small_splats<3>(target, splats, block, covered, count, rank);
    else
        draw_small_splats<2>(target, splats, block, covered, count, rank);
    if (large + (three ? 0 : threes) == 0) return;
    for (size_t i = 0; i < count; ++i)
        if (side_of(covered, i) > (three ? 3 : 2)) draw_large_splat(target, splats, block, covered, i, rank);
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
