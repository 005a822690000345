#version 450 core
// voxels.comp: the first cell of a voxel tree on the ray of each pixel, lit. voxels_kernel.cpp is its twin and says what constants mean:
//              rays are the same in every bit but for divisions, which GL may round otherwise; colors may differ by a step or two.
// in      the tree and its attributes; tables: cells ahead, what light makes of colors, the color map
// out     pixels: five words each: color; slot | splat_px << 16 | depth in the tree << 24, 0: nothing; node; eye depth of the cell; that of the surface it stands for
// source  ray_walk.h
layout(local_size_x = 8, local_size_y = 8) in;

// Mirrored by VoxelsGlPass.
layout(std140, binding = 0) uniform View {
    dvec4 origin, origin_per_x, origin_per_y, direction, direction_per_x, direction_per_y;  // xyz: of rays, in voxels
    dvec4 towards_eye;                      // xyz
    double least_t, spread, footprint;      // where rays begin; cells no larger stop them
    double pixel_spread, pixel_footprint;   // voxels a pixel
    double elevation_origin, voxel_size, range_low, range_extent;
    int levels, node_levels, keeping, removing;  // of frame and tree; clip boxes
    uint width, first_row, row_count, has_full;
    int rule, smooth_shading;               // VoxelColors::Rule
    uint has_attributes, has_normals;
    uint y_upwards;                         // 0: z is
    uvec4 first_rows[3];                    // of levels, in Nodes
    uvec4 first_attributes[6];              // of depths, in Attributes; none: all bits
    uvec4 first_normals[6];                 // in Normals
} view;

layout(std430, binding = 3) readonly buffer Attributes { uint attributes[]; };  // colors by three bytes or counts, of one depth after another
layout(std430, binding = 4) readonly buffer Normals { uint normals[]; };        // by three bytes
layout(std430, binding = 5) readonly buffer Tables { uint tables[]; };
layout(std430, binding = 7) writeonly buffer Pixels { uint pixels[]; };

const uint ahead_table = 0u, light_table = 1024u, color_table = light_table + 16384u;
const uint unknown_color = 0xff808080u;
const uint none = ~0u;
const int rule_rgb = 1, rule_elevation = 2, rule_count = 3, rule_normal = 4, rule_level = 5;

#include "voxel_nodes.glsl"
#include "voxel_walk.glsl"
#include "voxel_clip.glsl"

const float level_light = 0.675;
const float line_width = 1.0, line_darkness = 0.3, least_lined = 4.0, whole_lined = 16.0;
const double surface_radius = 4.0lf, distant_radius = 2.5lf, stand_back = 0.25lf;
const float least_cube = 2.0, whole_cube = 4.0, distant_relief = 2.0;
const double most_smoothed = 1.5lf;

// As sky_light.h.
float sky_light(vec3 normal) { return level_light + dot(view.y_upwards != 0u ? vec3(0.057, 0.325, 0.191) : vec3(0.057, -0.191, 0.325), normal); }

vec3 face_normal(int face) {
    return vec3(equal(ivec3(face / 2), ivec3(0, 1, 2))) * ((face & 1) == 0 ? -1.0 : 1.0);
}

uint byte_of(uint word, uint place) { return word >> 8u * place & 255u; }

uint lit(uint color, float light) {
    const uint row = light_table + 64u * uint(clamp(light, 0.0, 1.0) * 255.0 + 0.5);
    uint dimmed = color & 0xff000000u;
    for (uint channel = 0u; channel < 3u; ++channel) {
        const uint code = byte_of(color, channel);
        dimmed |= byte_of(tables[row + (code >> 2)], code & 3u) << 8u * channel;
    }
    return dimmed;
}

double side_of(Hit hit) { return double(1 << (2 * view.levels - hit.depth)); }

// The depth that a hit's attributes belong to.
int attribute_depth(Hit hit) { return 2 * hit.level + (hit.depth == 2 * hit.level + 1 ? 1 : 2); }
uint entry_of(Hit hit) { return cell_index(hit.level, hit.node, hit.bit, hit.depth == 2 * hit.level + 1); }

