#version 450 core
// points.comp: rasterizes points into a word a pixel, depth key above the complement of the rank, as points_kernel.cpp does.
//              Run once for the keys and, when all are there, once for the ranks: atomics of 64 bits would do both at once.
// in      quanta of points and what they stand for, in chunks; a work group's row says which chunk, and up to where
// out     words: [2 i + 1] key bits of pixel i, [2 i] complement of the rank; the largest win
// source  the order of operations is point_block.h's: sums, products and conversions round alike everywhere, and only division
//         and square root may be off by an ulp or two, where GL computes them so
layout(local_size_x = 256) in;

const uint chunk_points = 2048;  // PointPool::kChunkPoints
const uint wide = 1;             // row flag: differences to the eye need 64 bits
const int square = 0, disc = 1;  // SplatShape; else a paraboloid
const float least_key = 7.888609052210118e-31;  // 0x1p-100
const float most_slope = 4.0;

layout(std430, binding = 0) readonly buffer Positions { int positions[]; };  // x of a chunk, then y, then z
layout(std430, binding = 1) readonly buffer Shapes { uvec2 shapes[]; };      // bits of the spacing, bytes of the normal
layout(std430, binding = 2) readonly buffer Rows { uvec4 rows[]; };          // chunk, points in it, rank of its first, flags
layout(std430, binding = 3) buffer Words { uint words[]; };

// Mirrored by PointsGlPass.
layout(std140, binding = 0) uniform View {
    vec4 x_row, y_row, depth_row;
    vec4 right, down, forward;      // xyz
    ivec4 eye_low, eye_high;        // xyz: halves of 64-bit quanta
    vec2 center_px;
    float near_depth, key_scale;
    float key_offset, inverse_key_scale, inverse_unit;
    float fixed_px;                 // 0: adaptive
    float size_scale;               // px of an adaptive splat of spacing 1 at depth 1
    float least_px, most_px;
    int perspective;
    int shape;
    uint stride;                    // words from row to row
    uint first_row, row_count;      // of the picture, that are drawn
    uint width;
} view;

layout(location = 0) uniform int first_chunk;  // of the rows, that this dispatch draws
layout(location = 1) uniform int find_ranks;   // 0: raise keys

// The difference of quanta, rounded to nearest even as the CPU does it.
float wide_difference(int quanta, uint low, int high) {
    uint l = uint(quanta) - low;
    int signed_h = (quanta >> 31) - high - (uint(quanta) < low ? 1 : 0);
    const bool negative = signed_h < 0;
    uint h = uint(signed_h);
    if (negative) {
        l = ~l + 1u;
        h = ~h + (l == 0u ? 1u : 0u);
    }
    if ((h | l) == 0u) return 0.0;
    const int top = h != 0u ? 32 + findMSB(h) : findMSB(l);
    const int left = 63 - top;
    if (left >= 32) {
        h = l << (left - 32);
        l = 0u;
    } else if (left > 0) {
        h = h << left | l >> (32 - left);
        l <<= left;
    }
    const uint rest = h & 255u;
    uint kept = h >> 8;
    kept += rest > 128u || (rest == 128u && (l != 0u || (kept & 1u) != 0u)) ? 1u : 0u;
    const float size = float(kept) * uintBitsToFloat(uint(104 + top) << 23);
    return negative ? -size : size;
}

float difference(int quanta, int axis, bool is_wide) {
    return is_wide ? wide_difference(quanta, uint(view.eye_low[axis]), view.eye_high[axis]) : float(quanta - view.eye_low[axis]);
}

float transform(vec4 row, vec3 d) {
    precise float sum = row.x * d.x + row.y * d.y + row.z * d.z + row.w;
    return sum;
}

void raise(uint column, uint row, float key, uint rank) {
    const uint at = 2u * ((row - view.first_row) * view.stride + column);
    const uint bits = floatBitsToUint(key);
    if (find_ranks != 0) {
        if (words[at + 1u] == bits && words[at] < ~rank) atomicMax(words[at], ~rank);
    } else if (words[at + 1u] < bits) {
        atomicMax(words[at + 1u], bits);
    }
}

struct Splat {
    vec2 center_px;
    float key, size_px;
    vec2 slope;  // how much farther the surface lies a pixel to the right, and one down, in px
};

