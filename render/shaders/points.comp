#version 450 core
// points.comp: rasterizes points into a word a pixel, depth key above the complement of the rank, as points_kernel.cpp does.
//              Run once for the keys and, when all are there, once for the ranks: atomics of 64 bits would do both at once. For
//              Gaussian splats run once more, for the light that blend_kernel.cpp adds up.
// in      quanta of points, what they stand for, normals and colors, in chunks; a work group's row says which chunk, and up to where
// out     words: [2 i + 1] key bits of pixel i, [2 i] complement of the rank; the largest win
// source  the order of operations is point_block.h's: sums, products and conversions round alike everywhere, and only division
//         and square root may be off by an ulp or two, where GL computes them so
layout(local_size_x = 256) in;

const uint chunk_points = 2048;  // PointPool::kChunkPoints
const uint wide = 1;             // row flag: differences to the eye need 64 bits
const int square = 0, disc = 1, surfel = 4;  // SplatShape; else a paraboloid, Gaussian ones too
const int keys = 0, ranks = 1, light = 2;    // stages
const float least_key = 7.888609052210118e-31;  // 0x1p-100
const float most_slope = 4.0, most_surfel_slope = 1000.0, surfel_reach = 2.0, least_round = 0.75;
const float full_weight = 4096.0;  // LightSum

layout(std430, binding = 0) readonly buffer Positions { int positions[]; };  // x of a chunk, then y, then z
layout(std430, binding = 1) readonly buffer Shapes { uvec2 shapes[]; };      // bits of the spacing, bytes of the normal
layout(std430, binding = 2) readonly buffer Rows { uvec4 rows[]; };          // chunk, points in it, rank of its first, flags
layout(std430, binding = 3) buffer Words { uint words[]; };
layout(std430, binding = 4) readonly buffer Normals { uint normals[]; };     // three bytes a point
layout(std430, binding = 5) readonly buffer Colors { uint colors[]; };
layout(std430, binding = 6) buffer Sums { uint sums[]; };                    // a LightSum a pixel, by halves

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

layout(std140, binding = 1) uniform Lights { uvec4 lights[64]; };  // of color codes

layout(location = 0) uniform int first_chunk;  // of the rows, that this dispatch draws
layout(location = 1) uniform int stage;

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
    if (stage == ranks) {
        if (words[at + 1u] == bits && words[at] < ~rank) atomicMax(words[at], ~rank);
    } else if (words[at + 1u] < bits) {
        atomicMax(words[at + 1u], bits);
    }
}

struct Splat {
    vec2 center_px;
    float key, size_px;
    vec2 low_px, high_px;  // how far it reaches from its center
    vec2 slope;            // how much farther the surface lies a pixel to the right, and one down, in px
};

float dot_rows(vec4 axis, vec3 n) {
    precise float sum = axis.x * n.x + axis.y * n.y + axis.z * n.z;
    return sum;
}

float adaptive_size(float spacing, float key) {
    precise float size = view.size_scale * spacing;
    if (view.perspective != 0) {
        precise float share = key * view.inverse_key_scale;
        size *= share;
    }
    return min(max(size, view.least_px), view.most_px);
}

vec2 tilt(vec2 center_px, vec3 n, float steepest) {
    const float right = dot_rows(view.right, n), down = dot_rows(view.down, n);
    precise float along = dot_rows(view.forward, n);
    if (view.perspective != 0) {
        precise float aside = right * (center_px.x - view.center_px.x) + down * (center_px.y - view.center_px.y);
        precise float leaning = along + aside * view.inverse_unit;
        along = leaning;
    }
    precise float across = sqrt(right * right + down * down);
    precise float divisor = max(abs(along), max(across * (1.0 / steepest), 1e-6));
    precise float scale = 1.0 / divisor;
    scale = along > 0.0 ? -scale : scale;
    precise vec2 slope = vec2(right * scale, down * scale);
    return slope;
}

