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

/// A ray made ready to walk a cube of 4^levels voxels an axis.
struct RayWalk {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    std::array<double, 3> plane_origin, plane_scale;  // an axis that the ray does not move along: every plane at infinity
    std::array<double, 3> place_origin, place_step;   // where it is
    std::array<uint32_t, 3> forward;                  // all bits set where coordinates grow along the ray
    std::array<bool, 3> still;
    double place_error;  // place_origin + t * place_step is off by less, inside the cube
    double t_scale;      // t here = t of the caller * t_scale, a power of 2
    double start_t, most_t, spread, footprint;
    uint32_t side;

    double plane_t(int axis, double plane) const { return (plane - plane_origin[size_t(axis)]) * plane_scale[size_t(axis)]; }

    /// Where the ray enters the cell of side 2^shift at coordinates in those units.
    RayEvent entry(const std::array<uint32_t, 3>& cell, int shift) const {
        RayEvent last = {-kInfinity, 0};
        for (int a = 0; a < 3; ++a) {
            if (still[size_t(a)]) continue;
            const uint32_t plane = (cell[size_t(a)] + (forward[size_t(a)] ? 0 : 1)) << shift;
            const RayEvent event = {plane_t(a, plane), a};
            if (last < event) last = event;
        }
        return last;
    }
    RayEvent exit(const std::array<uint32_t, 3>& cell, int shift) const {
        RayEvent first = {kInfinity, 3};
        for (int a = 0; a < 3; ++a) {
            if (still[size_t(a)]) continue;
            const uint32_t plane = (cell[size_t(a)] + (forward[size_t(a)] ? 1 : 0)) << shift;
            const RayEvent event = {plane_t(a, plane), a};
            if (event < first) first = event;
        }
        return first;
    }

