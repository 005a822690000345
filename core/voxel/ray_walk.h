#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/voxel/ray_cast.h"

// The traversal that ray casting is made of, for whatever holds nodes of 4^3 masks.
//
// A ray crosses the planes between voxels. Where it crosses plane i of an axis is one expression, plane_t, at every depth and from
// wherever the ray comes; it never decreases along the ray. So the crossings of the three axes, merged by t and, where t is the
// same, by axis, are one sequence: the walk. What cell the ray is in after a crossing is a matter of comparing numbers of
// that sequence, and skipping a large empty cell leads exactly to where all steps through its voxels would have led.

namespace strata {

/// A crossing, or a place in the sequence of them: after all crossings of lower t, and of lower axis at the same t.
struct RayEvent {
    double t = 0.0;
    int axis = 3;  // 3: after all at this t
};

inline bool operator<(const RayEvent& a, const RayEvent& b) { return a.t < b.t || (a.t == b.t && a.axis < b.axis); }

// Four numbers at once: x, y, z and one that never counts.
using Quad = double __attribute__((vector_size(32)));
using IntQuad = int32_t __attribute__((vector_size(16)));

/// A ray made ready to walk a cube of 4^levels voxels an axis.
struct RayWalk {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    Quad plane_origin, plane_scale;  // of an axis that the ray does not move along every plane is at infinity
    Quad place_origin, place_step;   // where it is; on such an axis in the middle of its voxel
    IntQuad forward;                 // all bits set where coordinates grow along the ray
    std::array<bool, 3> still;       // does not move along this axis
    double place_error;              // place_origin + t * place_step is off by less, inside the cube
    double t_scale;                  // t here = t of the caller * t_scale, a power of 2
    double start_t, most_t, spread, footprint;
    uint32_t side;

    double plane_t(int axis, double plane) const { return (plane - plane_origin[axis]) * plane_scale[axis]; }

    /// Where the ray enters the cell of side 2^shift at coordinates in those units.
    RayEvent entry(const std::array<uint32_t, 3>& cell, int shift) const {
        RayEvent last = {-kInfinity, 0};
        for (int a = 0; a < 3; ++a) {
            if (still[size_t(a)]) continue;
            const RayEvent event = {plane_t(a, (cell[size_t(a)] + (forward[a] ? 0 : 1)) << shift), a};
            if (last < event) last = event;
        }
        return last;
    }

    /// Where the ray leaves the cell of this side from `low` on, in which it is.
    RayEvent exit(const std::array<int32_t, 3>& low, int32_t cell_side) const {
        RayEvent first = {kInfinity, 0};
        for (int a = 0; a < 3; ++a) {
            const double t = plane_t(a, low[size_t(a)] + (forward[a] & cell_side));
            if (t < first.t) first = {t, a};
        }
        return first;
    }

    /// The coordinate after an event, known to be in [low, high], by asking the planes between.
    uint32_t coordinate_by_planes(int axis, const RayEvent& event, uint32_t low, uint32_t high) const {
        if (still[size_t(axis)]) return uint32_t(place_origin[axis]);
        while (low < high) {
            if (forward[axis]) {
                const uint32_t middle = low + (high - low + 1) / 2;
                if (RayEvent{plane_t(axis, middle), axis} < event) low = middle;
                else high = middle - 1;
            } else {
                const uint32_t middle = low + (high - low) / 2;
                if (RayEvent{plane_t(axis, middle + 1), axis} < event) high = middle;
                else low = middle + 1;
            }
        }
        return low;
    }