// How far a surfel reaches to the lower and to the higher side along an axis of the picture.
vec2 surfel_extent(vec4 axis, float position_px, vec3 n, float unit, float forward, float radius) {
    const bool perspective = view.perspective != 0;
    precise float angle = perspective ? radius * view.inverse_unit : 0.0;
    precise float divisor = max(1.0 - angle * angle * (1.0 - forward * forward), 0.25), inverse = 1.0 / divisor;
    precise float aside = perspective ? position_px * view.inverse_unit : 0.0;
    precise float m = unit * dot_rows(axis, n) - aside * forward;
    precise float shift = -radius * angle * (aside + m * forward);
    precise float square_half = shift * shift + divisor * radius * radius * (1.0 + aside * aside - m * m);
    precise float side = sqrt(max(square_half, 0.0));
    precise float low = (side + shift) * inverse, high = (side - shift) * inverse;
    return min(max(vec2(low, high), 0.5), surfel_reach * radius);
}

void shape_surfel(inout Splat splat, vec3 n) {
    splat.slope = tilt(splat.center_px, n, most_surfel_slope);
    const float radius = 0.5 * splat.size_px;
    if (!(radius > least_round)) return;
    precise float square = n.x * n.x + n.y * n.y + n.z * n.z;
    precise float root = sqrt(square), inverse = 1.0 / root;
    const float unit = square > 0.0 ? inverse : 0.0;
    precise float facing = unit * dot_rows(view.forward, n);
    const float forward = square > 0.0 ? facing : 1.0;
    precise vec2 position_px = splat.center_px - view.center_px;
    const vec2 across = surfel_extent(view.right, position_px.x, n, unit, forward, radius);
    const vec2 down = surfel_extent(view.down, position_px.y, n, unit, forward, radius);
    splat.low_px = vec2(across.x, down.x);
    splat.high_px = vec2(across.y, down.y);
}

vec3 bytes_of(uint word) {
    const int bytes = int(word);
    return vec3(bitfieldExtract(bytes, 0, 8), bitfieldExtract(bytes, 8, 8), bitfieldExtract(bytes, 16, 8));
}

vec3 normal_of(uint point) {
    const uint at = 3u * point, word = at >> 2, shift = 8u * (at & 3u);
    const uint low = normals[word] >> shift;
    return bytes_of(shift > 8u ? low | normals[word + 1u] << (32u - shift) : low);
}

struct Hit {
    float key;     // 0: not covered
    float square;  // of the distance from the center in its plane, in radii
};

// What a splat is a way beside its center.
Hit hit_at(Splat splat, float x, float y) {
    if (view.shape == square) return Hit(splat.key, 0.0);
    precise float radius = 0.5 * splat.size_px;
    precise float inverse_square = 1.0 / (radius * radius);
    const bool is_round = radius > least_round;
    if (view.shape == disc) {
        precise float share = (x * x + y * y) * inverse_square;
        return Hit(share <= 1.0 || !is_round ? splat.key : 0.0, share);
    }
    precise float rise = splat.slope.x * x + splat.slope.y * y;
    const bool perspective = view.perspective != 0;
    if (view.shape == surfel) {
        precise float nearness = perspective ? 1.0 - rise * view.inverse_unit : 1.0;
        precise float across = x, down = y;
        if (perspective) {
            across = x + rise * ((splat.center_px.x - view.center_px.x) * view.inverse_unit);
            down = y + rise * ((splat.center_px.y - view.center_px.y) * view.inverse_unit);
        }
        precise float distance_square = across * across + down * down + rise * rise, limit = radius * nearness, limit_square = limit * limit;
        const bool inside = nearness > 0.0 && distance_square <= limit_square;
        const bool own = x > -0.5 && x <= 0.5 && y > -0.5 && y <= 0.5;
        precise float within = (inside ? rise : min(max(rise, -radius), radius)) * view.inverse_unit;
        precise float on_plane = perspective ? splat.key - splat.key * within : splat.key + view.key_scale * within;
        return Hit(inside || own || !is_round ? max(on_plane, least_key) : 0.0, 0.0);
    }
    precise float share = (x * x + y * y + rise * rise) * inverse_square;
    precise float fall = min(radius * view.inverse_unit, 0.5) * share;
    precise float behind;
    if (perspective) {
        precise float on_plane = splat.key - splat.key * (rise * view.inverse_unit);
        behind = on_plane - on_plane * fall;
    } else {
        precise float on_plane = splat.key + view.key_scale * (rise * view.inverse_unit);
        behind = on_plane + view.key_scale * fall;
    }
    if (!is_round) return Hit(splat.key, share);
    return Hit(share <= 1.0 ? max(behind, least_key) : 0.0, share);
}

