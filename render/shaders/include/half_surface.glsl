// half_surface.glsl: what HalfSurface (render/pass/depth_normals.h) holds, a texel for each second pixel of each second row:
//                    nearness, px_per_nearness, splat_px. Beyond its borders there is nothing.
layout(binding = 0) uniform sampler2D surface;
layout(location = 0) uniform ivec2 half_size;  // texels that are filled

const float nothing = -1e12;  // the nearness there

bool is_inside(ivec2 p) { return all(greaterThanEqual(p, ivec2(0))) && all(lessThan(p, half_size)); }
vec3 surface_at(ivec2 p) { return is_inside(p) ? texelFetch(surface, p, 0).xyz : vec3(nothing, 0.0, 0.0); }
float nearness_at(ivec2 p) { return surface_at(p).x; }
