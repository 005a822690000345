#include "render/pass/resolve_kernel.h"

#include <algorithm>
#include <bit>

#include "core/simd_target.h"
#include "render/pass/point_block.h"

namespace strata {
namespace {

// The points that a block of pixels shows, gathered from their nodes.
struct Shown {
    alignas(64) int32_t x[kPointBlock], y[kPointBlock], z[kPointBlock];
    alignas(64) float column[kPointBlock];
    alignas(64) float key[kPointBlock];
    PointShape shapes[kPointBlock];
    uint32_t pixel[kPointBlock];  // in the block
    size_t count;
};

// Slot of the node that a rank belongs to. slot: a guess, since neighbors mostly show the same node
inline size_t slot_of(std::span<const PointNode> nodes, uint32_t rank, size_t slot) {
    if (rank >= nodes[slot].first_rank && rank - nodes[slot].first_rank < nodes[slot].points->size()) return slot;
    const auto after = std::upper_bound(nodes.begin(), nodes.end(), rank, [](uint32_t r, const PointNode& node) { return r < node.first_rank; });
    // Of slots with the same first rank all but the last are empty, and upper_bound is behind the last.
    return size_t(after - nodes.begin()) - 1;
}

// Colors and ids; what sizes and planes are computed from goes to `shown`.
inline void gather(const ResolveInput& in, const uint64_t* words, size_t count, GBuffer& out, size_t pixel, bool shapes, size_t& slot,
                   Shown& shown) {
    shown.count = 0;
    for (size_t i = 0; i < count; ++i) {
        if (words[i] == 0) {
            out.colors[pixel + i] = 0;
            if (in.options.ids) out.ids[pixel + i] = kNoPixelId;
            continue;
        }
        const uint32_t rank = ~uint32_t(words[i]);
        slot = slot_of(in.nodes, rank, slot);
        const ResidentNode& points = *in.nodes[slot].points;
        const uint32_t index = rank - in.nodes[slot].first_rank;
        out.colors[pixel + i] = points.colors[index];
        if (in.options.ids) out.ids[pixel + i] = make_pixel_id(uint32_t(slot), index);
        if (!shapes) continue;
        shown.x[shown.count] = points.x[index];
        shown.y[shown.count] = points.y[index];
        shown.z[shown.count] = points.z[index];
        shown.shapes[shown.count] = points.shapes[index];
        shown.key[shown.count] = std::bit_cast<float>(uint32_t(words[i] >> 32));
        shown.pixel[shown.count++] = uint32_t(i);
    }
}

template <bool perspective, bool near>
inline void resolve_row(const ResolveInput& in, const uint64_t* words, uint32_t row, GBuffer& out, size_t pixel) {
    const PointProjection& view = in.projection;
    const float inverse_unit = 1.0f / view.pixels_per_unit, y = float(row) + 0.5f;
    const bool adaptive = in.style.fixed_px <= 0.0f;
    const bool planes = adaptive && in.style.shape == SplatShape::paraboloid;
    const uint8_t fixed_size = uint8_t(std::min(in.style.fixed_px + 0.5f, 255.0f));
    PointBlock block;
    Shown shown;
    size_t slot = 0;
    for (size_t begin = 0; begin < out.width; begin += kPointBlock, pixel += kPointBlock) {
        const size_t count = std::min<size_t>(kPointBlock, out.width - begin);
        gather(in, words + begin, count, out, pixel, adaptive && (planes || in.options.splat_px), slot, shown);
        float* const depths = out.depths.data() + pixel;
        uint8_t* const sizes = in.options.splat_px ? out.splat_px.data() + pixel : nullptr;
        for (size_t i = 0; i < count; ++i) {
            const float depth = view.linear_depth(std::bit_cast<float>(uint32_t(words[begin + i] >> 32)));
            depths[i] = words[begin + i] == 0 ? kNoDepth : depth;
        }
        if (sizes)
            for (size_t i = 0; i < count; ++i) sizes[i] = words[begin + i] == 0 ? 0 : fixed_size;
        if (shown.count == 0) continue;

        project_block<perspective, near>(view, shown.x, shown.y, shown.z, shown.count, block);
        shape_block<perspective>(view, in.style, shown.shapes, shown.count, block);
        if (planes) {
            // Depth of the plane that the point stands for. A paraboloid's fall behind it decides what is seen, but is no relief.
            for (size_t i = 0; i < shown.count; ++i) shown.column[i] = float(begin + shown.pixel[i]) + 0.5f;
            for (size_t i = 0; i < shown.count; ++i) {
                const float rise = block.slope_x[i] * (shown.column[i] - block.x_px[i]) + block.slope_y[i] * (y - block.y_px[i]);
                const float key = std::max(key_on_plane<perspective>(view, block.key[i], rise, inverse_unit), kLeastKey);
                const bool flat = shown.shapes[i].flat();
                shown.key[i] = view.linear_depth(flat ? key : shown.key[i]);
            }
            for (size_t i = 0; i < shown.count; ++i) depths[shown.pixel[i]] = shown.key[i];
        }
        if (sizes)
            for (size_t i = 0; i < shown.count; ++i) {
                // Flat ones have no rims; steps between them are noise, which half their size evens out.
                const float size = (shown.shapes[i].flat() ? 0.5f : 1.0f) * block.size_px[i];
                sizes[shown.pixel[i]] = uint8_t(std::min(size + 0.5f, 255.0f));
            }
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
