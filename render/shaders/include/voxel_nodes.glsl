// voxel_nodes.glsl: a VoxelTree, and which of its cells are occupied. 64-bit masks are halves, the low one first.
// voxel_tree.h and voxel_coverage.cpp are its twins.
layout(std430, binding = 0) readonly buffer Nodes { uvec4 nodes[]; };  // mask, first child, even cells before; levels from the root
layout(std430, binding = 1) readonly buffer Full { uvec2 full[]; };    // full masks, where there are any
layout(std430, binding = 2) readonly buffer Odd { uint odd_before[]; };  // odd cells before, where there are attributes

const uvec2 full_mask = uvec2(~0u);

struct CellBlock {
    int depth;
    ivec3 place;  // 4^3 cells, in units of its own side
};

uvec2 bits_below(int bit) { return bit < 32 ? uvec2((1u << bit) - 1u, 0u) : uvec2(~0u, (1u << (bit - 32)) - 1u); }
bool has_bit(uvec2 mask, int bit) { return (((bit & 32) != 0 ? mask.y : mask.x) >> (bit & 31) & 1u) != 0u; }
uint octant_byte(uvec2 mask, int bit) { return ((bit & 32) != 0 ? mask.y : mask.x) >> (bit & 24) & 255u; }
uint bits_set(uvec2 mask) { return uint(bitCount(mask.x) + bitCount(mask.y)); }

uint row_of(int level, uint node) { return view.first_rows[level >> 2][level & 3] + node; }
uvec2 mask_at(int level, uint node) { return nodes[row_of(level, node)].xy; }
uvec2 full_at(int level, uint node) { return view.has_full != 0u ? full[row_of(level, node)] : uvec2(0u); }
uint child_at(int level, uint node, int bit) {
    const uvec4 row = nodes[row_of(level, node)];
    return row.z + bits_set(row.xy & ~full_at(level, node) & bits_below(bit));
}

// The bit of the cell of side 2^shift that holds a voxel.
int bit_of(ivec3 voxel, int shift) {
    const ivec3 two = voxel >> shift & 3;
    const ivec3 digit = (two & 2) << 2 | (two & 1);
    return digit.x << 2 | digit.y << 1 | digit.z;
}
ivec3 cell_of_bit(int bit) {
    return ivec3(bit >> 4 & 2 | bit >> 2 & 1, bit >> 3 & 2 | bit >> 1 & 1, bit >> 2 & 2 | bit & 1);
}

// Bit k is set where byte k of the mask is not 0.
uint bytes_present(uvec2 mask) {
    uint present = 0u;
    for (int k = 0; k < 8; ++k) present |= octant_byte(mask, 8 * k) != 0u ? 1u << k : 0u;
    return present;
}

// Index among the cells of its depth.
uint cell_index(int level, uint node, int bit, bool odd) {
    const uvec4 row = nodes[row_of(level, node)];
    if (odd) return odd_before[row_of(level, node)] + uint(bitCount(bytes_present(row.xy) & ((1u << (bit >> 3)) - 1u)));
    return row.w + bits_set(row.xy & bits_below(bit));
}

uvec2 node_mask(int level, ivec3 place) {
    uint node = 0u;
    for (int number = 0; number < level; ++number) {
        const int bit = bit_of(place, 2 * (level - 1 - number));
        if (!has_bit(mask_at(number, node), bit)) return uvec2(0u);
        if (number + 1 == view.node_levels || has_bit(full_at(number, node), bit)) return full_mask;
        node = child_at(number, node, bit);
    }
    return mask_at(level, node);
}

// The cells of a block; beyond the frame they are empty.
uvec2 cells_of(CellBlock block) {
    const int blocks = block.depth < 2 ? 1 : 1 << (block.depth - 2);
    if (any(lessThan(block.place, ivec3(0))) || any(greaterThanEqual(block.place, ivec3(blocks)))) return uvec2(0u);
    if ((block.depth & 1) == 0) return node_mask((block.depth - 2) / 2, block.place);
    // The octants of eight nodes, of one where there is no more.
    uvec2 mask = uvec2(0u);
    for (int octant = 0; octant < (block.depth == 1 ? 1 : 8); ++octant) {
        const uint present = bytes_present(node_mask((block.depth - 1) / 2, 2 * block.place + ivec3(octant >> 2, octant >> 1 & 1, octant & 1)));
        if (octant < 4)
            mask.x |= present << 8 * octant;
        else
            mask.y |= present << 8 * (octant - 4);
    }
    return mask;
}

void add_cells(uint half_mask, int first_bit, vec3 place, float inverse_square, inout vec4 sums) {
    for (; half_mask != 0u; half_mask &= half_mask - 1u) {
        precise vec3 d = place - vec3(cell_of_bit(first_bit + findLSB(half_mask)));
        precise float weight = max(1.0 - (d.x * d.x + d.y * d.y + d.z * d.z) * inverse_square, 0.0);
        precise vec4 sum = sums + vec4(weight * d, weight);
        sums = sum;
    }
}

// From the middle of the occupied cells around p, weighted, to p; zero where there are none.
vec3 rise_over_cells(int depth, dvec3 p, double radius) {
    const float inverse_square = float(1.0lf / (radius * radius));
    const ivec3 first = ivec3(floor(p - radius + 0.5lf)) >> 2, last = (ivec3(ceil(p + radius - 0.5lf)) - 1) >> 2;
    vec4 sums = vec4(0.0);
    for (int x = first.x; x <= last.x; ++x)
        for (int y = first.y; y <= last.y; ++y)
            for (int z = first.z; z <= last.z; ++z) {
                const vec3 place = vec3(p - dvec3(4 * ivec3(x, y, z)) - 0.5lf);
                const vec3 off = max(max(-place, place - 3.0), 0.0);
                if (dot(off, off) * inverse_square >= 1.0) continue;
                const uvec2 mask = cells_of(CellBlock(depth, ivec3(x, y, z)));
                add_cells(mask.x, 0, place, inverse_square, sums);
                add_cells(mask.y, 32, place, inverse_square, sums);
            }
    return sums.w > 0.0 ? sums.xyz / sums.w : vec3(0.0);
}