    /// The coordinate after an event, known to be in [low, high].
    uint32_t coordinate_after(int axis, const RayEvent& event, uint32_t low, uint32_t high) const {
        const size_t a = size_t(axis);
        if (still[a]) return std::clamp(uint32_t(place_origin[a]), low, high);
        const double place = place_origin[a] + event.t * place_step[a];
        const double below = std::floor(place);
        if (place - below > place_error && below + 1.0 - place > place_error && below > -1e9 && below < 1e9)
            return uint32_t(std::clamp(int64_t(below), int64_t(low), int64_t(high)));
        // Too near a plane for the place to tell: the planes between are asked themselves.
        while (low < high) {
            if (forward[a]) {
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
};

/// returns  false where the ray hits nothing, whatever there is
inline bool prepare_walk(const VoxelFrame& frame, const VoxelRay& ray, const RayLimits& limits, RayWalk& walk) {
    if (!ray.origin.allFinite() || !ray.direction.allFinite()) return false;
    const double longest = ray.direction.cwiseAbs().maxCoeff();
    if (longest == 0.0) return false;
    int exponent = 0;
    if (longest < 0x1p-100 || longest > 0x1p100) exponent = std::ilogb(longest);  // t would overflow
    walk.side = frame.side();
    double reach = walk.side;
    for (int i = 0; i < 3; ++i) {
        const size_t a = size_t(i);
        const double step = exponent ? std::scalbn(ray.direction[i], -exponent) : ray.direction[i];
        const double origin = ray.origin[i];
        reach = std::max(reach, std::abs(origin));
        walk.forward[a] = step > 0.0 ? ~uint32_t{0} : 0;
        walk.still[a] =
            std::abs(step) < 0x1p-900;  // would take longer to reach a plane than all the others, and its inverse might be infinite
        if (walk.still[a]) {
            walk.plane_origin[a] = -RayWalk::kInfinity;
            walk.plane_scale[a] = 1.0;
            walk.place_origin[a] = std::floor(origin);
            walk.place_step[a] = 0.0;
            if (!(origin >= 0.0 && origin < walk.side)) return false;
        } else {
            walk.plane_origin[a] = walk.place_origin[a] = origin;
            walk.plane_scale[a] = 1.0 / step;
            walk.place_step[a] = step;
        }
    }
    // t is off by less than 3 roundings of 2^-53 of itself, so t * step by as much of |origin| + side, and two more roundings.
    walk.place_error = 2.0 * reach * 0x1p-50;
    walk.t_scale = std::scalbn(1.0, exponent);
    walk.start_t = std::max(0.0, std::isnan(limits.least_t) ? 0.0 : limits.least_t * walk.t_scale);
    walk.most_t = limits.most_t * walk.t_scale;
    walk.spread = limits.spread / walk.t_scale;
    walk.footprint = limits.footprint;
    return true;
}

/// The start of a walk: the cell after an event.
struct WalkStart {
    RayEvent event;
    std::array<uint32_t, 3> voxel = {};
};

/// Where the ray enters the cube, or starts in it. returns false where it does neither.
inline bool enter_cube(const RayWalk& walk, WalkStart& start) {
    RayEvent in = {-RayWalk::kInfinity, 0}, out = {RayWalk::kInfinity, 3};
    for (int a = 0; a < 3; ++a) {
        if (walk.still[size_t(a)]) continue;
        const bool forward = walk.forward[size_t(a)] != 0;
        const RayEvent enters = {walk.plane_t(a, forward ? 0.0 : walk.side), a}, leaves = {walk.plane_t(a, forward ? walk.side : 0.0), a};
        if (in < enters) in = enters;
        if (leaves < out) out = leaves;
    }
    if (!(walk.start_t < in.t)) in = {walk.start_t, 3};
    if (out < in || !(in.t <= walk.most_t)) return false;
    start.event = in;
    for (int a = 0; a < 3; ++a) {
        const size_t i = size_t(a);
        if (a == in.axis) start.voxel[i] = walk.forward[i] ? 0 : walk.side - 1;
        else start.voxel[i] = walk.coordinate_after(a, in, 0, walk.side - 1);
    }
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

/// Walks from `start` to the first cell that stops the ray.
/// Nodes  levels(), mask(level, node), full_mask(level, node), child(level, node, bit)
/// returns  whether there is one
template <class Nodes>
bool walk_to_hit(const Nodes& nodes, const VoxelFrame& frame, const RayWalk& walk, const WalkStart& start, int most_depth, VoxelHit& hit) {
    const bool octants_stop = most_depth % 2 != 0 || walk.spread > 0.0 || walk.footprint > 0.0;
    const uint32_t signs = (walk.forward[0] & 4) | (walk.forward[1] & 2) | (walk.forward[2] & 1);
    const std::array<uint64_t, 64>& ahead = kCellsAhead[octants_stop][signs];
    std::array<uint32_t, 3> voxel = start.voxel;
    RayEvent event = start.event;
    std::array<uint32_t, kMostVoxelLevels> path;  // node of each level
    path[0] = 0;
    int level = 0;
    const auto cell_of = [&](int shift) { return std::array<uint32_t, 3>{voxel[0] >> shift, voxel[1] >> shift, voxel[2] >> shift}; };
    // The ray may have entered the cell before it came to where it is now.
    const auto is_small = [&](int shift) {
        const double cell_side = double(uint32_t{1} << shift);
        if (!(cell_side <= walk.spread * event.t + walk.footprint)) return false;
        return cell_side <= walk.spread * std::max(walk.start_t, walk.entry(cell_of(shift), shift).t) + walk.footprint;
    };
    for (;;) {
        const uint32_t node = path[size_t(level)];
        const uint64_t mask = nodes.mask(level, node);
        const int shift = 2 * (frame.levels - 1 - level);
        const int bit = mask_bit(voxel[0] >> shift, voxel[1] >> shift, voxel[2] >> shift);
        int empty_shift = shift;
        int hit_shift = -1;
        if ((mask >> (bit & 56) & 255) == 0) {
            empty_shift = shift + 1;
        } else if (most_depth <= 2 * level + 1 || is_small(shift + 1)) {
            hit_shift = shift + 1;
        } else if (mask >> bit & 1) {
            if (most_depth <= 2 * level + 2 || is_small(shift)) {
                hit_shift = shift;
            } else if (nodes.full_mask(level, node) >> bit & 1) {
                hit_shift = shift;
                while (2 * frame.levels - hit_shift < most_depth && hit_shift > 0 && !is_small(hit_shift)) --hit_shift;
            } else if (level + 1 == nodes.levels()) {
                hit_shift = shift;
            } else {
                path[size_t(level) + 1] = nodes.child(level, node, bit);
                ++level;
                continue;
            }
        }
        if (hit_shift >= 0) {
            hit.cell = cell_of(hit_shift);
            hit.depth = 2 * frame.levels - hit_shift;
            hit.level = level;
            hit.node = node;
            hit.bit = bit;
            const RayEvent in = walk.entry(hit.cell, hit_shift);
            const bool inside = in.t < walk.start_t;
            hit.t = (inside ? walk.start_t : in.t) / walk.t_scale;
            hit.face = inside ? CellFace::inside : CellFace(2 * in.axis + (walk.forward[size_t(in.axis)] ? 0 : 1));
            return true;
        }
        if ((mask & ahead[size_t(bit)]) == 0) empty_shift = shift + 2;
        const std::array<uint32_t, 3> before = voxel;
        const std::array<uint32_t, 3> cell = cell_of(empty_shift);
        event = walk.exit(cell, empty_shift);
        if (!(event.t <= walk.most_t)) return false;
        uint32_t changed = 0;
        for (int a = 0; a < 3; ++a) {
            const size_t i = size_t(a);
            const uint32_t low = cell[i] << empty_shift, high = low + ((uint32_t{1} << empty_shift) - 1);
            if (a == event.axis) voxel[i] = walk.forward[i] ? high + 1 : low - 1;
            else voxel[i] = walk.coordinate_after(a, event, low, high);
            changed |= voxel[i] ^ before[i];
        }
        if (changed >= walk.side) return false;
        level = std::min(level, frame.levels - 1 - (int(std::bit_width(changed)) - 1) / 2);
    }
}

}  // namespace strata
