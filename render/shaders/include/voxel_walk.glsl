// voxel_walk.glsl: the first cell that stops a ray. ray_walk.h is its twin, operation for operation, and says why.
// needs  voxel_nodes.glsl
const int max_levels = 10;
const int inside = 6;                           // CellFace
const double infinity = 1.7976931348623157e308lf;  // the largest number serves as well
const double least_step = 1.1830521861667747e-271lf;  // 2^-900

struct Ray {
    dvec3 origin, direction;
};

// Components by number: there are compilers that read those of doubles, and arrays of doubles, as floats.
double at(dvec3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }
bool is_set(int axes, int axis) { return (axes >> axis & 1) != 0; }

struct Event {
    double t;
    int axis;
};

struct Walk {
    dvec3 plane_origin, plane_scale, place_origin, place_step;
    int forward, still;  // a bit an axis
    double place_error, start_t, most_t;
};

struct NodePath {
    uint nodes[max_levels];
    int level;
    ivec3 voxel;
};

struct Hit {
    double t;
    ivec3 cell;
    int depth;  // 0: nothing
    int face, level, bit;
    uint node;
};

int frame_side() { return 1 << 2 * view.levels; }

bool comes_before(Event a, Event b) { return a.t < b.t || (a.t == b.t && a.axis < b.axis); }

double plane_t(Walk walk, int axis, double plane) {
    precise double t = (plane - at(walk.plane_origin, axis)) * at(walk.plane_scale, axis);
    return t;
}

Event entry_of(Walk walk, ivec3 cell, int shift) {
    Event last = Event(-infinity, 0);
    for (int a = 0; a < 3; ++a) {
        if (is_set(walk.still, a)) continue;
        const Event event = Event(plane_t(walk, a, double((cell[a] + (is_set(walk.forward, a) ? 0 : 1)) << shift)), a);
        if (comes_before(last, event)) last = event;
    }
    return last;
}

int coordinate_by_planes(Walk walk, int axis, Event event, int low, int high) {
    if (is_set(walk.still, axis)) return int(at(walk.place_origin, axis));
    while (low < high) {
        if (is_set(walk.forward, axis)) {
            const int middle = low + (high - low + 1) / 2;
            if (comes_before(Event(plane_t(walk, axis, double(middle)), axis), event))
                low = middle;
            else
                high = middle - 1;
        } else {
            const int middle = low + (high - low) / 2;
            if (comes_before(Event(plane_t(walk, axis, double(middle + 1)), axis), event))
                high = middle;
            else
                low = middle + 1;
        }
    }
    return low;
}

int coordinate_after(Walk walk, int axis, Event event, int low, int high) {
    precise double place = at(walk.place_origin, axis) + event.t * at(walk.place_step, axis);
    if (place > double(low) && place < double(high) + 1.0lf) {
        const int whole = int(place);
        precise double part = place - double(whole);
        if (part > walk.place_error && part < 1.0lf - walk.place_error) return whole;
    }
    return coordinate_by_planes(walk, axis, event, low, high);
}

int bits_of(bvec3 axes) { return (axes.x ? 1 : 0) | (axes.y ? 2 : 0) | (axes.z ? 4 : 0); }

bool prepare_walk(Ray ray, double least_t, double most_t, out Walk walk) {
    const double side = double(frame_side());
    const bvec3 still = lessThan(abs(ray.direction), dvec3(least_step));
    const bvec3 outside = not(bvec3(ivec3(greaterThanEqual(ray.origin, dvec3(0.0lf))) & ivec3(lessThan(ray.origin, dvec3(side)))));
    walk.still = bits_of(still);
    if ((walk.still & bits_of(outside)) != 0) return false;
    walk.forward = bits_of(greaterThan(ray.direction, dvec3(0.0lf)));
    precise dvec3 scale = 1.0lf / ray.direction;
    walk.plane_origin = mix(ray.origin, dvec3(-infinity), still);
    walk.plane_scale = mix(scale, dvec3(1.0lf), still);
    walk.place_origin = mix(ray.origin, floor(ray.origin) + 0.5lf, still);
    walk.place_step = mix(ray.direction, dvec3(0.0lf), still);
    const dvec3 reach = abs(ray.origin);
    walk.place_error = max(max(side, reach.x), max(reach.y, reach.z)) * 1.7763568394002505e-15lf;  // 2 * 2^-50
    walk.start_t = max(least_t, 0.0lf);
    walk.most_t = most_t;
    return true;
}