// e^(-4 square), times the full weight: as blend_kernel.cpp has it.
uint weight_of(float square) {
    precise float y = 0.5 * square;
    precise float eighth = 1.0 - y * (1.0 - y * (0.5 - y * (1.0 / 6.0 - y * (1.0 / 24.0 - y * (1.0 / 120.0)))));
    precise float quarter = eighth * eighth, half_way = quarter * quarter;
    precise float weight = half_way * half_way * full_weight + 0.5;
    return uint(int(weight));
}

// Whether depth(key) <= depth(front) + radius, without a division.
bool shows(Splat splat, float key, float front) {
    precise float angle = 0.5 * splat.size_px * view.inverse_unit;
    precise float left, right;
    if (view.perspective != 0) {
        left = front * splat.key;
        right = key * (splat.key + angle * front);
    } else {
        left = front - key;
        right = -view.key_scale * angle;
    }
    return left <= right;
}

// To a sum of 64 bits.
void add(uint at, uint value) {
    const uint before = atomicAdd(sums[at], value);
    if (before + value < before) atomicAdd(sums[at + 1u], 1u);
}

void blend(Splat splat, Hit hit, uint column, uint row, uint color) {
    const uint pixel = (row - view.first_row) * view.stride + column;
    if (!shows(splat, hit.key, uintBitsToFloat(words[2u * pixel + 1u]))) return;
    const uint weight = weight_of(min(hit.square, 1.0));
    for (uint channel = 0u; channel < 3u; ++channel) {
        const uint code = color >> (8u * channel) & 255u;
        add(8u * pixel + 2u * channel, weight * lights[code >> 2][code & 3u]);
    }
    add(8u * pixel + 6u, weight);
}

void draw_splat(Splat splat, uint rank, uint color) {
    const float width = float(view.width), top = float(view.first_row), bottom = float(view.first_row + view.row_count);
    precise float x = splat.center_px.x, y = splat.center_px.y;
    precise float left = max(x + (0.5 - splat.low_px.x), 0.0), right = min(x + (0.5 + splat.high_px.x), width);
    precise float above = max(y + (0.5 - splat.low_px.y), top), below = min(y + (0.5 + splat.high_px.y), bottom);
    if (!(left < right && above < below)) return;
    const int first_column = int(left), columns = int(right), end_row = int(below);
    for (int row = int(above); row < end_row; ++row)
        for (int column = first_column; column < columns; ++column) {
            precise float dx = float(column) + 0.5 - x, dy = float(row) + 0.5 - y;
            const Hit hit = hit_at(splat, dx, dy);
            if (!(hit.key > 0.0)) continue;
            if (stage == light)
                blend(splat, hit, uint(column), uint(row), color);
            else
                raise(uint(column), uint(row), hit.key, rank);
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
    if (view.fixed_px > 0.0 && view.fixed_px <= 1.0 && stage != light) {
        const vec2 c = splat.center_px;
        if (c.x >= 0.0 && c.x < float(view.width) && c.y >= float(view.first_row) && c.y < float(view.first_row + view.row_count))
            raise(uint(int(c.x)), uint(int(c.y)), splat.key, rank);
        return;
    }
    const uint point = chunk_points * chunk.x + i;
    splat.size_px = view.fixed_px;
    splat.slope = vec2(0.0);
    if (view.fixed_px <= 0.0) {
        const uvec2 shape = shapes[point];
        splat.size_px = adaptive_size(uintBitsToFloat(shape.x), splat.key);
        splat.slope = tilt(splat.center_px, bytes_of(shape.y), most_slope);
    }
    splat.low_px = splat.high_px = vec2(0.5 * splat.size_px);
    if (view.shape == surfel) shape_surfel(splat, normal_of(point));
    draw_splat(splat, rank, stage == light ? colors[point] : 0u);
}
