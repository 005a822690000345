#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include "core/voxel/ray_walk.h"

// Rays that are near each other are surely in empty space for the same first part of their way. A beam is a box of rays, two
// intervals that move along one axis; no ray is outside, so what the beam does not touch no ray does.
// Idea: S. Laine, T. Karras, "Efficient Sparse Voxel Octrees", IEEE TVCG 2011, which finds the start by a few rays instead.

namespace strata {

/// Where rays are, at a distance u >= 0 along an axis from `begin`: between least_place + u * least_slope and so on, of the other two axes.
struct RayBeam {
    int axis = 0;
    bool forward = true;
    double begin = 0.0;  // along the axis, from the side of the cube where rays come from
    std::array<int, 2> others = {1, 2};
    std::array<double, 2> least_place, most_place, least_slope, most_slope;
    double most_begin_t, most_t_slope;  // t at a distance u is at most most_begin_t + u * most_t_slope
    double margin;
};

inline int main_axis(const RayWalk& walk) {
    int axis = 0;
    for (int a = 1; a < 3; ++a)
        if (std::abs(walk.place_step[a]) > std::abs(walk.place_step[axis])) axis = a;
    return axis;
}

/// The beam of rays, and of all that are within `rounding` of a place in between. returns  false where they have no axis in common along
/// which they move, or are too far away
inline bool beam_of(std::span<const RayWalk> walks, double rounding, RayBeam& beam) {
    const RayWalk& first = walks[0];
    const int axis = main_axis(first);
    const double side = first.side;
    beam.axis = axis;
    beam.others = {axis == 0 ? 1 : 0, axis == 2 ? 1 : 2};
    beam.forward = first.forward[axis] != 0;
    const double sign = beam.forward ? 1.0 : -1.0, base = beam.forward ? 0.0 : side;
    double error = 0.0;
    beam.begin = RayWalk::kInfinity;
    for (const RayWalk& walk : walks) {
        if ((walk.forward[axis] != 0) != beam.forward || walk.still[size_t(axis)]) return false;
        const double along = std::abs(walk.place_step[axis]);
        for (const int other : beam.others)
            if (!(std::abs(walk.place_step[other]) <= 4.0 * along)) return false;
        const double start = (walk.place_origin[axis] + walk.start_t * walk.place_step[axis] - base) * sign;
        beam.begin = std::min(beam.begin, start);
        error = std::max(error, walk.place_error);
    }
    if (!(error < 0x1p-8)) return false;
    // Places are off by less than 5 roundings of 5 (|origin| + side), which place_error is 8 of.
    beam.margin = 16.0 * error + rounding;
    beam.begin = std::max(0.0, beam.begin - beam.margin);
    beam.least_place = beam.least_slope = {RayWalk::kInfinity, RayWalk::kInfinity};
    beam.most_place = beam.most_slope = {-RayWalk::kInfinity, -RayWalk::kInfinity};
    beam.most_begin_t = beam.most_t_slope = -RayWalk::kInfinity;
    for (const RayWalk& walk : walks) {
        const double inverse = walk.plane_scale[axis];
        const double t = (base + sign * beam.begin - walk.place_origin[axis]) * inverse;
        beam.most_begin_t = std::max(beam.most_begin_t, t);
        beam.most_t_slope = std::max(beam.most_t_slope, std::abs(inverse));
        for (size_t i = 0; i < 2; ++i) {
            const double place = walk.place_origin[beam.others[i]] + t * walk.place_step[beam.others[i]];
            const double slope = walk.place_step[beam.others[i]] * std::abs(inverse);
            beam.least_place[i] = std::min(beam.least_place[i], place);
            beam.most_place[i] = std::max(beam.most_place[i], place);
            beam.least_slope[i] = std::min(beam.least_slope[i], slope);
            beam.most_slope[i] = std::max(beam.most_slope[i], slope);
        }
    }
    for (size_t i = 0; i < 2; ++i) {
        beam.least_place[i] -= beam.margin;
        beam.most_place[i] += beam.margin;
    }
    return true;
}

/// A beam around the rays of pixels [x0, x1] x [y0, y1] of a tile, by the four at its corners. returns  false where these do not tell
inline bool beam_of(const VoxelTile& tile, int x0, int y0, int x1, int y1, const VoxelFrame& frame, const RayLimits& limits,
                    RayBeam& beam) {
    // Slopes of rays from one place, and places of rays in one direction, are extreme at corners.
    const bool one_origin = tile.origin_per_x.isZero(0.0) && tile.origin_per_y.isZero(0.0);
    const bool one_direction = tile.direction_per_x.isZero(0.0) && tile.direction_per_y.isZero(0.0);
    if (!one_origin && !one_direction) return false;
    std::array<RayWalk, 4> corners;
    for (size_t i = 0; i < 4; ++i)
        if (!prepare_walk(frame, tile.ray(i & 1 ? x1 : x0, i & 2 ? y1 : y0), limits, corners[i]) || corners[i].t_scale != 1.0) return false;
    // Rays of pixels are sums that are rounded each for itself, by 2^-51 of their terms: so much may they lie outside, once that of a
    // direction has become a place.
    double reach = frame.side(), origins = 0.0, directions = 0.0, along = RayWalk::kInfinity;
    for (int a = 0; a < 3; ++a) {
        origins =
            std::max(origins, std::abs(tile.first.origin[a]) + x1 * std::abs(tile.origin_per_x[a]) + y1 * std::abs(tile.origin_per_y[a]));
        directions = std::max(directions, std::abs(tile.first.direction[a]) + x1 * std::abs(tile.direction_per_x[a]) +
                                              y1 * std::abs(tile.direction_per_y[a]));
    }
    reach += origins;
    const int axis = main_axis(corners[0]);
    for (const RayWalk& walk : corners) along = std::min(along, std::abs(walk.place_step[axis]));
    const double rounding = 0x1p-51 * 5.0 * (origins + directions / along * reach);
    return rounding < 0x1p-8 && beam_of(corners, rounding, beam);
}

/// Bits of a mask whose coordinate along an axis is in a range: [axis][low][high].
inline constexpr std::array<std::array<std::array<uint64_t, 4>, 4>, 3> kCellRanges = [] {
    std::array<std::array<std::array<uint64_t, 4>, 4>, 3> table{};
    for (size_t axis = 0; axis < 3; ++axis)
        for (uint32_t low = 0; low < 4; ++low)
            for (uint32_t high = low; high < 4; ++high)
                for (uint64_t bit = 0; bit < 64; ++bit) {
                    const uint32_t c = coordinates_of_code(bit)[axis];
                    if (c >= low && c <= high) table[axis][low][high] |= uint64_t{1} << bit;
                }
    return table;
}();

/// Looks for the first slab of cells, across the beam's axis, that a ray of the beam might be stopped in.
template <class Nodes>
class BeamSearch {
public:
    BeamSearch(const Nodes& nodes, const VoxelFrame& frame, int most_depth, const RayBeam& beam, double spread, double footprint)
        : nodes_(nodes),
          levels_(frame.levels),
          most_depth_(std::clamp(most_depth, 1, frame.depth())),
          beam_(beam),
          spread_(spread),
          footprint_(footprint),
          best_(int32_t(frame.side())) {}

