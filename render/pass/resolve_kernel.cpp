#include "render/pass/resolve_kernel.h"

#include <algorithm>

#include "core/simd_target.h"
#include "render/pass/point_block.h"

namespace strata {
namespace {

// Of a block of pixels: the points they show, and of those that lie in a plane the positions, gathered.
struct Shown {
    alignas(64) uint32_t slot[kPointBlock], index[kPointBlock];
    alignas(64) float spacing[kPointBlock], share[kPointBlock];

    alignas(64) int32_t x[kPointBlock], y[kPointBlock], z[kPointBlock];
    alignas(64) float column[kPointBlock];
    PointShape shapes[kPointBlock];
    uint32_t pixel[kPointBlock];  // in the block
    size_t flat;                  // how many
};

// Nodes and points, from the ranks of the words. Neighbors often show different levels, so a guess would often be wrong.
inline void find_points(const ResolveInput& in, const uint64_t* words, size_t count, Shown& shown) {
    const uint32_t last = uint32_t(in.nodes.size()) - 1;
    for (size_t i = 0; i < count; ++i) {
        if (words[i] == 0) continue;
        const uint32_t rank = ~uint32_t(words[i]);
        uint32_t slot = in.slots[rank / ResolveInput::kSlotRanks];
        while (slot < last && rank >= in.nodes[slot + 1].first_rank) ++slot;
        shown.slot[i] = slot;
        shown.index[i] = rank - in.nodes[slot].first_rank;
        const ResidentNode& points = *in.nodes[slot].points;
        __builtin_prefetch(&points.colors[shown.index[i]]);
        if (in.style.fixed_px <= 0.0f) __builtin_prefetch(&points.shapes[shown.index[i]]);
    }
}

// Colors and ids; spacing where sizes are adaptive, and positions where planes are wanted.
inline void gather(const ResolveInput& in, const uint64_t* words, size_t count, GBuffer& out, size_t pixel, bool planes, Shown& shown) {
    shown.flat = 0;
    const bool adaptive = in.style.fixed_px <= 0.0f, surfels = in.style.shape == SplatShape::surfel;
    for (size_t i = 0; i < count; ++i) {
        if (words[i] == 0) {
            out.colors[pixel + i] = 0;
            if (in.options.ids) out.ids[pixel + i] = kNoPixelId;
            shown.spacing[i] = shown.share[i] = 0.0f;
            continue;
        }
        const uint32_t index = shown.index[i];
        const ResidentNode& points = *in.nodes[shown.slot[i]].points;
        out.colors[pixel + i] = points.colors[index];
        if (in.options.ids) out.ids[pixel + i] = make_pixel_id(shown.slot[i], index);
        if (!adaptive) continue;
        const PointShape& shape = points.shapes[index];
        const PackedNormal& normal = surfels ? points.normals[index] : shape.normal;
        const bool flat = (normal[0] | normal[1] | normal[2]) != 0;
        shown.spacing[i] = shape.spacing;
        shown.share[i] = flat ? 0.5f : 1.0f;
        if (!flat || !planes) continue;
        shown.x[shown.flat] = points.x[index];
        shown.y[shown.flat] = points.y[index];
        shown.z[shown.flat] = points.z[index];
        shown.shapes[shown.flat] = shape;
        shown.pixel[shown.flat++] = uint32_t(i);
    }
}

template <bool perspective, bool near>
inline void resolve_row(const ResolveInput& in, const uint64_t* words, uint32_t row, GBuffer& out, size_t pixel) {
    const PointProjection& view = in.projection;
    const SplatStyle& style = in.style;
    const float inverse_unit = 1.0f / view.pixels_per_unit, y = float(row) + 0.5f;
    const bool adaptive = style.fixed_px <= 0.0f;
    const bool planes = adaptive && (style.shape == SplatShape::paraboloid || style.shape == SplatShape::gaussian);
    const uint8_t fixed_size = uint8_t(std::min(style.fixed_px + 0.5f, 255.0f));
    PointBlock block;
    Shown shown;
    for (size_t begin = 0; begin < out.width; begin += kPointBlock, pixel += kPointBlock, words += kPointBlock) {
        const size_t count = std::min<size_t>(kPointBlock, out.width - begin);
        find_points(in, words, count, shown);
        gather(in, words, count, out, pixel, planes, shown);
        float* const depths = out.depths.data() + pixel;
        for (size_t i = 0; i < count; ++i) {
            const float depth = view.linear_depth(key_of_word(words[i]));
            depths[i] = words[i] == 0 ? kNoDepth : depth;
        }
        if (in.options.splat_px) {
            uint8_t* const sizes = out.splat_px.data() + pixel;
            for (size_t i = 0; i < count; ++i) {
                const float key = key_of_word(words[i]);
                // Flat ones have no rims; steps between them are noise, which half their size evens out.
                const float size = shown.share[i] * splat_size_px<perspective>(view, style, shown.spacing[i], key) + 0.5f;
                const uint8_t rounded = adaptive ? uint8_t(std::min(size, 255.0f)) : fixed_size;
                sizes[i] = words[i] == 0 ? 0 : rounded;
            }
        }
        if (shown.flat == 0) continue;

        // Depth of the plane that the point stands for. A paraboloid's fall behind it decides what is seen, but is no relief.
        project_block<perspective, near>(view, shown.x, shown.y, shown.z, shown.flat, block);
        shape_block<perspective>(view, style, shown.shapes, shown.flat, block);
        for (size_t i = 0; i < shown.flat; ++i) shown.column[i] = float(begin + shown.pixel[i]) + 0.5f;
        for (size_t i = 0; i < shown.flat; ++i) {
            const float rise = block.slope_x[i] * (shown.column[i] - block.x_px[i]) + block.slope_y[i] * (y - block.y_px[i]);
            block.key[i] = view.linear_depth(std::max(key_on_plane<perspective>(view, block.key[i], rise, inverse_unit), kLeastKey));
        }
        for (size_t i = 0; i < shown.flat; ++i) depths[shown.pixel[i]] = block.key[i];
    }
}

inline void resolve_any(const ResolveInput& in, const uint64_t* words, uint32_t row, GBuffer& out, size_t pixel) {
    if (in.projection.perspective) {
        if (in.near)
            resolve_row<true, true>(in, words, row, out, pixel);
        else
            resolve_row<true, false>(in, words, row, out, pixel);
    } else {
        if (in.near)
            resolve_row<false, true>(in, words, row, out, pixel);
        else
            resolve_row<false, false>(in, words, row, out, pixel);
    }
}

STRATA_KERNEL_BASELINE void resolve_baseline(const ResolveInput& in, const uint64_t* words, uint32_t row, GBuffer& out, size_t pixel) {
    resolve_any(in, words, row, out, pixel);
}
STRATA_KERNEL_AVX2 void resolve_avx2(const ResolveInput& in, const uint64_t* words, uint32_t row, GBuffer& out, size_t pixel) {
    resolve_any(in, words, row, out, pixel);
}
STRATA_KERNEL_AVX512 void resolve_avx512(const ResolveInput& in, const uint64_t* words, uint32_t row, GBuffer& out, size_t pixel) {
    resolve_any(in, words, row, out, pixel);
}

}  // namespace

ResolveRow resolve_kernel(SimdLevel level) {
    switch (level) {
        case SimdLevel::baseline: return resolve_baseline;
        case SimdLevel::avx2: return resolve_avx2;
        case SimdLevel::avx512: return resolve_avx512;
    }
    return resolve_baseline;
}

}  // namespace strata
