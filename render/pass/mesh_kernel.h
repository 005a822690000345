#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/simd_level.h"
#include "render/pass/mesh_projection.h"

namespace strata {

// A triangle covers the pixels whose centers lie in it, in integers; of those on an edge or corner that it shares with others each is covered once
// (what lies on a left edge or a level upper one is in). A pixel's word is the key above the complement of the triangle's number: the largest stays.
// The key is what is linear in the picture between those of the corners, so within them.

/// Rows [first_row, first_row + rows) of a picture.
struct MeshTarget {
    uint64_t* words;  // [width * rows]
    uint32_t width, first_row, rows;
};

struct MeshGeometry {
    const std::array<uint32_t, 3>* triangles;
    const ProjectedVertex* vertices;
};

enum class TriangleKind : int32_t {
    nothing,    // covers no pixel of the target
    small,      // kSmallPx pixels or less, and their words are to be raised
    large,
    unsnapped,  // has to be cut
};

inline constexpr int32_t kSmallSide = 8, kSmallPx = 32;  // of the box around the centers that a small triangle may cover
inline constexpr size_t kTriangleBlock = 128;

/// Triangles one after the other, and the pixels of the target whose centers lie in the boxes around them.
struct TriangleBlock {
    uint32_t first;
    size_t count;
    alignas(64) int32_t left[kTriangleBlock], right[kTriangleBlock], top[kTriangleBlock], bottom[kTriangleBlock];  // all included
    alignas(64) TriangleKind kinds[kTriangleBlock];
    alignas(64) int32_t x[3][kTriangleBlock], y[3][kTriangleBlock];  // of the corners
    alignas(64) float key[3][kTriangleBlock];
};

/// A triangle by itself.
struct RasterTriangle {
    std::array<int32_t, 3> x, y;
    std::array<float, 3> key;
    uint32_t number;
};

/// Whether others write the same words at the same time.
enum class Sharing { alone, shared };

/// The kernels compiled for an instruction set, which the processor must have. All give the same bits.
struct MeshKernels {
    void (*project)(const MeshProjection& view, const Vec3d* positions, size_t count, ProjectedVertex* out);
    /// Fills all but first and count.
    void (*sort)(const MeshGeometry& geometry, const MeshTarget& target, TriangleBlock& block);
    /// Draws the small ones of a block.
    void (*draw_small)(const MeshTarget& target, const TriangleBlock& block, Sharing sharing);
    /// Draws any triangle, alone.
    void (*draw)(const RasterTriangle& triangle, const MeshTarget& target);
};
const MeshKernels& mesh_kernels(SimdLevel level);

/// Calls visit(column, row, key) for each pixel of the target that the triangle covers: the same as `draw`, but slower.
template <typename Visit>
void visit_pixels(const RasterTriangle& triangle, const MeshTarget& target, const Visit& visit);

/// The rows and columns of a triangle one after the other. Inline: kernels compile it for each instruction set.
class TriangleSpans {
public:
    TriangleSpans(const RasterTriangle& t, const MeshTarget& target);

