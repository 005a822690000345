#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <type_traits>

#include "render/pass/band_locks.h"
#include "render/pass/point_block.h"
#include "render/pass/points_pass.h"

namespace strata {

// Which pixels the splats of a block cover, and their visit. Inline: kernels compile it for each instruction set.

/// Rows of pixels that points are drawn into.
struct PixelRows {
    /// Pixels behind each row that kernels may read and write back.
    static constexpr uint32_t kPadding = 4;

    uint32_t stride;  // pixels from row to row: width + kPadding
    uint32_t width, first_row, rows;
    const BandLocks& locks;  // of rows counted from first_row
};

/// Rows of a block's points, from the first row of the target; none: last is kNoRow.
struct RowRange {
    int32_t first, last;
};

inline constexpr int32_t kNoRow = -1;

/// From the first and last row of each point, both kNoRow for those that are not seen.
inline RowRange row_range(const int32_t* first, const int32_t* last, size_t count) {
    uint32_t least = UINT32_MAX;  // as unsigned, kNoRow is above all rows
    int32_t most = kNoRow;
    for (size_t i = 0; i < count; ++i) {
        least = std::min(least, uint32_t(first[i]));
        most = std::max(most, last[i]);
    }
    return {int32_t(least), most};
}

/// What each splat of a block covers: columns [left, right) and rows above to last, counted from the target's first row. Those
/// that cover nothing have no columns and the row `above` of one that does.
struct Covered {
    alignas(64) int32_t left[kPointBlock];
    alignas(64) int32_t right[kPointBlock];
    alignas(64) int32_t above[kPointBlock];
    alignas(64) int32_t last[kPointBlock];
};

template <SplatShape shape>
inline RowRange cover_block(const PixelRows& target, const PointBlock& block, size_t count, Covered& out) {
    constexpr bool boxed = shape == SplatShape::surfel;
    const float width = float(target.width), top = float(target.first_row), bottom = float(target.first_row + target.rows);
    const int32_t first_row = int32_t(target.first_row);
    for (size_t i = 0; i < count; ++i) {
        const float x = block.x_px[i], y = block.y_px[i], radius = 0.5f * block.size_px[i];
        // Centers c + 0.5 in (x - radius, x + radius]; at one pixel that is the pixel of the point.
        const float reach_left = boxed ? block.reach_left[i] : radius, reach_right = boxed ? block.reach_right[i] : radius;
        const float reach_up = boxed ? block.reach_up[i] : radius, reach_down = boxed ? block.reach_down[i] : radius;
        const float left = std::max(x + (0.5f - reach_left), 0.0f), right = std::min(x + (0.5f + reach_right), width);
        const float above = std::max(y + (0.5f - reach_up), top), below = std::min(y + (0.5f + reach_down), bottom);
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

/// How many pixels wide or high a splat is, whichever is more; 0: it covers nothing.
inline int32_t side_of(const Covered& covered, size_t i) {
    const int32_t columns = covered.right[i] - covered.left[i], rows = covered.last[i] - covered.above[i] + 1;
    return columns > 0 ? std::max(columns, rows) : 0;
}

// Splats of at most `side` pixels a side: the values of all are computed before any is put down.
template <int side, typename Target>
inline void visit_small_splats(Target& target, const PointBlock& block, const Covered& covered, size_t count) {
    alignas(64) uint64_t values[side * side][kPointBlock];
    alignas(64) uint32_t pixels[kPointBlock], step[kPointBlock];
    const float first_row = float(target.rows.first_row);
    for (size_t i = 0; i < count; ++i) {
        pixels[i] = uint32_t(covered.above[i]) * target.rows.stride + uint32_t(covered.left[i]);
        step[i] = side_of(covered, i) <= side ? target.rows.stride : 0;  // else its rows may not be there
    }
    for (int row = 0; row < side; ++row)
        for (int column = 0; column < side; ++column)
            for (size_t i = 0; i < count; ++i) {
                const int32_t columns = covered.right[i] - covered.left[i], rows = covered.last[i] - covered.above[i] + 1;
                const float x = float(covered.left[i] + column) + 0.5f - block.x_px[i];
                const float y = float(covered.above[i] + row) + first_row + 0.5f - block.y_px[i];
                const uint64_t value = target.value_at(block, i, x, y);
                values[row * side + column][i] = (columns <= side) & (rows <= side) & (column < columns) & (row < rows) ? value : 0;
            }
    for (size_t i = 0; i < count; ++i) {
        size_t pixel = pixels[i];
        for (int row = 0; row < side; ++row) {
            for (int column = 0; column < side; ++column) target.put(pixel + size_t(column), values[row * side + column][i], i);
            // Rows below the splat may be others' to draw: nothing is put once more on its last row instead.
            pixel += row < covered.last[i] - covered.above[i] ? step[i] : 0;
        }
    }
}

template <typename Target>
inline void visit_large_splat(Target& target, const PointBlock& block, const Covered& covered, size_t i) {
    for (int32_t row = covered.above[i]; row <= covered.last[i]; ++row) {
        const size_t line = size_t(row) * target.rows.stride;
        const float y = float(row + int32_t(target.rows.first_row)) + 0.5f - block.y_px[i];
        if constexpr (Target::kValuesFirst) {
            alignas(64) uint64_t values[kPointBlock];
            for (int32_t begin = covered.left[i]; begin < covered.right[i]; begin += int32_t(kPointBlock)) {
                const int32_t count = std::min(covered.right[i] - begin, int32_t(kPointBlock));
                for (int32_t k = 0; k < count; ++k) values[k] = target.value_at(block, i, float(begin + k) + 0.5f - block.x_px[i], y);
                for (int32_t k = 0; k < count; ++k) target.put(line + size_t(begin + k), values[k], i);
            }
        } else {
            for (int32_t column = covered.left[i]; column < covered.right[i]; ++column)
                target.put(line + size_t(column), target.value_at(block, i, float(column) + 0.5f - block.x_px[i], y), i);
        }
    }
}

/// Puts down a value for every pixel that a splat of the block covers, while the rows are held.
/// target  has the PixelRows `rows`; `value_at(block, i, x, y)`, what splat i leaves at the pixel whose center lies (x, y) from its own,
///         0 for nothing; and `put(pixel, value, i)`, which may be asked to put down 0 on any pixel of the splat's rows. Where `put` is no
///         vector code, `kValuesFirst` keeps it apart from what is
template <SplatShape shape, typename Target>
inline void visit_splats(Target& target, const PointBlock& block, size_t count) {
    Covered covered;
    const RowRange range = cover_block<shape>(target.rows, block, count, covered);
    if (range.last < 0) return;
    const BandLocks::Hold hold(target.rows.locks, uint32_t(range.first), uint32_t(range.last));
    uint32_t threes = 0, large = 0;
    for (size_t i = 0; i < count; ++i) {
        threes += side_of(covered, i) == 3;
        large += side_of(covered, i) > 3;
    }
    const bool three = threes > count / 16;  // of fewer it is less work to draw each alone
    if (three)
        visit_small_splats<3>(target, block, covered, count);
    else
        visit_small_splats<2>(target, block, covered, count);
    if (large + (three ? 0 : threes) == 0) return;
    for (size_t i = 0; i < count; ++i)
        if (side_of(covered, i) > (three ? 3 : 2)) visit_large_splat(target, block, covered, i);
}

template <bool perspective, typename Visit>
inline void visit_run(const PointNode& node, size_t begin, size_t end, const PointProjection& view, const SplatStyle& style, const Visit& visit) {
    PointBlock block;
    if (style.fixed_px > 0.0f) {
        std::fill(std::begin(block.size_px), std::end(block.size_px), style.fixed_px);
        std::fill(std::begin(block.slope_x), std::end(block.slope_x), 0.0f);
        std::fill(std::begin(block.slope_y), std::end(block.slope_y), 0.0f);
    }
    const ResidentNode& points = *node.points;
    const bool near = is_near(points, view);
    for (; begin < end; begin += kPointBlock) {
        const size_t count = std::min(kPointBlock, end - begin);
        const int32_t *const x = &points.x[begin], *const y = &points.y[begin], *const z = &points.z[begin];
        if (near)
            project_block<perspective, true>(view, x, y, z, count, block);
        else
            project_block<perspective, false>(view, x, y, z, count, block);
        if (style.fixed_px <= 0.0f) shape_block<perspective>(view, style, &points.shapes[begin], count, block);
        if (style.shape == SplatShape::surfel) surfel_block<perspective>(view, &points.normals[begin], count, block);
        visit(std::bool_constant<perspective>(), block, begin, count);
    }
}

/// Calls visit(perspective as std::bool_constant, block, its first point, count) for each block of points [begin, end) of a node,
/// projected and shaped.
template <typename Visit>
inline void visit_blocks(const PointNode& node, size_t begin, size_t end, const PointProjection& view, const SplatStyle& style,
                         const Visit& visit) {
    if (view.perspective)
        visit_run<true>(node, begin, end, view, style, visit);
    else
        visit_run<false>(node, begin, end, view, style, visit);
}

}  // namespace strata
