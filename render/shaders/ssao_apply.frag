#version 450 core
// ssao_apply.frag: dims each pixel by the visibility of the samples around it that lie on its surface.
//                  ssao_kernel.cpp is its twin on the CPU.
// in      linear eye depth, infinite where nothing was drawn; colors in sRGB, alpha 0 where nothing was drawn; diameters of splats
// out     sRGB, alpha kept
#include "half_surface.glsl"
#include "srgb.glsl"
layout(binding = 1) uniform sampler2D slopes;
layout(binding = 2) uniform sampler2D visibility;
layout(binding = 3) uniform sampler2D colors;
layout(binding = 4) uniform sampler2D depths;
layout(binding = 5) uniform sampler2D splats;      // diameters in px, over 255
layout(location = 1) uniform bool perspective;
layout(location = 2) uniform int first_row;        // of the picture that texture row 0 is
layout(location = 3) uniform int first_half_row;
layout(location = 0) out vec4 color_out;

const float blur_depth = 2.0, blur_splats = 1.0, no_sample = 1e15;

void main() {
    const ivec2 texel = ivec2(gl_FragCoord.xy);
    color_out = texelFetch(colors, texel, 0);
    const float depth = texelFetch(depths, texel, 0).r;
    if (isinf(depth)) return;
    const float nearness = perspective ? 1.0 / depth : -depth;
    const float inverse = 1.0 / (blur_depth + blur_splats * floor(texelFetch(splats, texel, 0).r * 255.0 + 0.5));
    const ivec2 place = ivec2(texel.x, first_row + texel.y), odd = place % 2;  // in the whole picture
    float sum = 0.0, weights = 0.0, least = no_sample, nearest = 1.0;
    for (int below = 0; below <= odd.y; ++below)
        for (int right = 0; right <= odd.x; ++right) {
            const ivec2 p = place / 2 - ivec2(0, first_half_row) + ivec2(right, below);
            if (!is_inside(p)) continue;
            const vec3 there = surface_at(p);
            if (there.x == nothing) continue;
            const vec2 slope = texelFetch(slopes, p, 0).xy;
            const float height = there.y * (nearness - there.x) - dot(slope, vec2(odd - 2 * ivec2(right, below)));
            const float off = abs(height * inverse), weight = max(1.0 - off * off, 0.0), open = texelFetch(visibility, p, 0).r;
            sum += weight * open;
            weights += weight;
            if (off < least) {
                least = off;
                nearest = open;
            }
        }
    const float seen = floor((weights > 0.0 ? sum / weights : nearest) * 255.0 + 0.5) / 255.0;
    color_out.rgb = srgb_from_linear(linear_from_srgb(color_out.rgb) * seen);
}