    /// The same; by where the ray is at that t, where this can tell.
    uint32_t coordinate_after(int axis, const RayEvent& event, uint32_t low, uint32_t high) const {
        const double place = place_origin[axis] + event.t * place_step[axis];
        if (place > low && place < high + 1.0) {
            const auto whole = uint32_t(place);
            const double part = place - whole;
            if (part > place_error && part < 1.0 - place_error) return whole;
        }
        return coordinate_by_planes(axis, event, low, high);
    }
};

/// returns  false where the ray hits nothing, whatever there is
inline bool prepare_walk(const VoxelFrame& frame, const VoxelRay& ray, const RayLimits& limits, RayWalk& walk) {
    const double longest = std::max({std::abs(ray.direction[0]), std::abs(ray.direction[1]), std::abs(ray.direction[2])});
    double reach = 0.0;
    bool finite = longest > 0.0 && longest < RayWalk::kInfinity;
    for (int a = 0; a < 3; ++a) {
        reach = std::max(reach, std::abs(ray.origin[a]));
        finite = finite && std::abs(ray.origin[a]) < RayWalk::kInfinity && std::abs(ray.direction[a]) < RayWalk::kInfinity;
    }
    if (!finite) return false;
    const int exponent = longest < 0x1p-100 || longest > 0x1p100 ? std::ilogb(longest) : 0;  // else t might overflow
    walk.side = frame.side();
    reach = std::max(reach, double(walk.side));
    walk.plane_origin[3] = -RayWalk::kInfinity;
    walk.plane_scale[3] = 1.0;
    walk.place_origin[3] = 0.5;
    walk.place_step[3] = 0.0;
    walk.forward[3] = 0;
    for (int a = 0; a < 3; ++a) {
        const double step = exponent ? std::scalbn(ray.direction[a], -exponent) : ray.direction[a];
        const double origin = ray.origin[a];
        walk.forward[a] = step > 0.0 ? -1 : 0;
        // Would take longer to a plane than any other axis through all, and the inverse might be infinite.
        const bool still = std::abs(step) < 0x1p-900;
        walk.still[size_t(a)] = still;
        if (still && !(origin >= 0.0 && origin < walk.side)) return false;
        walk.plane_origin[a] = still ? -RayWalk::kInfinity : origin;
        walk.plane_scale[a] = still ? 1.0 : 1.0 / step;
        walk.place_origin[a] = still ? int32_t(origin) + 0.5 : origin;
        walk.place_step[a] = still ? 0.0 : step;
    }
    // t is off by less than 3 roundings of 2^-53 of itself, so t * step by as much of |origin| + side, and two more roundings.
    walk.place_error = 2.0 * reach * 0x1p-50;
    walk.t_scale = exponent ? std::scalbn(1.0, exponent) : 1.0;
    walk.start_t = limits.least_t > 0.0 ? limits.least_t * walk.t_scale : 0.0;
    walk.most_t = limits.most_t * walk.t_scale;
    walk.spread = limits.spread / walk.t_scale;
    walk.footprint = limits.footprint;
    return true;
}

/// The start of a walk: the voxel after an event.
struct WalkStart {
    RayEvent event;
    IntQuad voxel = {};
};

/// Where the ray enters the cube, or starts in it. returns  false where it does neither.
/// axis, plane  the start lies no earlier than the crossing of this plane; axis 3: no such plane
inline bool enter_cube(const RayWalk& walk, int axis, int32_t plane, WalkStart& start) {
    RayEvent in = {walk.start_t, 3}, out = {RayWalk::kInfinity, 3};
    if (axis < 3) {
        const RayEvent given = {walk.plane_t(axis, plane), axis};
        if (in < given) in = given;
    }
    for (int a = 0; a < 3; ++a) {
        if (walk.still[size_t(a)]) continue;
        const RayEvent low = {walk.plane_t(a, 0.0), a}, high = {walk.plane_t(a, walk.side), a};
        const RayEvent& enters = walk.forward[a] ? low : high;
        const RayEvent& leaves = walk.forward[a] ? high : low;
        if (in < enters) {
            in = enters;
            plane = walk.forward[a] ? 0 : int32_t(walk.side);
        }
        if (leaves < out) out = leaves;
    }
    if (out < in || !(in.t <= walk.most_t)) return false;
    start.event = in;
    for (int a = 0; a < 3; ++a)
        start.voxel[a] = a == in.axis ? plane + (walk.forward[a] ? 0 : -1) : int32_t(walk.coordinate_after(a, in, 0, walk.side - 1));
    return true;
}

/// Bits of a mask's cells that lie at and beyond one, for a ray that goes up (bit 4 of the octant: x, 2: y, 1: z) or down along each
/// axis; [0] the cells themselves, [1] those whose octants do.
using CellsAhead = std::array<std::array<uint64_t, 64>, 8>;
inline constexpr std::array<CellsAhead, 2> kCellsAhead = [] {
    std::array<CellsAhead, 2> table{};
    for (uint32_t coarse = 0; coarse < 2; ++coarse)
        for (uint32_t signs = 0; signs < 8; ++signs)
            for (uint64_t from = 0; from < 64; ++from)
                for (uint64_t to = 0; to < 64; ++to) {
                    const auto p = coordinates_of_code(from), q = coordinates_of_code(to);
                    bool ahead = true;
                    for (uint32_t a = 0; a < 3; ++a)
                        ahead = ahead && ((signs >> (2 - a) & 1) ? q[a] >> coarse >= p[a] >> coarse : q[a] >> coarse <= p[a] >> coarse);
                    if (ahead) table[coarse][signs][from] |= uint64_t{1} << to;
                }
    return table;
}();

/// mask_bit of cells of side 2^shift.
inline int bit_of(const std::array<int32_t, 3>& voxel, int shift) {
    const auto digit = [&](size_t a) {
        const int two = voxel[a] >> shift & 3;
        return (two & 2) << 2 | (two & 1);
    };
    return digit(0) << 2 | digit(1) << 1 | digit(2);
}

/// The way to a node: those from the root to `level`, and a voxel in it.
struct NodePath {
    std::array<uint32_t, kMostVoxelLevels> nodes = {};
    int level = 0;
    std::array<int32_t, 3> voxel = {};

