#version 450 core
// half_smooth.frag: one pass of an a-trous filter over the half surface: the 3 x 3 binomial with its samples apart_texels apart, of
//                   those on the same surface. depth_normals.cpp is its twin on the CPU and says what the constants mean.
#include "half_surface.glsl"
layout(location = 1) uniform int apart_texels;
layout(location = 0) out vec4 smoothed;

const float smooth_splats = 1.0, smooth_slope = 3.0;

void main() {
    const ivec2 p = ivec2(gl_FragCoord.xy);
    const vec3 own = surface_at(p);
    smoothed = vec4(own, 0.0);
    if (own.z <= 2.0 * float(apart_texels)) return;
    const float inverse = own.y / (smooth_splats * own.z + smooth_slope * 2.0 * float(apart_texels));
    float sum = 0.0, weights = 4.0;
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
            if (dx == 0 && dy == 0) continue;
            const float difference = nearness_at(p + apart_texels * ivec2(dx, dy)) - own.x;
            const float off = difference * inverse;
            const float weight = (dx == 0 || dy == 0 ? 2.0 : 1.0) * max(1.0 - off * off, 0.0);
            sum += weight * difference;
            weights += weight;
        }
    smoothed.x = own.x + sum / weights;
}