uint three_bytes(uint first, uint word_low, uint word_high) {
    const uint shift = 8u * (first & 3u);
    return (shift == 0u ? word_low : word_low >> shift | word_high << (32u - shift)) & 0xffffffu;
}

vec3 stored_normal(Hit hit) {
    if (view.has_normals == 0u) return vec3(0.0);
    const int depth = attribute_depth(hit);
    const uint first = view.first_normals[depth >> 2][depth & 3];
    if (first == none) return vec3(0.0);
    const uint entry = entry_of(hit), byte = 3u * entry, word = first + (byte >> 2);
    const uint bytes = three_bytes(byte, normals[word], normals[word + 1u]);
    return vec3(int(bytes << 24) >> 24, int(bytes << 16) >> 24, int(bytes << 8) >> 24);
}

uint ramp(double value) {
    const double place = view.range_extent == 0.0lf ? 0.5lf : (value - view.range_low) / view.range_extent;
    return tables[color_table + uint(clamp(place, 0.0lf, 1.0lf) * 1023.0lf + 0.5lf)];
}

uint color_of(Hit hit, vec3 normal) {
    if (view.rule == rule_normal) {
        const uvec3 code = uvec3(floor(255.0 * clamp(0.5 + 0.5 * normal, 0.0, 1.0) + 0.5));
        return code.x | code.y << 8 | code.z << 16 | 0xff000000u;
    }
    if (view.rule == rule_level) return tables[color_table + uint(hit.depth)];
    if (view.rule == rule_elevation) return ramp(view.elevation_origin + view.voxel_size * side_of(hit) * (double(hit.cell.z) + 0.5lf));
    if (view.rule != rule_rgb && view.rule != rule_count) return tables[color_table];
    if (view.has_attributes == 0u) return unknown_color;
    const int depth = attribute_depth(hit);
    const uint first = view.first_attributes[depth >> 2][depth & 3];
    if (first == none) return unknown_color;
    const uint entry = entry_of(hit);
    if (view.rule == rule_rgb) {
        const uint byte = 3u * entry, word = first + (byte >> 2);
        return three_bytes(byte, attributes[word], attributes[word + 1u]) | 0xff000000u;
    }
    const uint count = attributes[first + entry];
    if (count == 0u) return unknown_color;
    return ramp(double(log(float(count)) - 1.3862943611198906 * float(2 * view.levels - depth)));  // four times as many in cells twice as large
}

// Of the cells around a hit, asked some way before it.
vec3 rise_before(Ray ray, Hit hit, double radius) {
    const dvec3 ahead = dvec3(normalize(vec3(ray.direction)));
    return rise_over_cells(hit.depth, (ray.origin + hit.t * ray.direction) / side_of(hit) - stand_back * radius * ahead, radius);
}

struct Smooth {
    vec3 normal;
    double t;
};

Smooth smooth_at(Ray ray, Hit hit, int face, vec3 rise) {
    const vec3 direction = normalize(vec3(ray.direction));
    vec3 normal = stored_normal(hit);
    if (normal == vec3(0.0)) normal = rise;
    if (normal == vec3(0.0)) return Smooth(face_normal(face), hit.t);
    if (dot(normal, direction) > 0.0) normal = -normal;
    normal = normalize(normal);
    const double fall = double(-dot(normal, direction)), above = double(dot(normal, rise)) - 0.5lf - stand_back * surface_radius * fall;
    const double farther = clamp(above / max(fall, 1e-6lf), -most_smoothed, most_smoothed) * side_of(hit) / length(ray.direction);
    return Smooth(normal, max(hit.t + farther, view.least_t));
}

float distant_light(Ray ray, vec3 rise, vec3 face_up) {
    if (rise == vec3(0.0)) return sky_light(face_up);
    const vec3 normal = normalize(rise);
    return sky_light(dot(normal, vec3(ray.direction)) > 0.0 ? -normal : normal);
}

