#version 450 core
// mesh.vert: corners of triangles that the CPU has rounded to 1/256 pixel; mesh.frag decides their depth.
// in      vertices: x, y and the bits of the key; three vertices a triangle
// blocks  as mesh_gl_pass.cpp binds them
// The viewport is so large, and its sides are such powers of two, that all coordinates stay exact and nothing is clipped. Triangles that
// reach beyond it, or have a corner that is not rounded, are moved away: the CPU draws them.

layout(std430, binding = 0) readonly buffer Vertices { int vertices[]; };
layout(std430, binding = 1) readonly buffer Corners { uint corners[]; };
layout(location = 0) uniform ivec2 middle;    // of the viewport, 1/256 pixel
layout(location = 1) uniform int reach;       // from there to its sides
layout(location = 2) uniform float per_unit;  // 1 / reach, a power of two
layout(location = 5) uniform float downwards; // the sign of y

const int unsnapped = -2147483647 - 1;

void main() {
    const uint own = uint(gl_VertexID), first = own - own % 3u;
    bool within = true;
    for (uint i = 0u; i < 3u; ++i) {
        const uint vertex = 3u * corners[first + i];
        const int x = vertices[vertex], y = vertices[vertex + 1u];
        within = within && x != unsnapped && abs(x - middle.x) <= reach && abs(y - middle.y) <= reach;
    }
    const uint vertex = 3u * corners[own];
    const vec2 place = vec2(ivec2(vertices[vertex], vertices[vertex + 1u]) - middle) * per_unit;
    gl_Position = within ? vec4(place.x, downwards * place.y, 0.5, 1.0) : vec4(4.0, 4.0, 4.0, 1.0);
}
