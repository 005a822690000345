#include "render/pass/points_kernel.h"

#include <algorithm>

#include "core/simd_target.h"
#include "render/pass/point_block.h"
#include "render/pass/splat_cover.h"

namespace strata {
namespace {

inline void raise(uint64_t& word, uint64_t value) { word = value > word ? value : word; }

inline void draw_pixels(const WordRows& target, const PointBlock& block, size_t count, uint32_t rank) {
    alignas(64) uint64_t words[kPointBlock];
    alignas(64) int32_t rows[kPointBlock], columns[kPointBlock];
    const PixelRows& at = target.rows;
    const float width = float(at.width), top = float(at.first_row), bottom = float(at.first_row + at.rows);
    const int32_t first_row = int32_t(at.first_row);
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
        pixels[i] = uint32_t(std::max(rows[i], range.first)) * at.stride + uint32_t(columns[i]);
    }
    const BandLocks::Hold hold(at.locks, uint32_t(range.first), uint32_t(range.last));
    for (size_t i = 0; i < count; ++i) raise(target.words[pixels[i]], words[i]);
}

// The pixels of a block take the word of each splat.
template <SplatShape shape, bool perspective>
struct SplatWords {
    static constexpr bool kValuesFirst = false;

    const PixelRows& rows;
    uint64_t* words;
    const PointProjection& view;
    uint32_t rank;  // of the block's first point
    float inverse_unit = 1.0f / view.pixels_per_unit;

    uint64_t value_at(const PointBlock& block, size_t i, float x, float y) const {
        const SplatHit hit = splat_at<shape, perspective>(view, block, i, x, y, inverse_unit);
        const uint64_t word = make_word(hit.key, rank + uint32_t(i));
        return hit.covered != 0 ? word : 0;
    }
    void put(size_t pixel, uint64_t word, size_t) { raise(words[pixel], word); }
};

inline void draw_any(const WordRows& target, const PointNode& node, size_t begin, size_t end, const PointProjection& view,
                     const SplatStyle& style) {
    const bool one_pixel = style.fixed_px > 0.0f && style.fixed_px <= 1.0f;
    visit_blocks(node, begin, end, view, style, [&](auto perspective, const PointBlock& block, size_t first, size_t count) {
        const uint32_t rank = node.first_rank + uint32_t(first);
        if (one_pixel) {
            draw_pixels(target, block, count, rank);
            return;
        }
        const auto draw = [&]<SplatShape shape>() {
            SplatWords<shape, perspective()> words = {target.rows, target.words, view, rank};
            visit_splats<shape>(words, block, count);
        };
        switch (style.shape) {
            case SplatShape::square: draw.template operator()<SplatShape::square>(); break;
            case SplatShape::disc: draw.template operator()<SplatShape::disc>(); break;
            case SplatShape::paraboloid:
            case SplatShape::gaussian: draw.template operator()<SplatShape::paraboloid>(); break;
            case SplatShape::surfel: draw.template operator()<SplatShape::surfel>(); break;
        }
    });
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
