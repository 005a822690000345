#include "render/pass/points_pass.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

#include "core/parallel.h"

namespace strata {
namespace {

constexpr size_t kBlock = 256;           // points projected at a time: their values stay in the nearest cache
constexpr size_t kUnitPoints = 1 << 15;  // points a thread takes at a time

struct Target {
    uint64_t* words;
    uint32_t width, first_row, rows;
};

// Points of one block after projection. Points that are not drawn have key 0.
struct Projected {
    alignas(64) float x_px[kBlock];
    alignas(64) float y_px[kBlock];
    alignas(64) float size_px[kBlock];
    alignas(64) uint32_t key[kBlock];
    // Tilt of the surface around the point: how much farther it lies a pixel to the right, and one down, in pixels.
    alignas(64) float slope_x[kBlock];
    alignas(64) float slope_y[kBlock];
};

inline void raise(uint64_t& word, uint64_t value) {
    std::atomic_ref<uint64_t> pixel(word);
    uint64_t current = pixel.load(std::memory_order_relaxed);
    while (value > current && !pixel.compare_exchange_weak(current, value, std::memory_order_relaxed)) {
    }
}

// near:  every difference to the eye fits in 32 bits
template <bool perspective, bool near>
void project_block(const PointProjection& view, const int32_t* x, const int32_t* y, const int32_t* z, size_t count,
                   Projected& out) {
    const int32_t eye_x = int32_t(view.eye_quanta[0]), eye_y = int32_t(view.eye_quanta[1]), eye_z = int32_t(view.eye_quanta[2]);
    for (size_t i = 0; i < count; ++i) {
        float dx, dy, dz;
        if constexpr (near) {
            dx = float(x[i] - eye_x);
            dy = float(y[i] - eye_y);
            dz = float(z[i] - eye_z);
        } else {
            dx = float(x[i] - view.eye_quanta[0]);
            dy = float(y[i] - view.eye_quanta[1]);
            dz = float(z[i] - view.eye_quanta[2]);
        }
        const float depth = view.depth_row[0] * dx + view.depth_row[1] * dy + view.depth_row[2] * dz + view.depth_row[3];
        const float across = view.x_row[0] * dx + view.x_row[1] * dy + view.x_row[2] * dz + view.x_row[3];
        const float down = view.y_row[0] * dx + view.y_row[1] * dy + view.y_row[2] * dz + view.y_row[3];
        float key;
        if constexpr (perspective) {
            const float inverse = 1.0f / depth;
            key = view.key_scale * inverse;
            out.x_px[i] = view.center_x + across * inverse;
            out.y_px[i] = view.center_y + down * inverse;
        } else {
            // What lies beyond far still shows, behind all else.
            key = std::max(view.key_offset + view.key_scale * depth, 0x1p-100f);
            out.x_px[i] = view.center_x + across;
            out.y_px[i] = view.center_y + down;
        }
        const uint32_t bits = std::bit_cast<uint32_t>(key);
        out.key[i] = depth >= view.near_depth ? bits : 0;
    }
}

// Adaptive diameter of a point: spacing at its place, projected.
template <bool perspective>
inline float adaptive_size_px(const PointProjection& view, const SplatStyle& style, const PointShape& shape, uint32_t key) {
    float size = style.spacing_factor * view.pixels_per_unit * shape.spacing;
    if constexpr (perspective) size *= std::bit_cast<float>(key) / view.key_scale;
    return std::min(std::max(size, style.least_px), style.most_px);
}

constexpr float kMostSlope = 4.0f;  // 76 degrees: what is steeper is drawn as steep as this

template <bool perspective>
void shape_block(const PointProjection& view, const SplatStyle& style, const PointShape* shapes, size_t count, Projected& out) {
    for (size_t i = 0; i < count; ++i) {
        out.size_px[i] = adaptive_size_px<perspective>(view, style, shapes[i], out.key[i]);
        const float nx = shapes[i].normal[0], ny = shapes[i].normal[1], nz = shapes[i].normal[2];
        const float right = view.right[0] * nx + view.right[1] * ny + view.right[2] * nz;
        const float down = view.down[0] * nx + view.down[1] * ny + view.down[2] * nz;
        float along = view.forward[0] * nx + view.forward[1] * ny + view.forward[2] * nz;  // the view ray
        if constexpr (perspective)
            along += (right * (out.x_px[i] - view.center_x) + down * (out.y_px[i] - view.center_y)) / view.pixels_per_unit;
        // Slope (right, down) / -along, no longer than the most; a zero normal gives zero.
        const float across = std::sqrt(right * right + down * down);
        const float divisor = std::max(std::abs(along), std::max(across / kMostSlope, 1e-6f));
        const float scale = (along > 0.0f ? -1.0f : 1.0f) / divisor;
        out.slope_x[i] = right * scale;
        out.slope_y[i] = down * scale;
    }
}

// The key of a depth on a plane through that of `key` that lies `rise_px` farther there, and behind it by `fall_px`.
template <bool perspective>
inline uint32_t key_behind(const PointProjection& view, uint32_t key, float rise_px, float fall_px) {
    const float rise = rise_px / view.pixels_per_unit, fall = fall_px / view.pixels_per_unit;  // over depth, in perspective
    const float center = std::bit_cast<float>(key);
    // On a plane, one over depth is linear in the picture.
    if constexpr (perspective) return std::bit_cast<uint32_t>(std::max(center * (1.0f - rise) / (1.0f + fall), 0x1p-100f));
    return std::bit_cast<uint32_t>(std::max(center + view.key_scale * (rise + fall), 0x1p-100f));
}

void scatter_pixels(const Target& target, const Projected& block, size_t count, uint32_t rank) {
    const float width = float(target.width), top = float(target.first_row), bottom = float(target.first_row + target.rows);
    for (size_t i = 0; i < count; ++i) {
        const float x = block.x_px[i], y = block.y_px[i];
        if (block.key[i] == 0 || !(x >= 0.0f && x < width && y >= top && y < bottom)) continue;
        const size_t pixel = size_t(uint32_t(y) - target.first_row) * target.width + uint32_t(x);
        raise(target.words[pixel], uint64_t{block.key[i]} << 32 | ~(rank + uint32_t(i)));
    }
}

template <SplatShape shape, bool perspective>
void scatter_splats(const Target& target, const PointProjection& view, const Projected& block, size_t count, uint32_t rank) {
    const float width = float(target.width), top = float(target.first_row), bottom = float(target.first_row + target.rows);
    for (size_t i = 0; i < count; ++i) {
        if (block.key[i] == 0) continue;
        const float x = block.x_px[i], y = block.y_px[i], radius = 0.5f * block.size_px[i];
        // Centers c + 0.5 in (x - radius, x + radius]; at one pixel that is the pixel of the point.
        const float left = std::max(x + (0.5f - radius), 0.0f), right = std::min(x + (0.5f + radius), width);
        const float above = std::max(y + (0.5f - radius), top), below = std::min(y + (0.5f + radius), bottom);
        if (!(left < right && above < below)) continue;
        const uint64_t word = uint64_t{block.key[i]} << 32 | ~(rank + uint32_t(i));
        const float inverse_square = 1.0f / (radius * radius);
        const uint32_t x_end = uint32_t(right), y_end = uint32_t(below);
        for (uint32_t row = uint32_t(above); row < y_end; ++row) {
            uint64_t* const line = target.words + size_t(row - target.first_row) * target.width;
            const float dy = float(row) + 0.5f - y;
            for (uint32_t column = uint32_t(left); column < x_end; ++column) {
                if constexpr (shape != SplatShape::square) {
                    // Below this diameter a disc may miss every center, and the square covers two by two at most.
                    if (radius > 0.75f) {
                        const float dx = float(column) + 0.5f - x;
                        float square = dx * dx + dy * dy, rise = 0.0f;
                        if constexpr (shape == SplatShape::paraboloid) {
                            rise = block.slope_x[i] * dx + block.slope_y[i] * dy;
                            square += rise * rise;
                        }
                        square *= inverse_square;
                        if (square > 1.0f) continue;
                        if constexpr (shape == SplatShape::paraboloid) {
                            const uint32_t key = key_behind<perspective>(view, block.key[i], rise, radius * square);
                            raise(line[column], uint64_t{key} << 32 | ~(rank + uint32_t(i)));
                            continue;
                        }
                    }
                }
                raise(line[column], word);
            }
        }
    }
}

template <bool perspective, bool near>
void draw_unit(const Target& target, const PointNode& node, size_t begin, size_t end, const PointProjection& view,
               const SplatStyle& style) {
    Projected block;
    const bool one_pixel = style.fixed_px > 0.0f && style.fixed_px <= 1.0f;
    if (style.fixed_px > 0.0f) {
        std::fill(std::begin(block.size_px), std::end(block.size_px), style.fixed_px);
        std::fill(std::begin(block.slope_x), std::end(block.slope_x), 0.0f);
        std::fill(std::begin(block.slope_y), std::end(block.slope_y), 0.0f);
    }
    const ResidentNode& points = *node.points;
    for (; begin < end; begin += kBlock) {
        const size_t count = std::min(kBlock, end - begin);
        project_block<perspective, near>(view, &points.x[begin], &points.y[begin], &points.z[begin], count, block);
        const uint32_t rank = node.first_rank + uint32_t(begin);
        if (one_pixel) {
            scatter_pixels(target, block, count, rank);
            continue;
        }
        if (style.fixed_px <= 0.0f) shape_block<perspective>(view, style, &points.shapes[begin], count, block);
        switch (style.shape) {
            case SplatShape::square: scatter_splats<SplatShape::square, perspective>(target, view, block, count, rank); break;
            case SplatShape::disc: scatter_splats<SplatShape::disc, perspective>(target, view, block, count, rank); break;
            case SplatShape::paraboloid:
                scatter_splats<SplatShape::paraboloid, perspective>(target, view, block, count, rank);
                break;
        }
    }
}

// Depth of the plane that the point stands for at a pixel. A paraboloid's fall behind it decides what is seen, but is no relief.
template <bool perspective>
float plane_depth_at(const PointProjection& view, const SplatStyle& style, const ResidentNode& points, size_t index, float x, float y) {
    Projected one;
    project_block<perspective, false>(view, &points.x[index], &points.y[index], &points.z[index], 1, one);
    shape_block<perspective>(view, style, &points.shapes[index], 1, one);
    const float rise = one.slope_x[0] * (x - one.x_px[0]) + one.slope_y[0] * (y - one.y_px[0]);
    return view.linear_depth(std::bit_cast<float>(key_behind<perspective>(view, one.key[0], rise, 0.0f)));
}

float plane_depth(const PointProjection& view, const SplatStyle& style, const ResidentNode& points, size_t index, size_t column, size_t row) {
    const float x = float(column) + 0.5f, y = float(row) + 0.5f;
    return view.perspective ? plane_depth_at<true>(view, style, points, index, x, y) : plane_depth_at<false>(view, style, points, index, x, y);
}

// Whether every quanta difference between the node's points and the eye fits in 32 bits.
bool is_near(const ResidentNode& points, const PointProjection& view) {
    for (size_t axis = 0; axis < 3; ++axis) {
        const int64_t eye = view.eye_quanta[axis];
        if (eye != int32_t(eye) || points.min_quanta[int(axis)] - eye < INT32_MIN || points.max_quanta[int(axis)] - eye > INT32_MAX)
            return false;
    }
    return true;
}

}  // namespace

PointsPass::PointsPass(uint32_t width, uint32_t first_row, uint32_t rows)
    : width_(width), first_row_(first_row), rows_(rows), words_(size_t(width) * rows, 0) {}

void PointsPass::draw(std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style,
                      int threads) {
    struct Unit {
        const PointNode* node;
        size_t begin, end;
    };
    std::vector<Unit> units;
    for (const PointNode& node : nodes) {
        if (node.bottom_row < float(first_row_) || node.top_row >= float(first_row_ + rows_)) continue;
        for (size_t begin = 0; begin < node.points->size(); begin += kUnitPoints)
            units.push_back({&node, begin, std::min(begin + kUnitPoints, node.points->size())});
    }
    const Target target = {words_.data(), width_, first_row_, rows_};
    parallel_blocks(threads, units.size(), 1, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const auto& [node, first, last] = units[i];
            const bool near = is_near(*node->points, projection);
            if (projection.perspective)
                (near ? draw_unit<true, true> : draw_unit<true, false>)(target, *node, first, last, projection, style);
            else
                (near ? draw_unit<false, true> : draw_unit<false, false>)(target, *node, first, last, projection, style);
        }
    });
}