    /// Back to the lowest node that holds another voxel too. changed  the bits in which coordinates differ
    void turn(int levels, uint32_t changed) { level = std::min(level, levels - 1 - (int(std::bit_width(changed | 1)) - 1) / 2); }
    void turn_to(int levels, const IntQuad& to) {
        turn(levels, uint32_t((voxel[0] ^ to[0]) | (voxel[1] ^ to[1]) | (voxel[2] ^ to[2])));
        voxel = {to[0], to[1], to[2]};
    }
};

/// What there is where a ray is.
/// Nodes  levels(), mask(level, node), full_mask(level, node), child(level, node, bit)
template <class Nodes>
class VoxelLook {
public:
    using Hit = VoxelHit;

    VoxelLook(const Nodes& nodes, const VoxelFrame& frame, const RayLimits& limits)
        : nodes_(nodes),
          levels_(frame.levels),
          node_levels_(nodes.levels()),
          most_depth_(std::clamp(limits.depth, 1, frame.depth())),
          pixels_stop_(limits.spread > 0.0 || limits.footprint > 0.0),
          ahead_(kCellsAhead[most_depth_ % 2 != 0 || pixels_stop_]) {}

    int levels() const { return levels_; }

    /// Before the walk of a ray.
    void begin(const VoxelRay&) const {}

    /// Back to a node of which no cell above may stop this ray: the path may be another's.
    /// t  of the event by which the ray comes to the path's voxel
    void restart(const RayWalk& walk, double t, NodePath& path) const {
        if (!pixels_stop_) return;
        const double small_side = walk.spread * t + walk.footprint;
        while (path.level > 0 && double(uint32_t{1} << 2 * (levels_ - path.level)) <= small_side) --path.level;
    }

