#version 450 core
// ssao_blur.frag: mean of the visibility in the rows above and below, in which each phase has the same weight, and of the
//                 columns beside, as far as they lie on the texel's plane. ssao_kernel.cpp is its twin on the CPU.
#include "half_surface.glsl"
layout(binding = 1) uniform sampler2D slopes;
layout(binding = 2) uniform sampler2D visibility;
layout(location = 0) out vec4 blurred;

const int blur_rows = 2;
const float blur_depth = 2.0, blur_splats = 1.0;

void main() {
    const ivec2 p = ivec2(gl_FragCoord.xy);
    const vec3 own = surface_at(p);
    const vec2 slope = texelFetch(slopes, p, 0).xy;
    float sum = 0.0, weights = 0.0;
    for (int dy = -blur_rows; dy <= blur_rows; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
            const ivec2 q = p + ivec2(dx, dy);
            if (!is_inside(q)) continue;
            const float height = own.y * (nearness_at(q) - own.x) - dot(slope, 2.0 * vec2(dx, dy));
            const float off = height / (blur_depth + blur_splats * own.z);
            const float share = (abs(dy) == blur_rows ? 0.5 : 1.0) * (dx == 0 ? 2.0 : 1.0), weight = share * max(1.0 - off * off, 0.0);
            sum += weight * texelFetch(visibility, q, 0).r;
            weights += weight;
        }
    blurred = vec4(sum / (weights > 0.0 ? weights : 1.0));
}
