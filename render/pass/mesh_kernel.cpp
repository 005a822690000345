#include "render/pass/mesh_kernel.h"

#include <algorithm>
#include <atomic>

#include "core/simd_target.h"

namespace strata {
namespace {

inline void project(const MeshProjection& view, const Vec3d* positions, size_t count, ProjectedVertex* out) {
    const double* const p = positions->data();
    for (size_t i = 0; i < count; ++i) out[i] = project_vertex(view, p[3 * i], p[3 * i + 1], p[3 * i + 2]);
}

inline int32_t least(int32_t a, int32_t b) { return a < b ? a : b; }
inline int32_t most(int32_t a, int32_t b) { return a > b ? a : b; }

constexpr int32_t kFar = 1 << 30;  // beside any picture

inline void sort(const MeshGeometry& geometry, const MeshTarget& target, TriangleBlock& block) {
    const int32_t width = int32_t(target.width), first_row = int32_t(target.first_row), end_row = first_row + int32_t(target.rows);
    const std::array<uint32_t, 3>* const triangles = geometry.triangles + block.first;
    for (size_t i = 0; i < block.count; ++i) {
        const ProjectedVertex a = geometry.vertices[triangles[i][0]], b = geometry.vertices[triangles[i][1]], c = geometry.vertices[triangles[i][2]];
        const int32_t least_x = least(least(a.x, b.x), c.x), most_x = most(most(most(a.x, b.x), c.x), -kFar);
        const int32_t least_y = least(least(a.y, b.y), c.y), most_y = most(most(a.y, b.y), c.y);
        const bool unsnapped = least_x == kUnsnapped, behind = (a.key == 0.0f) & (b.key == 0.0f) & (c.key == 0.0f);
        const int32_t left = (least_x + kSubpixels / 2 - 1) >> kSubpixelBits, right = (most_x - kSubpixels / 2) >> kSubpixelBits;
        const int32_t top = (least_y + kSubpixels / 2 - 1) >> kSubpixelBits, bottom = (most_y - kSubpixels / 2) >> kSubpixelBits;
        // By the whole triangle: its kind decides how its keys are rounded.
        const int32_t columns = least(right - left + 1, kSmallSide + 1), rows = least(bottom - top + 1, kSmallSide + 1);
        block.left[i] = most(left, 0);
        block.right[i] = least(right, width - 1);
        block.top[i] = most(top, first_row);
        block.bottom[i] = least(bottom, end_row - 1);
        const bool seen = (block.left[i] <= block.right[i]) & (block.top[i] <= block.bottom[i]);
        const bool is_small = (columns <= kSmallSide) & (rows <= kSmallSide) & (columns * rows <= kSmallPx);
        const TriangleKind kind = is_small ? TriangleKind::small : TriangleKind::large;
        block.kinds[i] = behind ? TriangleKind::nothing : unsnapped ? TriangleKind::unsnapped : seen ? kind : TriangleKind::nothing;
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

// Corners lie within kSmallSide + 1 pixels of each other, so 32 bits hold all products.
template <Sharing sharing>
inline void draw_small_one(const MeshGeometry& geometry, const MeshTarget& target, const TriangleBlock& block, size_t i) {
    const uint32_t number = block.first + uint32_t(i);
    const std::array<uint32_t, 3>& corners = geometry.triangles[number];
    const ProjectedVertex a = geometry.vertices[corners[0]];
    ProjectedVertex b = geometry.vertices[corners[1]], c = geometry.vertices[corners[2]];
    int32_t area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if (area == 0) return;
    if (area < 0) {
        std::swap(b, c);
        area = -area;
    }
    const int32_t left = block.left[i], right = block.right[i], top = block.top[i], bottom = block.bottom[i];
    const int32_t x = left * kSubpixels + kSubpixels / 2, y = top * kSubpixels + kSubpixels / 2;
    struct Edge {
        int32_t value, dx, dy, owned;
    };
    const auto edge = [&](const ProjectedVertex& from, const ProjectedVertex& to) {
        const int32_t dx = to.x - from.x, dy = to.y - from.y;
        return Edge{dx * (y - from.y) - dy * (x - from.x), dx * kSubpixels, -dy * kSubpixels, (dy < 0) | ((dy == 0) & (dx > 0)) ? 0 : -1};
    };
    Edge across_a = edge(b, c), across_b = edge(c, a), across_c = edge(a, b);
    const double inverse = 1.0 / double(area);
    uint64_t* words = target.words + size_t(top - int32_t(target.first_row)) * target.width;
    for (int32_t row = top; row <= bottom; ++row, words += target.width) {
        int32_t weight_a = across_a.value, weight_b = across_b.value, weight_c = across_c.value;
        for (int32_t column = left; column <= right; ++column) {
            if (((weight_a + across_a.owned) | (weight_b + across_b.owned) | (weight_c + across_c.owned)) >= 0) {
                const double sum = double(weight_a) * double(a.key) + double(weight_b) * double(b.key) + double(weight_c) * double(c.key);
                raise<sharing>(words[column], make_word(float(sum * inverse), number));
            }
            weight_a += across_a.dy;
            weight_b += across_b.dy;
            weight_c += across_c.dy;
        }
        across_a.value += across_a.dx;
        across_b.value += across_b.dx;
        across_c.value += across_c.dx;
    }
}

inline void draw_small(const MeshGeometry& geometry, const MeshTarget& target, const TriangleBlock& block, Sharing sharing) {
    for (size_t i = 0; i < block.count; ++i) {
        if (block.kinds[i] != TriangleKind::small) continue;
        if (sharing == Sharing::shared)
            draw_small_one<Sharing::shared>(geometry, target, block, i);
        else
            draw_small_one<Sharing::alone>(geometry, target, block, i);
    }
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
    TARGET void draw_small_##name(const MeshGeometry& geometry, const MeshTarget& target, const TriangleBlock& block, Sharing sharing) {     \
        draw_small(geometry, target, block, sharing);                                                                                        \
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
