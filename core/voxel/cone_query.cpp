#include "core/voxel/cone_query.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/voxel/ray_cast.h"

namespace strata {
namespace {

// Optical depths from here on count as opaque, and opaque cells have twice that much, so that half of one crossed is enough.
const double kOpaqueDepth = 10.0 * std::log(2.0), kMostDepth = 2.0 * kOpaqueDepth;

double depth_of_opacity(double opacity) { return opacity < 1.0 ? std::min(-std::log1p(-opacity), kMostDepth) : kMostDepth; }

uint64_t word_of(uint32_t x, uint32_t y, uint32_t z) { return x | uint64_t{y} << 21 | uint64_t{z} << 42; }

// Distances at which the line origin + t * direction is in the box; from > to: nowhere.
void clip(const Vec3d& origin, const Vec3d& direction, const Vec3d& low, const Vec3d& high, double& from, double& to) {
    for (int axis = 0; axis < 3; ++axis) {
        if (direction[axis] == 0.0) {
            if (origin[axis] < low[axis] || origin[axis] > high[axis]) to = -1.0;
            continue;
        }
        const double a = (low[axis] - origin[axis]) / direction[axis], b = (high[axis] - origin[axis]) / direction[axis];
        from = std::max(from, std::min(a, b));
        to = std::min(to, std::max(a, b));
    }
}

}  // namespace

ConeQuery::ConeQuery(const VoxelTree& tree, const ConeSettings& settings)
    : tree_(tree),
      settings_(settings),
      way_(tree.levels.size()),
      opaque_voxels_(tree.attributes.empty() || tree.attributes[size_t(tree.depth())].opacities.empty()) {
    for (int depth = 1; depth < tree.depth(); ++depth)
        if (!tree.levels[size_t(depth - 1) / 2].masks.empty() &&
            (tree.attributes.empty() || tree.attributes[size_t(depth)].opacities.empty()))
            throw Error(ErrorKind::usage, "the voxels have no opacities along axes, which cones look at");
}

// The node of a level that holds a cell of `depth`, by the deepest one on the last way that holds it, too.
const ConeQuery::Step& ConeQuery::find_node(int level, int depth, const std::array<uint32_t, 3>& at) {
    const auto node_at = [&](int l) {
        const int shift = depth - 2 * l;
        return word_of(at[0] >> shift, at[1] >> shift, at[2] >> shift);
    };
    int known = level;
    while (known > 0 && !(way_[size_t(known)].kind != Step::Kind::unknown && way_[size_t(known)].node == node_at(known))) --known;
    if (known == 0) way_[0] = {.node = 0, .index = 0, .kind = Step::Kind::inside};
    for (int l = known; l < level; ++l) {
        const Step& above = way_[size_t(l)];
        Step& below = way_[size_t(l) + 1];
        below.node = node_at(l + 1);
        below.kind = above.kind;
        if (above.kind != Step::Kind::inside) continue;
        const VoxelLevel& voxels = tree_.levels[size_t(l)];
        const int shift = depth - 2 * (l + 1), bit = mask_bit(at[0] >> shift, at[1] >> shift, at[2] >> shift);
        if ((voxels.masks[above.index] >> bit & 1) == 0) {
            below.kind = Step::Kind::empty;
        } else if ((voxels.full_mask(above.index) >> bit & 1) != 0) {
            below.kind = Step::Kind::full;
        } else {
            below.index = voxels.child(above.index, bit);
        }
    }
    return way_[size_t(level)];
}

ConeQuery::CellOpacity ConeQuery::cell(int depth, const std::array<int64_t, 3>& at) {
    constexpr CellOpacity kEmpty = {0, 0, 0}, kFull = {255, 255, 255};
    const int64_t side = int64_t{1} << depth;
    for (const int64_t coordinate : at)
        if (coordinate < 0 || coordinate >= side) return kEmpty;
    const int level = (depth - 1) / 2;
    const bool odd = depth % 2 != 0;
    const std::array<uint32_t, 3> cell = {uint32_t(at[0]), uint32_t(at[1]), uint32_t(at[2])};
    const Step& step = find_node(level, depth, cell);
    if (step.kind == Step::Kind::empty) return kEmpty;
    if (step.kind == Step::Kind::full) return kFull;
    const uint64_t mask = tree_.levels[size_t(level)].masks[step.index];
    const int bit = odd ? int(8 * octant_code(cell[0] & 1, cell[1] & 1, cell[2] & 1)) : mask_bit(cell[0], cell[1], cell[2]);
    if ((mask >> bit & (odd ? 0xff : 1)) == 0) return kEmpty;
    if (depth == tree_.depth() && opaque_voxels_) return kFull;
    return tree_.attributes[size_t(depth)].opacities[cell_index(tree_, level, step.index, bit, odd)];
}

// Of one cell of `depth` around p, in voxels, crossed along the line.
//   Across the line opacities are interpolated, so that an edge hides what it covers; along it optical depths, so that
//   what a cell hides does not change with where the samples lie.
double ConeQuery::optical_depth(int depth, const Axis& axis, const Vec3d& p) {
    const Vec3d p_cell = std::ldexp(1.0, depth - tree_.frame.depth()) * p;
    const auto opacity_at = [&](const std::array<int64_t, 3>& at) {
        const CellOpacity opacity = cell(depth, at);
        return (axis.weights[0] * opacity[0] + axis.weights[1] * opacity[1] + axis.weights[2] * opacity[2]) * (1.0 / 255.0);
    };
    if (settings_.sampling == ConeSettings::Sampling::nearest)
        return depth_of_opacity(
            opacity_at({int64_t(std::floor(p_cell[0])), int64_t(std::floor(p_cell[1])), int64_t(std::floor(p_cell[2]))}));
    const Vec3d low = (p_cell.array() - 0.5).floor(), part = p_cell.array() - 0.5 - low.array();
    const int u = (axis.along + 1) % 3, v = (axis.along + 2) % 3;
    double along = 0.0;
    for (int slice = 0; slice < 2; ++slice) {
        double across = 0.0;
        for (int corner = 0; corner < 4; ++corner) {
            const int step_u = corner & 1, step_v = corner >> 1;
            const double weight = (step_u ? part[u] : 1.0 - part[u]) * (step_v ? part[v] : 1.0 - part[v]);
            if (weight == 0.0) continue;
            std::array<int64_t, 3> at = {int64_t(low[0]), int64_t(low[1]), int64_t(low[2])};
            at[size_t(axis.along)] += slice;
            at[size_t(u)] += step_u;
            at[size_t(v)] += step_v;
            across += weight * opacity_at(at);
        }
        if (across > 0.0) along += (slice ? part[axis.along] : 1.0 - part[axis.along]) * depth_of_opacity(across);
    }
    return along;
}

// Which cells are looked at where the cone is `width` voxels wide.
ConeQuery::Cells ConeQuery::cells_of(double width) const {
    const int finest = tree_.depth();
    const double coarser = std::max(std::log2(width) - (tree_.frame.depth() - finest), 0.0);
    const int whole = std::min(int(coarser), finest - 1);
    return {.depth = finest - whole,
            .side = std::ldexp(1.0, tree_.frame.depth() - finest + whole),
            .part_coarser = whole < finest - 1 ? coarser - whole : 0.0};
}

// Of a step around p.
double ConeQuery::depth_of_step(const Axis& axis, const Vec3d& p, const Cells& cells, double step) {
    // A cell hides 1 - (1 - opacity)^(step / side).
    double depth = (1.0 - cells.part_coarser) * (step / cells.side) * optical_depth(cells.depth, axis, p);
    if (cells.part_coarser > 0.0) depth += cells.part_coarser * (0.5 * step / cells.side) * optical_depth(cells.depth - 1, axis, p);
    return depth;
}

// After a look at t that found nothing: up to where the line stays in the largest empty node there, and so far from its faces that nothing
// beyond is looked at.
double ConeQuery::end_of_nothing(const Axis& axis, double t, double tangent) const {
    const Vec3d p = axis.at(t);
    const double side = tree_.frame.side();
    if (p.minCoeff() < 0.0 || p.maxCoeff() >= side) return t;
    const int depth = tree_.frame.depth();
    for (size_t level = 1; level < way_.size(); ++level) {
        const int shift = depth - 2 * int(level);
        const std::array<uint32_t, 3> node = {uint32_t(p.x()) >> shift, uint32_t(p.y()) >> shift, uint32_t(p.z()) >> shift};
        if (way_[level].kind == Step::Kind::unknown || way_[level].node != word_of(node[0], node[1], node[2])) return t;  // not looked at
        if (way_[level].kind != Step::Kind::empty) continue;
        const Vec3d low = std::ldexp(1.0, shift) * Vec3d(node[0], node[1], node[2]), high = low.array() + std::ldexp(1.0, shift);
        double from = t, to = std::numeric_limits<double>::infinity();
        clip(axis.origin, axis.direction, low, high, from, to);
        // Cells up to twice as wide as the cone are looked at, one of them around the line: it has to end before by that much.
        const double reach = settings_.sampling == ConeSettings::Sampling::nearest ? 0.0 : 2.0;
        const auto width = [&](double at) { return std::max(2.0 * tangent * at, std::ldexp(1.0, depth - tree_.depth())); };
        if (2.0 * width(to) > std::ldexp(1.0, shift)) continue;
        if (reach == 0.0) return std::max(to, t);
        from = t;
        double inner = std::numeric_limits<double>::infinity();
        const Vec3d margin = Vec3d::Constant(reach * width(to));
        clip(axis.origin, axis.direction, low + margin, high - margin, from, inner);
        return std::max(from <= t ? inner : t, t);
    }
    return t;
}

double ConeQuery::opacity_of_one(const VoxelCone& cone, const Vec3d& direction) {
    Axis axis = {.origin = cone.origin, .direction = direction, .weights = direction.cwiseProduct(direction)};
    direction.cwiseAbs().maxCoeff(&axis.along);
    const double least_width = std::ldexp(1.0, tree_.frame.depth() - tree_.depth()), side = tree_.frame.side();
    // Cells that reach beyond the frame may be looked at from outside.
    const double farthest = (cone.origin.cwiseAbs() + Vec3d::Constant(side)).norm();
    const double around = std::min(std::max(2.0 * cone.tangent * farthest, least_width), side);
    double from = std::max(cone.from, 0.0), to = cone.to;
    clip(axis.origin, direction, Vec3d::Constant(-around), Vec3d::Constant(side + around), from, to);
    // Where the cone is narrower than a voxel, one ray says all.
    if (opaque_voxels_) {
        const double end = std::min(0.5 * least_width / cone.tangent, to);
        if (from < end && is_occluded(tree_, {axis.origin, direction}, {.least_t = from, .most_t = end})) return 1.0;
        from = std::max(from, end);
    }
    double depth = 0.0;
    while (from < to) {
        const Cells cells = cells_of(std::max(2.0 * cone.tangent * from, least_width));
        const double step = std::min(settings_.step * cells.side, to - from), t = from + 0.5 * step;
        if (!(from + step > from)) break;  // so far away that doubles cannot step
        const double hidden = depth_of_step(axis, axis.at(t), cells, step);
        depth += hidden;
        if (depth >= kOpaqueDepth) return 1.0;
        from = hidden > 0.0 ? from + step : std::max(from + step, end_of_nothing(axis, t, cone.tangent));
    }
    return -std::expm1(-depth);
}

double ConeQuery::opacity(const VoxelCone& cone) {
    if (tree_.empty()) return 0.0;
    const Vec3d direction = cone.direction.normalized();
    if (settings_.cones <= 1) return opacity_of_one(cone, direction);
    // Evenly over the disc at distance 1: radii of equal areas, turned on by the golden angle.
    // source  H. Vogel, "A better way to construct the sunflower head", Mathematical Biosciences 1979
    constexpr double kGoldenAngle = 2.39996322972865332;
    const Vec3d right = direction.unitOrthogonal(), up = direction.cross(right);
    VoxelCone narrow = cone;
    double sum = 0.0;
    for (int i = 0; i < settings_.cones; ++i) {
        const double radius = cone.tangent * std::sqrt((i + 0.5) / settings_.cones), angle = kGoldenAngle * i;
        // Away from the axis a part of the disc is farther off and seen aslant: its solid angle is cos^3 of that on the axis.
        narrow.tangent = cone.tangent / std::sqrt(double(settings_.cones)) * std::pow(1.0 + radius * radius, -0.75);
        sum += opacity_of_one(narrow, (direction + radius * (std::cos(angle) * right + std::sin(angle) * up)).normalized());
    }
    return sum / settings_.cones;
}

}  // namespace strata