void shape_splat(inout Splat splat, uvec2 shape) {
    precise float size = view.size_scale * uintBitsToFloat(shape.x);
    if (view.perspective != 0) {
        precise float share = splat.key * view.inverse_key_scale;
        size *= share;
    }
    splat.size_px = min(max(size, view.least_px), view.most_px);
    const int bytes = int(shape.y);
    const vec3 n = vec3(bitfieldExtract(bytes, 0, 8), bitfieldExtract(bytes, 8, 8), bitfieldExtract(bytes, 16, 8));
    precise float right = view.right.x * n.x + view.right.y * n.y + view.right.z * n.z;
    precise float down = view.down.x * n.x + view.down.y * n.y + view.down.z * n.z;
    precise float along = view.forward.x * n.x + view.forward.y * n.y + view.forward.z * n.z;
    if (view.perspective != 0) {
        precise float aside = right * (splat.center_px.x - view.center_px.x) + down * (splat.center_px.y - view.center_px.y);
        precise float leaning = along + aside * view.inverse_unit;
        along = leaning;
    }
    precise float across = sqrt(right * right + down * down);
    precise float divisor = max(abs(along), max(across * (1.0 / most_slope), 1e-6));
    precise float scale = 1.0 / divisor;
    scale = along > 0.0 ? -scale : scale;
    precise vec2 slope = vec2(right * scale, down * scale);
    splat.slope = slope;
}

// The key that a splat has a way beside its center, 0 outside of it.
float key_at(Splat splat, float x, float y) {
    if (view.shape == square) return splat.key;
    precise float radius = 0.5 * splat.size_px;
    precise float inverse_square = 1.0 / (radius * radius);
    const bool is_round = radius > 0.75;
    if (view.shape == disc) {
        precise float share = (x * x + y * y) * inverse_square;
        return share <= 1.0 || !is_round ? splat.key : 0.0;
    }
    precise float rise = splat.slope.x * x + splat.slope.y * y;
    precise float share = (x * x + y * y + rise * rise) * inverse_square;
    precise float fall = min(radius * view.inverse_unit, 0.5) * share;
    precise float behind;
    if (view.perspective != 0) {
        precise float on_plane = splat.key - splat.key * (rise * view.inverse_unit);
        behind = on_plane - on_plane * fall;
    } else {
        precise float on_plane = splat.key + view.key_scale * (rise * view.inverse_unit);
        behind = on_plane + view.key_scale * fall;
    }
    if (!is_round) return splat.key;
    return share <= 1.0 ? max(behind, least_key) : 0.0;
}

void draw_splat(Splat splat, uint rank) {
    const float width = float(view.width), top = float(view.first_row), bottom = float(view.first_row + view.row_count);
    precise float x = splat.center_px.x, y = splat.center_px.y, radius = 0.5 * splat.size_px;
    precise float left = max(x + (0.5 - radius), 0.0), right = min(x + (0.5 + radius), width);
    precise float above = max(y + (0.5 - radius), top), below = min(y + (0.5 + radius), bottom);
    if (!(left < right && above < below)) return;
    const int first_column = int(left), columns = int(right), end_row = int(below);
    for (int row = int(above); row < end_row; ++row)
        for (int column = first_column; column < columns; ++column) {
            precise float dx = float(column) + 0.5 - x, dy = float(row) + 0.5 - y;
            const float key = key_at(splat, dx, dy);
            if (key > 0.0) raise(uint(column), uint(row), key, rank);
        }
}

void main() {
    const uvec4 chunk = rows[uint(first_chunk) + gl_WorkGroupID.y];
    const uint i = gl_GlobalInvocationID.x;
    if (i >= chunk.y) return;
    const uint at = 3u * chunk_points * chunk.x + i;
    const bool is_wide = (chunk.w & wide) != 0u;
    const vec3 d = vec3(difference(positions[at], 0, is_wide), difference(positions[at + chunk_points], 1, is_wide),
                        difference(positions[at + 2u * chunk_points], 2, is_wide));
    const float depth = transform(view.depth_row, d), across = transform(view.x_row, d), down = transform(view.y_row, d);
    if (!(depth >= view.near_depth)) return;
    Splat splat;
    if (view.perspective != 0) {
        precise float inverse = 1.0 / depth;
        precise float key = view.key_scale * inverse;
        precise vec2 center = vec2(view.center_px.x + across * inverse, view.center_px.y + down * inverse);
        splat.key = key;
        splat.center_px = center;
    } else {
        precise float key = view.key_offset + view.key_scale * depth;
        precise vec2 center = vec2(view.center_px.x + across, view.center_px.y + down);
        splat.key = max(key, least_key);
        splat.center_px = center;
    }
    if (!(splat.key > 0.0)) return;
    const uint rank = chunk.z + i;
    if (view.fixed_px > 0.0 && view.fixed_px <= 1.0) {
        const vec2 c = splat.center_px;
        if (c.x >= 0.0 && c.x < float(view.width) && c.y >= float(view.first_row) && c.y < float(view.first_row + view.row_count))
            raise(uint(int(c.x)), uint(int(c.y)), splat.key, rank);
        return;
    }
    splat.size_px = view.fixed_px;
    splat.slope = vec2(0.0);
    if (view.fixed_px <= 0.0) shape_splat(splat, shapes[chunk_points * chunk.x + i]);
    draw_splat(splat, rank);
}
