#version 450 core
// half_sample.frag: every second pixel of every second row of a G-buffer as nearness. depth_normals.cpp is its twin on the CPU.
// in      linear eye depth, infinite where nothing was drawn; diameters of splats
// out     a texel of half_surface.glsl
layout(binding = 4) uniform sampler2D depths;
layout(binding = 5) uniform sampler2D splats;     // diameters in px, over 255
layout(location = 0) uniform int first_row;       // of the texture that is sampled: that which is even in the whole picture
layout(location = 1) uniform vec2 pixel_world;    // a pixel covers pixel_world.x * depth + pixel_world.y world units
layout(location = 2) uniform bool perspective;
layout(location = 0) out vec4 sampled;

void main() {
    const ivec2 texel = 2 * ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    const float depth = texelFetch(depths, texel, 0).r;
    const bool empty = isinf(depth);
    sampled.x = empty ? -1e12 : perspective ? 1.0 / depth : -depth;
    sampled.y = empty ? 0.0 : perspective ? depth / pixel_world.x : 1.0 / pixel_world.y;
    sampled.z = floor(texelFetch(splats, texel, 0).r * 255.0 + 0.5);
    sampled.w = 0.0;
}