// How much of a pixel the border of a cell's face covers.
float border_cover(Ray ray, Hit hit, int face_axis, double side) {
    const dvec3 direction = ray.direction, p = (ray.origin + hit.t * direction) / side;
    const dvec3 move_x = view.origin_per_x.xyz + hit.t * view.direction_per_x.xyz, move_y = view.origin_per_y.xyz + hit.t * view.direction_per_y.xyz;
    // What the next pixels, to the right and below, see of the face's plane: cells.
    const dvec3 facing = dvec3(equal(ivec3(face_axis), ivec3(0, 1, 2)));
    const double fall = dot(facing, direction);
    const vec3 across_x = vec3((move_x - direction * (dot(facing, move_x) / fall)) / side), across_y = vec3((move_y - direction * (dot(facing, move_y) / fall)) / side);
    const vec3 places = vec3(fract(p));
    float cover = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        if (axis == face_axis) continue;
        const float side_px = 1.0 / length(vec2(across_x[axis], across_y[axis]));
        const float strength = clamp((side_px - least_lined) / (whole_lined - least_lined), 0.0, 1.0);
        if (!(strength > 0.0)) continue;
        const float place = places[axis];
        cover = max(cover, strength * clamp(0.5 * line_width + 0.5 - min(place, 1.0 - place) * side_px, 0.0, 1.0));
    }
    return cover;
}

uint slot_of(Hit hit, int face) {
    const bool octant = hit.depth == 2 * hit.level + 1;
    return ((uint(hit.level) << 1 | (octant ? 1u : 0u)) << 6 | uint(octant ? hit.bit & 56 : hit.bit)) << 3 | uint(face);
}

void shade(Ray ray, Hit hit, int face, uint first_word) {
    const double side = side_of(hit);
    const bool cut = hit.face == inside, flat_shading = view.smooth_shading == 0 || cut;
    const vec3 face_up = face == inside ? vec3(view.towards_eye.xyz) : face_normal(face);
    const float side_px = float(side / (view.pixel_spread * hit.t + view.pixel_footprint));
    const float distant = flat_shading && !cut ? clamp((whole_cube - side_px) / (whole_cube - least_cube), 0.0, 1.0) : 0.0;
    vec3 rise = vec3(0.0);
    if (!flat_shading || (distant > 0.0 && view.rule != rule_normal)) rise = rise_before(ray, hit, flat_shading ? distant_radius : surface_radius);
    Smooth surface = Smooth(face_up, hit.t);
    if (!flat_shading) surface = smooth_at(ray, hit, face, rise);
    uint color = color_of(hit, surface.normal);
    if (view.rule != rule_normal) {
        float light = sky_light(surface.normal);
        if (distant > 0.0) light += distant * (distant_light(ray, rise, surface.normal) - light);
        if (flat_shading && face != inside && side_px > least_lined) light *= 1.0 - line_darkness * border_cover(ray, hit, face / 2, side);
        color = lit(color, light);
    }
    const uint splat_px = uint(clamp(flat_shading ? 1.5 + distant * (distant_relief * side_px - 1.0) : side_px + 0.5, 1.0, 255.0));
    pixels[first_word] = color;
    pixels[first_word + 1u] = slot_of(hit, face) | splat_px << 16 | uint(hit.depth) << 24;
    pixels[first_word + 2u] = hit.node;
    pixels[first_word + 3u] = floatBitsToUint(float(hit.t));
    pixels[first_word + 4u] = floatBitsToUint(float(surface.t));
}

void main() {
    const uvec2 at = gl_GlobalInvocationID.xy;
    if (at.x >= view.width || at.y >= view.row_count) return;
    const double x = double(at.x), y = double(view.first_row + at.y);
    // Sums that are exact.
    const Ray ray = Ray(view.origin.xyz + x * view.origin_per_x.xyz + y * view.origin_per_y.xyz,
                        view.direction.xyz + x * view.direction_per_x.xyz + y * view.direction_per_y.xyz);
    int face;
    const Hit hit = first_hit_left(ray, view.least_t, face);
    const uint first_word = 5u * (at.y * view.width + at.x);
    if (hit.depth == 0)
        pixels[first_word + 1u] = 0u;
    else
        shade(ray, hit, face, first_word);
}