    /// How far along the axis, from the side of the cube where rays come from, there surely is nothing; the side of the cube: there
    /// is nothing at all.
    /// from  known to be empty before
    int32_t empty_until(int32_t from) {
        from_ = from;
        visit(0, 0, {0, 0, 0});
        return best_;
    }

private:
    // corner  of the node, in voxels
    void visit(int level, uint32_t node, const std::array<int32_t, 3>& corner) {
        const int shift = 2 * (levels_ - 1 - level);
        const int32_t size = int32_t(1) << shift, side = int32_t(1) << 2 * levels_;
        const double inverse = 1.0 / size;
        const uint64_t mask = nodes_.mask(level, node);
        const size_t axis = size_t(beam_.axis);
        const bool last = level + 1 == nodes_.levels();
        for (int32_t j = 0; j < 4; ++j) {
            const int32_t slab = beam_.forward ? j : 3 - j;
            const int32_t low = corner[axis] + slab * size;
            const int32_t near = beam_.forward ? low : side - low - size;
            if (near >= best_) return;
            const double u2 = near + size - beam_.begin;
            if (near + size <= from_ || u2 < 0.0) continue;
            const double u1 = std::max(0.0, std::max(near, from_) - beam_.begin);
            uint64_t cells = mask & kCellRanges[axis][size_t(slab)][size_t(slab)];
            double width = 0.0;
            for (size_t i = 0; i < 2; ++i) {
                const size_t other = size_t(beam_.others[i]);
                const double least1 = beam_.least_place[i] + u1 * beam_.least_slope[i],
                             most1 = beam_.most_place[i] + u1 * beam_.most_slope[i];
                const double least = std::min(least1, beam_.least_place[i] + u2 * beam_.least_slope[i]);
                const double most = std::max(most1, beam_.most_place[i] + u2 * beam_.most_slope[i]);
                width = std::max(width, most1 - least1);
                // Cells from floor(first) to floor(last); a place on a face counts for both.
                const double first = (least - corner[other]) * inverse, beyond = (most - corner[other]) * inverse;
                if (beyond < 0.0 || first > 4.0) {
                    cells = 0;
                    break;
                }
                const auto low_cell = size_t(first > 0.0 ? std::min(first, 3.0) : 0.0), high_cell = size_t(std::min(beyond, 3.0));
                cells &= kCellRanges[other][low_cell][high_cell];
            }
            // Where cells of this side, or the octants of them, may stop rays that find nothing in them, their being empty says nothing.
            const double most_t = beam_.most_begin_t + u2 * beam_.most_t_slope;
            if (most_depth_ < 2 * level + 2 || !(size > (spread_ * most_t + footprint_) * (1.0 + 0x1p-20))) {
                best_ = near;
                return;
            }
            if (cells == 0) continue;
            if (last || most_depth_ == 2 * level + 2 || 2 * size <= width || (cells & nodes_.full_mask(level, node)) != 0) {
                best_ = near;
                return;
            }
            for (; cells != 0; cells &= cells - 1) {
                const int bit = std::countr_zero(cells);
                const auto [x, y, z] = coordinates_of_code(uint64_t(bit));
                visit(level + 1, nodes_.child(level, node, bit),
                      {corner[0] + int32_t(x) * size, corner[1] + int32_t(y) * size, corner[2] + int32_t(z) * size});
            }
        }
    }

    const Nodes& nodes_;
    int levels_, most_depth_;
    const RayBeam& beam_;
    double spread_, footprint_;
    int32_t from_ = 0, best_;
};

}  // namespace strata
