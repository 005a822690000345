#version 450 core
// fill.frag: closes gaps between the samples of a surface, looking along 8 lines from every pixel. fill_kernel.cpp is its twin
//            on the CPU, fill_criteria.h says what the constants mean.
// in      linear eye depth, infinite where nothing was drawn; colors in sRGB, alpha 0 where nothing was drawn; diameters of splats
// out     color as 8-bit sRGB, the bits of the depth, and the texel that gives splat and identity (x above y); the texel's own
//         where it is not filled
// rows    texture row 0 is the picture's, or lies beyond the reach of all rows that are wanted
layout(binding = 0) uniform sampler2D colors;
layout(binding = 1) uniform sampler2D depths;
layout(binding = 2) uniform sampler2D splats;      // diameters in px, over 255
layout(location = 0) uniform ivec2 size;           // texels that are filled
layout(location = 1) uniform vec2 pixel_world;     // a pixel covers pixel_world.x * depth + pixel_world.y world units
layout(location = 2) uniform float most_gap_px;
layout(location = 3) uniform bool follow_splats;   // no gap is wider than the splats beside it
layout(location = 4) uniform bool perspective;
layout(location = 0) out uvec4 filled;

const int lines = 8, least_lines = 5;
const ivec2 line_steps[lines] = ivec2[](ivec2(1, 0), ivec2(0, 1), ivec2(1, 1), ivec2(-1, 1),
                                        ivec2(2, 1), ivec2(-1, 2), ivec2(-2, 1), ivec2(1, 2));
const float line_lengths[lines] = float[](1.0, 1.0, 1.41421356, 1.41421356, 2.23606798, 2.23606798, 2.23606798, 2.23606798);
const float slanted_gap = 1.8125, least_gap = 2.25, hole_depth = 3.0, hole_slope = 2.0, same_depth = 2.0, steepest = 8.0;
const float support = 0.4, most_support = 8.0, rim_weight = 0.25, rough = 0.5, rough_slope = 0.25;

struct Side {
    int rim_steps, inner_steps;  // 0: nothing
    float depth, splat, inner_depth;
};

float unit(float depth) { return pixel_world.x * depth + pixel_world.y; }
float nearness(float depth) { return perspective ? 1.0 / depth : -depth; }
float gap_px(float splat) { return follow_splats ? min(most_gap_px, splat) : most_gap_px; }
float slanted_px(float gap) { return gap > 0.0 ? max(slanted_gap * gap, least_gap) : 0.0; }
float depth_at(ivec2 texel) { return texelFetch(depths, texel, 0).r; }
float splat_at(ivec2 texel) { return floor(texelFetch(splats, texel, 0).r * 255.0 + 0.5); }
bool is_inside(ivec2 texel) { return all(greaterThanEqual(texel, ivec2(0))) && all(lessThan(texel, size)); }

Side trace(ivec2 texel, float own_depth, float own_splat, ivec2 direction, float length_px, int steps) {
    Side side = Side(0, 0, 0.0, 0.0, 0.0);
    float before = own_depth;
    for (int k = 1; k <= steps; ++k) {
        const ivec2 q = texel + k * direction;
        if (!is_inside(q)) break;
        const float depth = depth_at(q);
        if (!(depth < before)) continue;
        const float splat = splat_at(q), u = unit(depth), distance_px = float(k) * length_px;
        if (distance_px > slanted_px(gap_px(splat))) continue;
        if (!(own_depth - depth > u * (hole_depth * max(splat, own_splat) + hole_slope * distance_px))) continue;
        if (side.rim_steps > 0 &&
            !(side.depth - depth > u * (hole_depth * splat + steepest * float(k - side.rim_steps) * length_px)))
            continue;
        const int deeper = max(1, int(min(support * splat, most_support) / length_px + 0.5));
        const ivec2 inner = texel + (k + deeper) * direction;
        if (!is_inside(inner)) continue;
        const float inner_depth = depth_at(inner);
        if (!(abs(inner_depth - depth) <= u * (same_depth * splat + steepest * float(deeper) * length_px))) continue;
        side = Side(k, k + deeper, depth, splat, inner_depth);
        before = depth;
    }
    return side;
}

#include "srgb.glsl"

