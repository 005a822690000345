#version 450 core
// mesh.frag: the word of a pixel, key above the complement of the triangle's number, as the kernels of mesh_kernel.h leave it: the same operations in
// the same order, in double precision.
// out     low half, high half
// depth   the key: reversed, the greater one stays, of equal ones that which is drawn first

layout(std430, binding = 0) readonly buffer Vertices { int vertices[]; };
layout(std430, binding = 1) readonly buffer Corners { uint corners[]; };
layout(location = 3) uniform int first_row;   // of the picture, that the framebuffer begins with
layout(location = 4) uniform int first_triangle;
layout(location = 0) out uvec2 word;

const int small_side = 8, small_px = 32;

struct Vertex {
    int x, y;
    float key;
};

Vertex vertex_of(uint corner) {
    const uint at = 3u * corners[corner];
    return Vertex(vertices[at], vertices[at + 1u], intBitsToFloat(vertices[at + 2u]));
}

int weight(Vertex from, Vertex to, ivec2 center) {
    return (to.x - from.x) * (center.y - from.y) - (to.y - from.y) * (center.x - from.x);
}

int centers(int least, int most) { return ((most - 128) >> 8) - ((least + 127) >> 8) + 1; }

float key_of_small(Vertex a, Vertex b, Vertex c, ivec2 pixel) {
    const int area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    const ivec2 center = 256 * pixel + 128;
    precise double inverse = 1.0lf / double(area);
    precise double sum = double(weight(b, c, center)) * double(a.key) + double(weight(c, a, center)) * double(b.key) + double(weight(a, b, center)) * double(c.key);
    precise double key = sum * inverse;
    return float(key);
}

float key_of_large(Vertex a, Vertex b, Vertex c, double area, ivec2 pixel) {
    precise double k0 = double(a.key), k1 = double(b.key) - k0, k2 = double(c.key) - k0;
    precise double x1 = double(b.x - a.x), y1 = double(b.y - a.y), x2 = double(c.x - a.x), y2 = double(c.y - a.y);
    precise double per_x = (k1 * y2 - k2 * y1) / area, per_y = (k2 * x1 - k1 * x2) / area;
    precise double base = k0 + double(128 - a.x) * per_x + double(128 - a.y) * per_y;
    precise double per_column = per_x * 256.0lf, per_row = per_y * 256.0lf;
    precise double row_key = base + double(pixel.y) * per_row;
    precise double key = row_key + double(pixel.x) * per_column;
    const float least = min(min(a.key, b.key), c.key), most = max(max(a.key, b.key), c.key);
    return float(key < double(least) ? double(least) : key > double(most) ? double(most) : key);
}

void main() {
    const uint number = uint(first_triangle + gl_PrimitiveID);
    Vertex a = vertex_of(3u * number), b = vertex_of(3u * number + 1u), c = vertex_of(3u * number + 2u);
    precise double area = double(b.x - a.x) * double(c.y - a.y) - double(b.y - a.y) * double(c.x - a.x);
    if (area < 0.0lf) {
        const Vertex other = b;
        b = c;
        c = other;
        area = -area;
    }
    const int columns = centers(min(min(a.x, b.x), c.x), max(max(a.x, b.x), c.x)), rows = centers(min(min(a.y, b.y), c.y), max(max(a.y, b.y), c.y));
    const bool is_small = columns <= small_side && rows <= small_side && columns * rows <= small_px;
    const ivec2 pixel = ivec2(gl_FragCoord.xy) + ivec2(0, first_row);
    const float key = is_small ? key_of_small(a, b, c, pixel) : key_of_large(a, b, c, area, pixel);
    word = uvec2(~number, floatBitsToUint(key));
    gl_FragDepth = key;
}
