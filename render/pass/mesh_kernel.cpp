#include "render/pass/mesh_kernel.h"

#include <algorithm>
#include <atomic>

#include "core/simd_target.h"

namespace strata {
namespace {

inline void project(const MeshProjection& view, const Vec3d* positions, size_t count, ProjectedVertex* out) {
    constexpr size_t kBlock = 64;  // one coordinate after the other, so that the arithmetic is vector code
    alignas(64) double x[kBlock], y[kBlock], z[kBlock];
    alignas(64) int32_t x_px[kBlock], y_px[kBlock];
    alignas(64) float key[kBlock];
    for (size_t begin = 0; begin < count; begin += kBlock) {
        const size_t size = std::min(kBlock, count - begin);
        for (size_t i = 0; i < size; ++i) {
            const double* const p = positions[begin + i].data();
            x[i] = p[0], y[i] = p[1], z[i] = p[2];
        }
        for (size_t i = 0; i < size; ++i) {
            const ProjectedVertex vertex = project_vertex(view, x[i], y[i], z[i]);
            x_px[i] = vertex.x, y_px[i] = vertex.y, key[i] = vertex.key;
        }
        for (size_t i = 0; i < size; ++i) out[begin + i] = {x_px[i], y_px[i], key[i]};
    }
}

inline int32_t least(int32_t a, int32_t b) { return a < b ? a : b; }
inline int32_t most(int32_t a, int32_t b) { return a > b ? a : b; }

constexpr int32_t kFar = 1 << 30;  // beside any picture

inline void sort(const MeshGeometry& geometry, const MeshTarget& target, TriangleBlock& block) {
    const int32_t width = int32_t(target.width), first_row = int32_t(target.first_row), end_row = first_row + int32_t(target.rows);
    const std::array<uint32_t, 3>* const triangles = geometry.triangles + block.first;
    for (size_t i = 0; i < block.count; ++i)
        for (size_t corner = 0; corner < 3; ++corner) {
            const ProjectedVertex& vertex = geometry.vertices[triangles[i][corner]];
            block.x[corner][i] = vertex.x;
            block.y[corner][i] = vertex.y;
            block.key[corner][i] = vertex.key;
        }
    for (size_t i = 0; i < block.count; ++i) {
        const int32_t ax = block.x[0][i], bx = block.x[1][i], cx = block.x[2][i], ay = block.y[0][i], by = block.y[1][i], cy = block.y[2][i];
        const int32_t least_x = least(least(ax, bx), cx), most_x = most(most(most(ax, bx), cx), -kFar);
        const int32_t least_y = least(least(ay, by), cy), most_y = most(most(ay, by), cy);
        const bool unsnapped = least_x == kUnsnapped, behind = (block.key[0][i] == 0.0f) & (block.key[1][i] == 0.0f) & (block.key[2][i] == 0.0f);
        const int32_t left = (least_x + kSubpixels / 2 - 1) >> kSubpixelBits, right = (most_x - kSubpixels / 2) >> kSubpixelBits;
        const int32_t top = (least_y + kSubpixels / 2 - 1) >> kSubpixelBits, bottom = (most_y - kSubpixels / 2) >> kSubpixelBits;
        // By the whole triangle: its kind decides how its keys are rounded.
        const int32_t columns = least(right - left + 1, kSmallSide + 1), rows = least(bottom - top + 1, kSmallSide + 1);
        block.left[i] = most(left, 0);
        block.right[i] = least(right, width - 1);
        block.top[i] = most(top, first_row);
        block.bottom[i] = least(bottom, end_row - 1);
        const bool seen = (most(left, 0) <= least(right, width - 1)) & (most(top, first_row) <= least(bottom, end_row - 1));
        const bool is_small = (columns <= kSmallSide) & (rows <= kSmallSide) & (columns * rows <= kSmallPx);
        const TriangleKind kind = is_small ? TriangleKind::small : TriangleKind::large;
        const TriangleKind snapped = seen ? kind : TriangleKind::nothing, any = unsnapped ? TriangleKind::unsnapped : snapped;
        block.kinds[i] = behind ? TriangleKind::nothing : any;
    }
}

template <Sharing sharing>
inline void raise(uint64_t& word, uint64_t value) {
    if constexpr (sharing == Sharing::alone) {
        word = value > word ? value : word;
    } else {
        const std::atomic_ref<uint64_t> shared(word);
        uint64_t old = shared.load(std::memory_order_relaxed);
        while (value > old && !shared.compare_exchange_weak(old, value, std::memory_order_relaxed)) {
        }
    }
}

// What the edges of a small triangle say at a pixel's center. Corners lie within kSmallSide + 1 pixels of each other, so 32 bits hold all products;
// those of triangles that are not small wrap around, and nobody looks at them.
struct SmallTriangle {
    struct Edge {
        int32_t value, per_column, per_row, owned;  // the weight of the corner across, at the first pixel; what is added where the edge is another triangle's
    };
    Edge edges[3];
    double key[3];  // of the corner across
    int32_t area;
};

inline SmallTriangle::Edge edge_of(int32_t from_x, int32_t from_y, int32_t to_x, int32_t to_y, int32_t x, int32_t y) {
    const uint32_t dx = uint32_t(to_x) - uint32_t(from_x), dy = uint32_t(to_y) - uint32_t(from_y);
    const uint32_t value = dx * (uint32_t(y) - uint32_t(from_y)) - dy * (uint32_t(x) - uint32_t(from_x));
    return {int32_t(value), -int32_t(dy * uint32_t{kSubpixels}), int32_t(dx * uint32_t{kSubpixels}), (int32_t(dy) < 0) | ((dy == 0) & (int32_t(dx) > 0)) ? 0 : -1};
}

inline SmallTriangle small_triangle(const TriangleBlock& block, size_t i) {
    const int32_t ax = block.x[0][i], ay = block.y[0][i];
    const int32_t x1 = block.x[1][i], y1 = block.y[1][i], x2 = block.x[2][i], y2 = block.y[2][i];
    const float key1 = block.key[1][i], key2 = block.key[2][i];
    const int32_t turn = int32_t((uint32_t(x1) - uint32_t(ax)) * (uint32_t(y2) - uint32_t(ay)) - (uint32_t(y1) - uint32_t(ay)) * (uint32_t(x2) - uint32_t(ax)));
    const bool turned = turn < 0;
    const int32_t bx = turned ? x2 : x1, by = turned ? y2 : y1, cx = turned ? x1 : x2, cy = turned ? y1 : y2;
    const float key_b = turned ? key2 : key1, key_c = turned ? key1 : key2;
    const int32_t x = int32_t(uint32_t(block.left[i]) * uint32_t{kSubpixels}) + kSubpixels / 2, y = int32_t(uint32_t(block.top[i]) * uint32_t{kSubpixels}) + kSubpixels / 2;
    return {{edge_of(bx, by, cx, cy, x, y), edge_of(cx, cy, ax, ay, x, y), edge_of(ax, ay, bx, by, x, y)},
            {double(block.key[0][i]), double(key_b), double(key_c)},
            turned ? int32_t(0u - uint32_t(turn)) : turn};
}

inline float key_of(const SmallTriangle& t, int32_t a, int32_t b, int32_t c, double inverse_area) {
    return float((double(a) * t.key[0] + double(b) * t.key[1] + double(c) * t.key[2]) * inverse_area);
}

// The four pixels from the first one on.
struct FirstPixels {
    alignas(64) int32_t covered[4][kTriangleBlock];
    alignas(64) float keys[4][kTriangleBlock];
};

inline void find_first_pixels(const TriangleBlock& block, FirstPixels& out) {
    for (size_t i = 0; i < block.count; ++i) {
        const SmallTriangle t = small_triangle(block, i);
        const double inverse = 1.0 / double(t.area);
        for (int pixel = 0; pixel < 4; ++pixel) {
            const uint32_t right = uint32_t(pixel) & 1, down = uint32_t(pixel) >> 1;
            const auto value = [&](const SmallTriangle::Edge& edge) { return int32_t(uint32_t(edge.value) + right * uint32_t(edge.per_column) + down * uint32_t(edge.per_row)); };
            const int32_t a = value(t.edges[0]), b = value(t.edges[1]), c = value(t.edges[2]);
            const bool inside = (int32_t(uint32_t(a) + uint32_t(t.edges[0].owned)) | int32_t(uint32_t(b) + uint32_t(t.edges[1].owned)) | int32_t(uint32_t(c) + uint32_t(t.edges[2].owned))) >= 0;
            const bool in_box = (block.left[i] + int32_t(right) <= block.right[i]) & (block.top[i] + int32_t(down) <= block.bottom[i]);
            out.covered[pixel][i] = inside & in_box & (t.area != 0) ? 1 : 0;
            out.keys[pixel][i] = key_of(t, a, b, c, inverse);
        }
    }
}

template <Sharing sharing>
inline void draw_all_pixels(const MeshTarget& target, const TriangleBlock& block, size_t i) {
    SmallTriangle t = small_triangle(block, i);
    if (t.area == 0) return;
    const double inverse = 1.0 / double(t.area);
    uint64_t* words = target.words + size_t(block.top[i] - int32_t(target.first_row)) * target.width;
    for (int32_t row = block.top[i]; row <= block.bottom[i]; ++row, words += target.width) {
        int32_t a = t.edges[0].value, b = t.edges[1].value, c = t.edges[2].value;
        for (int32_t column = block.left[i]; column <= block.right[i]; ++column) {
            if (((a + t.edges[0].owned) | (b + t.edges[1].owned) | (c + t.edges[2].owned)) >= 0)
                raise<sharing>(words[column], make_word(key_of(t, a, b, c, inverse), block.first + uint32_t(i)));
            a += t.edges[0].per_column;
            b += t.edges[1].per_column;
            c += t.edges[2].per_column;
        }
        for (SmallTriangle::Edge& edge : t.edges) edge.value += edge.per_row;
    }
}

template <Sharing sharing>
inline void draw_small_as(const MeshTarget& target, const TriangleBlock& block) {
    const auto first_word = [&](size_t i) { return target.words + size_t(block.top[i] - int32_t(target.first_row)) * target.width + block.left[i]; };
    for (size_t i = 0; i < block.count; ++i) {
        if (block.kinds[i] != TriangleKind::small) continue;
        __builtin_prefetch(first_word(i), 1);
        if (block.bottom[i] > block.top[i]) __builtin_prefetch(first_word(i) + target.width, 1);
    }
    FirstPixels pixels;
    find_first_pixels(block, pixels);
    for (size_t i = 0; i < block.count; ++i) {
        if (block.kinds[i] != TriangleKind::small) continue;
        if (block.right[i] - block.left[i] > 1 || block.bottom[i] - block.top[i] > 1) {
            draw_all_pixels<sharing>(target, block, i);
            continue;
        }
        uint64_t* const words = first_word(i);
        const uint32_t number = block.first + uint32_t(i);
        if (pixels.covered[0][i] != 0) raise<sharing>(words[0], make_word(pixels.keys[0][i], number));
        if (pixels.covered[1][i] != 0) raise<sharing>(words[1], make_word(pixels.keys[1][i], number));
        if (pixels.covered[2][i] != 0) raise<sharing>(words[target.width], make_word(pixels.keys[2][i], number));
        if (pixels.covered[3][i] != 0) raise<sharing>(words[target.width + 1], make_word(pixels.keys[3][i], number));
    }
}

inline void draw_small(const MeshTarget& target, const TriangleBlock& block, Sharing sharing) {
    if (sharing == Sharing::shared)
        draw_small_as<Sharing::shared>(target, block);
    else
        draw_small_as<Sharing::alone>(target, block);
}

inline void draw(const RasterTriangle& triangle, const MeshTarget& target) {
    TriangleSpans spans(triangle, target);
    for (int32_t row = spans.first_row(); row <= spans.last_row(); ++row) {
        const TriangleSpans::Columns columns = spans.next_row();
        const double row_key = spans.row_key(row);
        uint64_t* const words = target.words + size_t(row - int32_t(target.first_row)) * target.width;
        for (int32_t column = columns.first; column <= columns.last; ++column) {
            const uint64_t word = make_word(float(spans.key_at(row_key, column)), triangle.number), old = words[column];
            words[column] = word > old ? word : old;
        }
    }
}

#define STRATA_MESH_KERNELS(name, TARGET)                                                                                                    \
    TARGET void project_##name(const MeshProjection& view, const Vec3d* positions, size_t count, ProjectedVertex* out) {                     \
        project(view, positions, count, out);                                                                                                \
    }                                                                                                                                        \
    TARGET void sort_##name(const MeshGeometry& geometry, const MeshTarget& target, TriangleBlock& block) { sort(geometry, target, block); } \
    TARGET void draw_small_##name(const MeshTarget& target, const TriangleBlock& block, Sharing sharing) {                                   \
        draw_small(target, block, sharing);                                                                                                  \
    }                                                                                                                                        \
    TARGET void draw_##name(const RasterTriangle& triangle, const MeshTarget& target) { draw(triangle, target); }                            \
    constexpr MeshKernels k_##name = {project_##name, sort_##name, draw_small_##name, draw_##name};

STRATA_MESH_KERNELS(baseline, STRATA_KERNEL_BASELINE)
STRATA_MESH_KERNELS(avx2, STRATA_KERNEL_AVX2)
STRATA_MESH_KERNELS(avx512, STRATA_KERNEL_AVX512)

}  // namespace

const MeshKernels& mesh_kernels(SimdLevel level) {
    switch (level) {
        case SimdLevel::baseline: return k_baseline;
        case SimdLevel::avx2: return k_avx2;
        case SimdLevel::avx512: return k_avx512;
    }
    return k_baseline;
}

}  // namespace strata