    bool empty() const { return first_row_ > last_row_; }
    int32_t first_row() const { return first_row_; }
    int32_t last_row() const { return last_row_; }
    /// Columns that a row covers, of the target, both included; none: first > last. Rows are asked for in their order.
    struct Columns {
        int32_t first, last;
    };
    Columns next_row();
    /// Of the pixel in a row.
    double row_key(int32_t row) const { return base_ + double(row) * key_per_row_; }
    double key_at(double row_key, int32_t column) const {
        const double key = row_key + double(column) * key_per_column_;
        return key < least_key_ ? least_key_ : key > most_key_ ? most_key_ : key;
    }

private:
    struct Edge {
        int64_t value, per_column, per_row;  // at column 0 of the next row; the pixel is inside where none is negative
        double inverse;                      // 1 / |per_column|
    };
    std::array<Edge, 3> edges_ = {};
    int32_t first_column_ = 0, last_column_ = -1, first_row_ = 0, last_row_ = -1;
    double base_ = 0.0, key_per_column_ = 0.0, key_per_row_ = 0.0, least_key_ = 0.0, most_key_ = 0.0;
};

/// The whole part of value / divisor, exactly if it is between -2^20 and 2^20, else beyond these. |value| < 2^62, 0 < divisor < 2^40
inline int64_t floor_of_quotient(int64_t value, int64_t divisor, double inverse) {
    constexpr double kFar = 0x1p20;
    const double about = double(value) * inverse;
    const int64_t quotient = int64_t(about < -kFar ? -kFar : about > kFar ? kFar : about), rest = value - quotient * divisor;
    return quotient + (rest >= divisor) - (rest < 0);  // a guess that is no more than one off
}

inline TriangleSpans::TriangleSpans(const RasterTriangle& t, const MeshTarget& target) {
    const int64_t x0 = t.x[0], y0 = t.y[0];
    const int64_t signed_area = (t.x[1] - x0) * (t.y[2] - y0) - (t.y[1] - y0) * (t.x[2] - x0);
    if (signed_area == 0) return;
    const size_t second = signed_area > 0 ? 1 : 2, third = 3 - second;
    const std::array<int64_t, 3> x = {x0, t.x[second], t.x[third]}, y = {y0, t.y[second], t.y[third]};
    const auto from = [](int64_t least) { return int32_t((least + kSubpixels / 2 - 1) >> kSubpixelBits); };  // the first center at or behind it
    const auto to = [](int64_t most) { return int32_t((most - kSubpixels / 2) >> kSubpixelBits); };
    const auto least_of = [](const std::array<int64_t, 3>& v) { return v[0] < v[1] ? (v[0] < v[2] ? v[0] : v[2]) : (v[1] < v[2] ? v[1] : v[2]); };
    const auto most_of = [](const std::array<int64_t, 3>& v) { return v[0] > v[1] ? (v[0] > v[2] ? v[0] : v[2]) : (v[1] > v[2] ? v[1] : v[2]); };
    const int32_t top = from(least_of(y)), bottom = to(most_of(y)), target_top = int32_t(target.first_row), target_bottom = int32_t(target.first_row + target.rows) - 1;
    first_column_ = from(least_of(x)) > 0 ? from(least_of(x)) : 0;
    last_column_ = to(most_of(x)) < int32_t(target.width) - 1 ? to(most_of(x)) : int32_t(target.width) - 1;
    if (first_column_ > last_column_) return;
    first_row_ = top > target_top ? top : target_top;
    last_row_ = bottom < target_bottom ? bottom : target_bottom;
    const int64_t center_y = int64_t{first_row_} * kSubpixels + kSubpixels / 2, center_x = kSubpixels / 2;
    for (size_t i = 0; i < 3; ++i) {
        const size_t a = i, b = (i + 1) % 3;
        const int64_t dx = x[b] - x[a], dy = y[b] - y[a];
        const int64_t owned = dy < 0 || (dy == 0 && dx > 0) ? 0 : -1;
        edges_[i] = {dx * (center_y - y[a]) - dy * (center_x - x[a]) + owned, -dy * kSubpixels, dx * kSubpixels, 1.0 / double(dy == 0 ? 1 : kSubpixels * (dy < 0 ? -dy : dy))};
    }
    // On the plane through the three keys, from the first vertex on.
    const double area = double(signed_area > 0 ? signed_area : -signed_area);
    const double k0 = double(t.key[0]), k1 = double(t.key[second]) - k0, k2 = double(t.key[third]) - k0;
    const double x1 = double(x[1] - x[0]), y1 = double(y[1] - y[0]), x2 = double(x[2] - x[0]), y2 = double(y[2] - y[0]);
    const double per_x = (k1 * y2 - k2 * y1) / area, per_y = (k2 * x1 - k1 * x2) / area;
    base_ = k0 + double(kSubpixels / 2 - x[0]) * per_x + double(kSubpixels / 2 - y[0]) * per_y;
    key_per_column_ = per_x * kSubpixels;
    key_per_row_ = per_y * kSubpixels;
    const auto key = [&](size_t i) { return double(t.key[i]); };
    least_key_ = key(0) < key(1) ? (key(0) < key(2) ? key(0) : key(2)) : (key(1) < key(2) ? key(1) : key(2));
    most_key_ = key(0) > key(1) ? (key(0) > key(2) ? key(0) : key(2)) : (key(1) > key(2) ? key(1) : key(2));
}

inline TriangleSpans::Columns TriangleSpans::next_row() {
    int64_t first = first_column_, last = last_column_;
    for (Edge& edge : edges_) {
        if (edge.per_column > 0) {
            const int64_t from = -floor_of_quotient(edge.value, edge.per_column, edge.inverse);
            first = from > first ? from : first;
        } else if (edge.per_column < 0) {
            const int64_t to = floor_of_quotient(edge.value, -edge.per_column, edge.inverse);
            last = to < last ? to : last;
        } else if (edge.value < 0) {
            last = first - 1;
        }
        edge.value += edge.per_row;
    }
    return {int32_t(first), int32_t(last < first - 1 ? first - 1 : last)};
}

template <typename Visit>
void visit_pixels(const RasterTriangle& triangle, const MeshTarget& target, const Visit& visit) {
    TriangleSpans spans(triangle, target);
    for (int32_t row = spans.first_row(); row <= spans.last_row(); ++row) {
        const TriangleSpans::Columns columns = spans.next_row();
        const double row_key = spans.row_key(row);
        for (int32_t column = columns.first; column <= columns.last; ++column) visit(column, row, float(spans.key_at(row_key, column)));
    }
}

}  // namespace strata
