#version 450 core
// half_slope.frag: slopes of the half surface, to the side that extrapolates better: over an edge it does not.
//                  depth_normals.cpp is its twin on the CPU and says what the constants mean.
// out     heights for each pixel of the whole picture to the right and downwards
#include "half_surface.glsl"
layout(location = 0) out vec4 slopes;

const float soft = 1e-2, most_error = 8.0;

float slope(ivec2 p, ivec2 to) {
    const vec2 own = surface_at(p).xy;
    const float a = nearness_at(p - to), b = nearness_at(p + to);
    const float before = (own.x - a) * own.y, after = (b - own.x) * own.y;
    const float error_a = before - (a - nearness_at(p - 2 * to)) * own.y;
    const float error_b = (nearness_at(p + 2 * to) - b) * own.y - after;
    const float square_a = error_a * error_a, square_b = error_b * error_b, most = most_error * most_error;
    const float weight_a = square_a < most ? min(square_b, most) + soft : 0.0;
    const float weight_b = square_b < most ? min(square_a, most) + soft : 0.0;
    return 0.5 * (weight_a * before + weight_b * after) / max(weight_a + weight_b, soft);
}

void main() {
    const ivec2 p = ivec2(gl_FragCoord.xy);
    slopes = vec4(slope(p, ivec2(1, 0)), slope(p, ivec2(0, 1)), 0.0, 0.0);
}