void PointsPass::resolve(std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style,
                         const ResolveOptions& options, int threads, GBuffer& out) const {
    out.width = width_;
    out.first_row = first_row_;
    out.rows = rows_;
    out.colors.resize(words_.size());
    out.depths.resize(words_.size());
    out.splat_px.assign(options.splat_px ? words_.size() : 0, 0);
    out.ids.resize(options.ids ? words_.size() : 0);
    parallel_blocks(threads, rows_, 16, [&](size_t first, size_t last) {
        size_t slot = 0;  // of the pixel before: neighbours mostly show the same node
        for (size_t pixel = first * width_; pixel < last * width_; ++pixel) {
            const uint64_t word = words_[pixel];
            if (word == 0) {
                out.colors[pixel] = 0;
                out.depths[pixel] = kNoDepth;
                if (options.ids) out.ids[pixel] = kNoPixelId;
                continue;
            }
            const uint32_t rank = ~uint32_t(word);
            if (rank < nodes[slot].first_rank || rank - nodes[slot].first_rank >= nodes[slot].points->size()) {
                const auto after = std::upper_bound(nodes.begin(), nodes.end(), rank,
                                                    [](uint32_t r, const PointNode& node) { return r < node.first_rank; });
                // Of slots with the same first rank all but the last are empty, and upper_bound is behind the last.
                slot = size_t(after - nodes.begin()) - 1;
            }
            const uint32_t index = rank - nodes[slot].first_rank;
            out.colors[pixel] = nodes[slot].points->colors[index];
            const uint32_t key = uint32_t(word >> 32);
            const PointShape* shape = style.fixed_px > 0.0f ? nullptr : &nodes[slot].points->shapes[index];
            out.depths[pixel] = style.shape == SplatShape::paraboloid && shape && shape->flat()
                                    ? plane_depth(projection, style, *nodes[slot].points, index, pixel % width_, first_row_ + pixel / width_)
                                    : projection.linear_depth(std::bit_cast<float>(key));
            if (options.splat_px) {
                const float size = !shape                ? style.fixed_px
                                   : projection.perspective ? adaptive_size_px<true>(projection, style, *shape, key)
                                                            : adaptive_size_px<false>(projection, style, *shape, key);
                // Flat ones have no rims; steps between them are noise, which half their size evens out.
                out.splat_px[pixel] = uint8_t(std::min((shape && shape->flat() ? 0.5f : 1.0f) * size + 0.5f, 255.0f));
            }
            if (options.ids) out.ids[pixel] = make_pixel_id(uint32_t(slot), index);
        }
    });
}

}  // namespace strata