    /// Goes down from the path's node to the smallest cell that is known at its voxel.
    /// t  of the event by which the ray came to the voxel
    /// returns  s where the ray may skip the empty cell of side 2^s, -1 where it is stopped: `hit`
    int look(const RayWalk& walk, double t, NodePath& path, VoxelHit& hit) const {
        const auto& ahead = ahead_[size_t((walk.forward[0] & 4) | (walk.forward[1] & 2) | (walk.forward[2] & 1))];
        for (;;) {
            const int level = path.level;
            const uint32_t node = path.nodes[size_t(level)];
            const uint64_t mask = nodes_.mask(level, node);
            const int shift = 2 * (levels_ - 1 - level);
            const int bit = bit_of(path.voxel, shift);
            if ((mask >> bit & 1) == 0) {
                const bool octant = (mask >> (bit & 56) & 255) != 0;
                if (octant && (most_depth_ <= 2 * level + 1 || (pixels_stop_ && is_small(walk, path, shift + 1, t))))
                    return stop(walk, path, shift + 1, bit, hit);
                return (mask & ahead[size_t(bit)]) == 0 ? shift + 2 : octant ? shift : shift + 1;
            }
            if (most_depth_ <= 2 * level + 1 || (pixels_stop_ && is_small(walk, path, shift + 1, t)))
                return stop(walk, path, shift + 1, bit, hit);
            if (most_depth_ <= 2 * level + 2 || (pixels_stop_ && is_small(walk, path, shift, t))) return stop(walk, path, shift, bit, hit);
            if (nodes_.full_mask(level, node) >> bit & 1) {
                int part = shift;
                while (2 * levels_ - part < most_depth_ && part > 0 && !(pixels_stop_ && is_small(walk, path, part, t))) --part;
                return stop(walk, path, part, bit, hit);
            }
            if (level + 1 == node_levels_) return stop(walk, path, shift, bit, hit);
            path.nodes[size_t(level) + 1] = nodes_.child(level, node, bit);
            path.level = level + 1;
        }
    }

private:
    static std::array<uint32_t, 3> cell_of(const NodePath& path, int shift) {
        return {uint32_t(path.voxel[0]) >> shift, uint32_t(path.voxel[1]) >> shift, uint32_t(path.voxel[2]) >> shift};
    }
    // The ray may have entered the cell before it came to where it is now.
    static bool is_small(const RayWalk& walk, const NodePath& path, int shift, double t) {
        const double cell_side = double(uint32_t{1} << shift);
        if (!(cell_side <= walk.spread * t + walk.footprint)) return false;
        return cell_side <= walk.spread * std::max(walk.start_t, walk.entry(cell_of(path, shift), shift).t) + walk.footprint;
    }
    int stop(const RayWalk& walk, const NodePath& path, int shift, int bit, VoxelHit& hit) const {
        hit.cell = cell_of(path, shift);
        hit.depth = 2 * levels_ - shift;
        hit.level = path.level;
        hit.node = path.nodes[size_t(path.level)];
        hit.bit = bit;
        const RayEvent in = walk.entry(hit.cell, shift);
        const bool inside = in.t < walk.start_t;
        hit.t = inside ? walk.start_t : in.t;
        if (walk.t_scale != 1.0) hit.t /= walk.t_scale;
        hit.face = inside ? CellFace::inside : CellFace(2 * in.axis + (walk.forward[in.axis] ? 0 : 1));
        return -1;
    }

    const Nodes& nodes_;
    int levels_, node_levels_, most_depth_;
    bool pixels_stop_;
    const CellsAhead& ahead_;
};

/// The first cell that stops a ray. path  of any voxel, such as the last of a ray near it
template <class Look, class Hit>
bool walk_to_hit(Look&& look, const RayWalk& walk, const WalkStart& start, NodePath& path, Hit& hit) {
    path.turn_to(look.levels(), start.voxel);
    double t = start.event.t;
    look.restart(walk, t, path);
    for (;;) {
        const int shift = look.look(walk, t, path, hit);
        if (shift < 0) return true;
        // To the first plane of the empty cell that the ray crosses.
        std::array<int32_t, 3> low;
        const int32_t size = int32_t(1) << shift;
        for (size_t i = 0; i < 3; ++i) low[i] = path.voxel[i] & -size;
        const RayEvent out = walk.exit(low, size);
        t = out.t;
        if (!(t <= walk.most_t)) return false;
        // Along the other axes it is where it is at that t.
        uint32_t changed = 0;
        for (int a = 0; a < 3; ++a) {
            const size_t i = size_t(a);
            const int32_t next = a == out.axis ? low[i] + (walk.forward[a] & size) + ~walk.forward[a]
                                               : int32_t(walk.coordinate_after(a, out, uint32_t(low[i]), uint32_t(low[i] + size - 1)));
            changed |= uint32_t(path.voxel[i] ^ next);
            low[i] = next;
        }
        if (changed >= walk.side) return false;
        path.turn(look.levels(), changed);
        path.voxel = low;
    }
}

}  // namespace strata