void main() {
    const ivec2 texel = ivec2(gl_FragCoord.xy);
    const float own_depth = depth_at(texel), own_splat = splat_at(texel);
    filled = uvec4(packUnorm4x8(texelFetch(colors, texel, 0)), floatBitsToUint(own_depth), uint(texel.x) << 16 | uint(texel.y), 0);

    Side sides[2 * lines];
    int accepted = 0;
    bool narrow = false;
    for (int i = 0; i < lines; ++i) {
        const int steps = int(slanted_px(most_gap_px) / line_lengths[i]);
        Side a = trace(texel, own_depth, own_splat, line_steps[i], line_lengths[i], steps);
        Side b = Side(0, 0, 0.0, 0.0, 0.0);
        if (a.rim_steps > 0)
            b = trace(texel, own_depth, own_splat, -line_steps[i], line_lengths[i], min(steps, steps + 1 - a.rim_steps));
        const float gap = float(a.rim_steps + b.rim_steps - 1) * line_lengths[i], widest = gap_px(0.5 * (a.splat + b.splat));
        const float apart = unit(min(a.depth, b.depth)) * (same_depth * max(a.splat, b.splat) + steepest * gap);
        if (b.rim_steps == 0 || gap > slanted_px(widest) || !(abs(a.depth - b.depth) <= apart)) {
            a.rim_steps = 0;
            b.rim_steps = 0;
        } else {
            narrow = narrow || gap <= widest;
            ++accepted;
        }
        sides[2 * i] = a;
        sides[2 * i + 1] = b;
    }
    if (accepted < least_lines || !narrow) return;

    // The weighted least-squares plane of nearness, about its mean.
    float weights = 0.0, plane_weights = 0.0, splat = 0.0, nearest = 0.0, origin = 0.0;
    vec3 color = vec3(0.0), mean = vec3(0.0);
    ivec2 source = texel;
    for (int i = 0; i < 2 * lines; ++i) {
        if (sides[i].rim_steps == 0) continue;
        if (weights == 0.0) origin = nearness(sides[i].inner_depth);
        const ivec2 direction = (i % 2 == 0 ? 1 : -1) * line_steps[i / 2];
        const float distance_px = float(sides[i].rim_steps) * line_lengths[i / 2], weight = 1.0 / (distance_px * distance_px);
        mean += weight * vec3(sides[i].inner_steps * direction, nearness(sides[i].inner_depth) - origin) +
                rim_weight * weight * vec3(sides[i].rim_steps * direction, nearness(sides[i].depth) - origin);
        plane_weights += (1.0 + rim_weight) * weight;
        color += weight * linear_from_srgb(texelFetch(colors, texel + sides[i].rim_steps * direction, 0).rgb);
        splat += weight * sides[i].splat;
        weights += weight;
        if (weight > nearest) {
            nearest = weight;
            source = texel + sides[i].rim_steps * direction;
        }
    }
    mean /= plane_weights;
    float xx = 0.0, xy = 0.0, yy = 0.0, xf = 0.0, yf = 0.0, ff = 0.0;
    for (int i = 0; i < 2 * lines; ++i) {
        if (sides[i].rim_steps == 0) continue;
        const ivec2 direction = (i % 2 == 0 ? 1 : -1) * line_steps[i / 2];
        const float distance_px = float(sides[i].rim_steps) * line_lengths[i / 2], weight = 1.0 / (distance_px * distance_px);
        for (int part = 0; part < 2; ++part) {
            const vec3 d = (part == 0 ? vec3(sides[i].inner_steps * direction, nearness(sides[i].inner_depth) - origin)
                                      : vec3(sides[i].rim_steps * direction, nearness(sides[i].depth) - origin)) - mean;
            const float w = part == 0 ? weight : rim_weight * weight;
            xx += w * d.x * d.x, xy += w * d.x * d.y, yy += w * d.y * d.y;
            xf += w * d.x * d.z, yf += w * d.y * d.z, ff += w * d.z * d.z;
        }
    }
    const vec2 slope = vec2(xf * yy - yf * xy, yf * xx - xf * xy) / (xx * yy - xy * xy);
    const float at = origin + mean.z - dot(slope, mean.xy), depth = perspective ? 1.0 / at : -at;
    if (!(depth > 0.0) || isinf(depth)) return;
    const float off = sqrt(max(ff - slope.x * xf - slope.y * yf, 0.0) / plane_weights);
    const float depth_per_nearness = perspective ? depth * depth : 1.0, u = unit(depth);
    if (off * depth_per_nearness > u * (splat / weights) * (rough + rough_slope * length(slope) * depth_per_nearness / u)) return;
    filled.x = packUnorm4x8(vec4(srgb_from_linear(color / weights), texelFetch(colors, source, 0).a));
    filled.y = floatBitsToUint(depth);
    filled.z = uint(source.x) << 16 | uint(source.y);
}