bool enter_cube(Walk walk, out Event start, out ivec3 voxel) {
    Event leaving = Event(infinity, 3);
    start = Event(walk.start_t, 3);
    int plane = 0;
    for (int a = 0; a < 3; ++a) {
        if (is_set(walk.still, a)) continue;
        const Event low = Event(plane_t(walk, a, 0.0lf), a), high = Event(plane_t(walk, a, double(frame_side())), a);
        Event enters = low, leaves = high;
        if (!is_set(walk.forward, a)) {
            enters = high;
            leaves = low;
        }
        if (comes_before(start, enters)) {
            start = enters;
            plane = is_set(walk.forward, a) ? 0 : frame_side();
        }
        if (comes_before(leaves, leaving)) leaving = leaves;
    }
    if (comes_before(leaving, start) || !(start.t <= walk.most_t)) return false;
    int place[3];
    for (int a = 0; a < 3; ++a)
        place[a] = a == start.axis ? plane + (is_set(walk.forward, a) ? 0 : -1) : coordinate_after(walk, a, start, 0, frame_side() - 1);
    voxel = ivec3(place[0], place[1], place[2]);
    return true;
}

// The ray may have entered the cell before it came to where it is now.
bool is_small(Walk walk, ivec3 voxel, int shift, double t) {
    const double cell_side = double(1 << shift);
    precise double here = view.spread * t + view.footprint;
    if (!(cell_side <= here)) return false;
    precise double there = view.spread * max(walk.start_t, entry_of(walk, voxel >> shift, shift).t) + view.footprint;
    return cell_side <= there;
}

int stop(Walk walk, NodePath path, int shift, int bit, out Hit hit) {
    hit.cell = path.voxel >> shift;
    hit.depth = 2 * view.levels - shift;
    hit.level = path.level;
    hit.node = path.nodes[path.level];
    hit.bit = bit;
    const Event entered = entry_of(walk, hit.cell, shift);
    const bool starts_inside = entered.t < walk.start_t;
    hit.t = starts_inside ? walk.start_t : entered.t;
    hit.face = starts_inside ? inside : 2 * entered.axis + (is_set(walk.forward, entered.axis) ? 0 : 1);
    return -1;
}

// returns  s where the ray may skip the empty cell of side 2^s, -1 where it is stopped
int look(Walk walk, double t, inout NodePath path, out Hit hit) {
    const int signs = (walk.forward & 1) << 2 | (walk.forward & 2) | (walk.forward & 4) >> 2;
    for (;;) {
        const int level = path.level;
        const uint node = path.nodes[level];
        const uvec2 mask = mask_at(level, node);
        const int shift = 2 * (view.levels - 1 - level);
        const int bit = bit_of(path.voxel, shift);
        const bool occupied = has_bit(mask, bit), octant = octant_byte(mask, bit) != 0u;
        const bool whole = occupied && has_bit(full_at(level, node), bit);
        // Cells that may stop the ray, from the octant down.
        const int least = !octant ? shift + 2 : !occupied ? shift + 1 : whole ? 0 : shift;
        int part = shift + 1;
        while (part >= least && part > 0 && !is_small(walk, path.voxel, part, t)) --part;
        if (part >= least) return stop(walk, path, part, bit, hit);
        if (!occupied) {
            const uint word = ahead_table + 2u * uint(signs * 64 + bit);
            return ((mask.x & tables[word]) | (mask.y & tables[word + 1u])) == 0u ? shift + 2 : octant ? shift : shift + 1;
        }
        if (level + 1 == view.node_levels) return stop(walk, path, shift, bit, hit);
        path.nodes[level + 1] = child_at(level, node, bit);
        path.level = level + 1;
    }
}

Hit first_hit(Ray ray, double least_t, double most_t) {
    Hit hit;
    hit.depth = 0;
    Walk walk;
    Event start;
    NodePath path;
    if (!prepare_walk(ray, least_t, most_t, walk) || !enter_cube(walk, start, path.voxel)) return hit;
    path.nodes[0] = 0u;
    path.level = 0;
    double t = start.t;
    for (;;) {
        const int shift = look(walk, t, path, hit);
        if (shift < 0) return hit;
        const int size = 1 << shift;
        const ivec3 low = path.voxel & -size;
        int plane[3];
        int axis = 0;
        t = infinity;
        for (int a = 0; a < 3; ++a) {
            plane[a] = low[a] + (is_set(walk.forward, a) ? size : 0);
            const double there = plane_t(walk, a, double(plane[a]));
            if (there < t) {
                t = there;
                axis = a;
            }
        }
        hit.depth = 0;
        if (!(t <= walk.most_t)) return hit;
        int place[3];
        for (int a = 0; a < 3; ++a)
            place[a] = a == axis ? plane[a] + (is_set(walk.forward, a) ? 0 : -1) : coordinate_after(walk, a, Event(t, axis), low[a], low[a] + size - 1);
        const ivec3 next = ivec3(place[0], place[1], place[2]);
        const ivec3 differs = path.voxel ^ next;
        const uint changed = uint(differs.x | differs.y | differs.z);
        if (changed >= uint(frame_side())) return hit;
        path.level = min(path.level, view.levels - 1 - findMSB(changed | 1u) / 2);
        path.voxel = next;
    }
}
