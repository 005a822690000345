#version 450 core
// edl.frag: eye-dome lighting. A pixel is darker the farther it lies behind its neighbours, as slopes in the world:
//           the response does not change with resolution, distance or projection.
// in      linear eye depth, infinite where nothing was drawn; colors in sRGB, alpha 0 where nothing was drawn
// out     sRGB, alpha kept
// rows    texture row 0 is picture row first_row: neighbours beyond the picture's own edges count as level ground
// source  C. Boucheny, "Visualisation scientifique de grands volumes de donnees", thesis, 2009; the response is ours
layout(binding = 0) uniform sampler2D colors;
layout(binding = 1) uniform sampler2D depths;
layout(binding = 2) uniform sampler2D splats;        // diameters in px, over 255
layout(location = 0) uniform ivec2 size;             // texels that are filled
layout(location = 1) uniform vec2 pixel_world;       // a pixel covers pixel_world.x * depth + pixel_world.y world units
layout(location = 2) uniform float strength;         // optical depth per unit of mean slope
layout(location = 3) uniform int least_reach_px;     // to neighbours along the axes
layout(location = 4) uniform float most_response;    // a jump in depth darkens no more than this slope
layout(location = 5) uniform bool follow_splats;     // neighbours lie a splat's diameter away where that is farther
layout(location = 0) out vec4 color_out;

float slope_to(ivec2 texel, ivec2 step_px, float depth, float unit) {
    const ivec2 neighbor = texel + step_px;
    if (any(lessThan(neighbor, ivec2(0))) || any(greaterThanEqual(neighbor, size))) return 0.0;
    const float nearer = depth - texelFetch(depths, neighbor, 0).r;
    return clamp(nearer / (length(vec2(step_px)) * unit), 0.0, most_response);
}

vec3 linear_from_srgb(vec3 c) {
    return mix(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, lessThanEqual(c, vec3(0.04045)));
}
vec3 srgb_from_linear(vec3 c) {
    return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

void main() {
    const ivec2 texel = ivec2(gl_FragCoord.xy);
    const vec4 color = texelFetch(colors, texel, 0);
    const float depth = texelFetch(depths, texel, 0).r;
    if (isinf(depth)) {
        color_out = color;
        return;
    }
    const float unit = pixel_world.x * depth + pixel_world.y;
    int a = least_reach_px;
    if (follow_splats) a = max(a, int(texelFetch(splats, texel, 0).r * 255.0 + 0.5));
    const int d = max(int(float(a) * 0.70710678 + 0.5), 1);
    float sum = slope_to(texel, ivec2(a, 0), depth, unit) + slope_to(texel, ivec2(-a, 0), depth, unit);
    sum += slope_to(texel, ivec2(0, a), depth, unit) + slope_to(texel, ivec2(0, -a), depth, unit);
    sum += slope_to(texel, ivec2(d, d), depth, unit) + slope_to(texel, ivec2(-d, -d), depth, unit);
    sum += slope_to(texel, ivec2(d, -d), depth, unit) + slope_to(texel, ivec2(-d, d), depth, unit);
    const float shade = exp(-strength * sum / 8.0);
    color_out = vec4(srgb_from_linear(linear_from_srgb(color.rgb) * shade), color.a);
}
