#version 450 core
// edl.frag: eye-dome lighting. A pixel is darker the farther it lies behind its neighbors, as slopes in the world:
//           the response does not change with resolution, distance or projection.
// in      linear eye depth, infinite where nothing was drawn; colors in sRGB, alpha 0 where nothing was drawn
// out     sRGB, alpha kept
// rows    texture row 0 is picture row first_row: texels outside of the filled ones are outside of the picture
// source  C. Boucheny, "Visualisation scientifique de grands volumes de donnees", thesis, 2009; the response is ours
layout(binding = 0) uniform sampler2D colors;
layout(binding = 1) uniform sampler2D depths;
layout(binding = 2) uniform sampler2D splats;        // diameters in px, over 255
layout(location = 0) uniform ivec2 size;             // texels that are filled
layout(location = 1) uniform vec2 pixel_world;       // a pixel covers pixel_world.x * depth + pixel_world.y world units
layout(location = 2) uniform float strength;         // optical depth per unit of mean slope
layout(location = 3) uniform ivec3 least_reach_px;   // to neighbors along the axes, for each scale
layout(location = 4) uniform float most_response;    // a jump in depth darkens no more than this slope
layout(location = 5) uniform bool follow_splats;     // neighbors lie a splat's diameter away where that is farther
layout(location = 0) out vec4 color_out;

// How much steeper than the texel's own place its neighbor rises towards the viewer.
float slope_to(ivec2 neighbor, float length_px, float depth, float unit) {
    return (depth - texelFetch(depths, neighbor, 0).r) / (length_px * unit);
}

bool outside(ivec2 texel) { return any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, size)); }

// Of the neighbors on opposite sides: the sum of their responses, and how many they are. One that is outside is what the other
// says of a level slope through both; a jump says nothing.
vec2 pair_response(ivec2 texel, ivec2 step_px, float depth, float unit) {
    const bool no_a = outside(texel - step_px), no_b = outside(texel + step_px);
    if (no_a && no_b) return vec2(0.0);
    const float length_px = length(vec2(step_px));
    const float a = no_a ? 0.0 : slope_to(texel - step_px, length_px, depth, unit);
    const float b = no_b ? 0.0 : slope_to(texel + step_px, length_px, depth, unit);
    const float seen_a = no_a ? (-b <= most_response ? -b : 0.0) : a;
    const float seen_b = no_b ? (-a <= most_response ? -a : 0.0) : b;
    return vec2(clamp(seen_a, 0.0, most_response) + clamp(seen_b, 0.0, most_response), 2.0);
}

#include "srgb.glsl"

void main() {
    const ivec2 texel = ivec2(gl_FragCoord.xy);
    const vec4 color = texelFetch(colors, texel, 0);
    const float depth = texelFetch(depths, texel, 0).r;
    if (isinf(depth)) {
        color_out = color;
        return;
    }
    const float unit = pixel_world.x * depth + pixel_world.y;
    const int splat = follow_splats ? int(texelFetch(splats, texel, 0).r * 255.0 + 0.5) : 0;
    vec2 sum = vec2(0.0);  // of responses, and how many
    for (int scale = 0; scale < 3; ++scale) {
        const int a = max(least_reach_px[scale], splat);
        const int d = max(int(float(a) * 0.70710678 + 0.5), 1);
        sum += pair_response(texel, ivec2(a, 0), depth, unit) + pair_response(texel, ivec2(0, a), depth, unit);
        sum += pair_response(texel, ivec2(d, d), depth, unit) + pair_response(texel, ivec2(d, -d), depth, unit);
    }
    const float shade = exp(-strength * sum.x / max(sum.y, 1.0));
    color_out = vec4(srgb_from_linear(linear_from_srgb(color.rgb) * shade), color.a);
}
