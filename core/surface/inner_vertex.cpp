#include "core/surface/inner_vertex.h"

#include <algorithm>
#include <cmath>

#include "core/surface/edge_cut.h"

namespace strata {
namespace {

bool all_finite(const CellValues& values) {
    return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

double weight(const Vec3d& p, size_t corner, int axis) { return (corner >> axis & 1) != 0 ? p[axis] : 1.0 - p[axis]; }

double value_at(const CellValues& values, const Vec3d& p) {
    double sum = 0.0;
    for (size_t c = 0; c < 8; ++c) sum += weight(p, c, 0) * weight(p, c, 1) * weight(p, c, 2) * values[c];
    return sum;
}

}  // namespace

Vec3d inside_slope(const CellValues& values, const Vec3d& p_cell) {
    Vec3d slope = Vec3d::Zero();
    if (!all_finite(values)) return slope;
    for (int axis = 0; axis < 3; ++axis)
        for (size_t c = 0; c < 8; ++c) {
            const double sign = (c >> axis & 1) != 0 ? 1.0 : -1.0;
            slope[axis] += sign * weight(p_cell, c, (axis + 1) % 3) * weight(p_cell, c, (axis + 2) % 3) * values[c];
        }
    return slope;
}

Vec3d place_inner_vertex(const CellValues& values, uint16_t edges) {
    Vec3d p = Vec3d::Zero();
    int count = 0;
    CutStatistics unused;
    for (size_t e = 0; e < kCellEdges; ++e) {
        if ((edges >> e & 1) == 0) continue;
        const CellEdge& edge = kCellEdge[e];
        Vec3d crossing(edge.lower & 1, edge.lower >> 1 & 1, edge.lower >> 2);
        crossing[edge.axis] = cut_edge(values[edge.lower], values[edge.upper], 0.0, unused);
        p += crossing;
        ++count;
    }
    p /= count;
    if (!all_finite(values)) return p;
    // Newton along the slope, no farther from the mean than the cell: the function is nearly flat only near its saddles, where the mean
    // is as good as any place.
    constexpr int kSteps = 8;
    for (int step = 0; step < kSteps; ++step) {
        const Vec3d slope = inside_slope(values, p);
        const double squared = slope.squaredNorm();
        if (!(squared > 0.0)) break;
        Vec3d move = -value_at(values, p) / squared * slope;
        if (!move.allFinite()) break;
        if (const double length = move.norm(); length > 0.25) move *= 0.25 / length;
        p += move;
        for (int axis = 0; axis < 3; ++axis) p[axis] = std::clamp(p[axis], kLeastCut, 1.0 - kLeastCut);
    }
    return p;
}

}  // namespace strata
