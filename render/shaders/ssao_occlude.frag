#version 450 core
// ssao_occlude.frag: visibility of the sky from each texel of the half surface, between the horizons of two slices.
//                    ssao_kernel.cpp is its twin on the CPU and says what the constants mean.
// in      directions [step, 4 * phase + direction]: offset in texels, its length in pixels; in column `steps` the direction itself
// out     visibility
// source  J. Jimenez et al., "Practical Realtime Strategies for Accurate Indirect Occlusion", 2016
#include "half_surface.glsl"
layout(binding = 1) uniform sampler2D slopes;
layout(binding = 2) uniform sampler2D directions;
layout(location = 1) uniform vec2 pixel_world;
layout(location = 2) uniform bool perspective;
layout(location = 3) uniform float radius;         // world units
layout(location = 4) uniform float most_radius_px;
layout(location = 5) uniform int first_half_row;   // of the whole picture
layout(location = 6) uniform ivec2 picture_size;
layout(location = 0) out vec4 visibility;

const int steps = 10, phases = 4;
const float full_radius = 0.6, relief = 0.05, splat_relief = 0.05, half_pi = 1.57079632679;

float light(float horizon, float cosine, float sine) {
    const float square = 1.0 / (1.0 + horizon * horizon);
    const float cos_double = (horizon * horizon - 1.0) * square, sin_double = 2.0 * horizon * square;
    return 0.25 * (cosine - cos_double * cosine - sin_double * sine + 2.0 * (half_pi - atan(horizon)) * sine);
}

void main() {
    const ivec2 p = ivec2(gl_FragCoord.xy);
    const vec3 own = surface_at(p);
    const vec2 slope = texelFetch(slopes, p, 0).xy;
    const float least = relief + splat_relief * own.z;
    const float unit = perspective ? pixel_world.x / own.x : pixel_world.y;
    const float radius_px = min(abs(radius / unit), most_radius_px), inverse_square = 1.0 / (radius_px * radius_px);
    const float fade = 1.0 / (1.0 - full_radius * full_radius);
    const int half_row = first_half_row + p.y, phase = half_row % phases;

    float highest[4] = float[](0.0, 0.0, 0.0, 0.0);
    for (int i = 0; i < 4; ++i)
        for (int k = 0; k < steps; ++k) {
            const vec3 offset = texelFetch(directions, ivec2(k, 4 * phase + i), 0).xyz;
            const ivec2 to = ivec2(offset.xy);
            const float height = own.y * (nearness_at(p + to) - own.x);
            const float over = height - dot(slope, 2.0 * offset.xy) - least;
            const float weight = clamp(fade * (1.0 - (height * height + offset.z * offset.z) * inverse_square), 0.0, 1.0);
            highest[i] = max(highest[i], over / offset.z * weight);
        }

    const vec2 ray_xy = perspective ? pixel_world.x * (vec2(2 * ivec2(p.x, half_row)) + 0.5 - 0.5 * vec2(picture_size)) : vec2(0.0);
    const float ray = 1.0 + dot(ray_xy, ray_xy), ray_length = sqrt(ray);
    float got = 0.0, open = 0.0;
    for (int slice = 0; slice < 2; ++slice) {
        const vec2 axis = texelFetch(directions, ivec2(steps, 4 * phase + 2 * slice), 0).xy;
        const float along = dot(axis, ray_xy), scale = ray_length / sqrt(1.0 - along * along / ray);
        const float tangent = scale * (dot(axis, slope) - along / ray);
        const float weight = sqrt(1.0 + tangent * tangent), cosine = 1.0 / weight, sine = -tangent * cosine;
        got += weight * (light(tangent + scale * highest[2 * slice], cosine, sine) +
                         light(-tangent + scale * highest[2 * slice + 1], cosine, -sine));
        open += weight * (light(tangent, cosine, sine) + light(-tangent, cosine, -sine));
    }
    visibility = vec4(clamp(got / open, 0.0, 1.0));
}
