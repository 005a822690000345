#include "core/surface/field_rays.h"

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "core/simd_target.h"
#include "core/surface/field_slope.h"
#include "core/surface/trilinear_root.h"
#include "core/voxel/ray_group.h"
#include "core/voxel/ray_walk.h"

namespace strata {
namespace {

// The cells of a surface, as the walk asks them: a tree in which none is full, which therefore need not be asked on the way down.
class CellNodes {
public:
    explicit CellNodes(const VoxelTree& tree) : tree_(tree) {}

    int levels() const { return int(tree_.levels.size()); }
    uint64_t mask(int level, uint32_t node) const { return tree_.levels[size_t(level)].masks[node]; }
    uint64_t full_mask(int, uint32_t) const { return 0; }
    uint32_t child(int level, uint32_t node, int bit) const {
        const VoxelLevel& here = tree_.levels[size_t(level)];
        return here.first_child[node] + uint32_t(std::popcount(here.masks[node] & ((uint64_t{1} << bit) - 1)));
    }

private:
    const VoxelTree& tree_;
};

// What a walk asks: what may be skipped, and where the surface is in a cell that it passes through.
class SurfaceLook {
public:
    using Hit = FieldHit;

    SurfaceLook(const FieldSurface& surface, const CellNodes& nodes)
        : nodes_(nodes),
          field_(*surface.field),
          sign_(surface.level.inside == ContourInside::above ? 1.0 : -1.0),
          threshold_(sign_ * surface.level.isovalue),
          levels_(nodes.levels()) {}

    int levels() const { return levels_; }
    void begin(const FieldRay& ray) { ray_ = ray; }
    void restart(const RayWalk& walk, double, NodePath&) {
        side_ = Side::unknown;
        scale_ = 1.0 / walk.t_scale;
    }

    // Goes from cell to cell as long as the surface passes through them: t and path are where the ray then is.
    // returns  s where the ray may skip the cube of 2^s cells around, -1 where it meets the surface, or ends: `hit`
    int look(const RayWalk& walk, double& t, NodePath& path, FieldHit& hit) {
        const auto& ahead = kCellsAhead[0][size_t((walk.forward[0] & 4) | (walk.forward[1] & 2) | (walk.forward[2] & 1))];
        for (;;) {
            const int level = path.level;
            const uint32_t node = path.nodes[size_t(level)];
            const uint64_t mask = nodes_.mask(level, node);
            const int shift = 2 * (levels_ - 1 - level);
            const int bit = bit_of(path.voxel, shift);
            if ((mask >> bit & 1) == 0) {
                side_ = Side::unknown;
                return (mask & ahead[size_t(bit)]) == 0 ? shift + 2 : (mask >> (bit & 56) & 255) != 0 ? shift : shift + 1;
            }
            if (level + 1 < levels_) {
                path.nodes[size_t(level) + 1] = nodes_.child(level, node, bit);
                path.level = level + 1;
                continue;
            }
            const RayEvent out = walk.exit(path.voxel, 1);
            if (meets(walk, t, out, path.voxel, hit)) return -1;
            int32_t& place = path.voxel[size_t(out.axis)];
            const int32_t next = place + (walk.forward[out.axis] ? 1 : -1);
            const auto changed = uint32_t(place ^ next);
            if (!(out.t <= walk.most_t) || changed >= walk.side) {
                hit.t = RayWalk::kInfinity;
                return -1;
            }
            place = next;
            path.turn(levels_, changed);
            t = out.t;
        }
    }

private:
    enum class Side { unknown, outside, inside };

    // Of the corners of a face, where they agree.
    static Side side_of_face(const std::array<double, 8>& values, int axis, bool high) {
        constexpr size_t kSteps[] = {1, 2, 4};
        const size_t first = high ? kSteps[axis] : 0, one = kSteps[(axis + 1) % 3], other = kSteps[(axis + 2) % 3];
        const int inside = (values[first] >= 0.0) + (values[first + one] >= 0.0) + (values[first + other] >= 0.0) + (values[first + one + other] >= 0.0);
        return inside == 0 ? Side::outside : inside == 4 ? Side::inside : Side::unknown;
    }

    // Whether the ray meets the surface in a cell that it comes into, or starts in, at t; also true, with an infinite t, where it does so
    // beyond its end.
    bool meets(const RayWalk& walk, double t, const RayEvent& out, const std::array<int32_t, 3>& cell, FieldHit& hit) {
        const std::array<float, 8> corners = field_.corners(cell);
        std::array<double, 8> values;
        for (size_t n = 0; n < 8; ++n) values[n] = sign_ * double(corners[n]) - threshold_;
        // From where it comes into the cell to where it leaves it.
        const double from_t = t * scale_, whole_t = std::max(out.t - t, 0.0) * scale_;
        Vec3d from;
        for (int a = 0; a < 3; ++a) from[a] = std::clamp(ray_.origin[a] + from_t * ray_.direction[a] - cell[size_t(a)], 0.0, 1.0);
        const LineCubic cubic = trilinear_on_line(values, from, whole_t * ray_.direction);
        const Side side = cubic.c[0] >= 0.0 ? Side::inside : Side::outside;
        Side before = side_;
        if (before == Side::unknown) {
            const RayEvent in = walk.entry({uint32_t(cell[0]), uint32_t(cell[1]), uint32_t(cell[2])}, 0);
            if (in.t >= walk.start_t) before = side_of_face(values, in.axis, walk.forward[in.axis] == 0);
            if (before == Side::unknown) before = side;
        }
        std::optional<double> s = before == side ? first_crossing(cubic) : 0.0;
        if (!s) {
            const Side face = side_of_face(values, out.axis, walk.forward[out.axis] != 0);
            if (face != Side::unknown && face != side) s = 1.0;
        }
        side_ = side;
        if (!s) return false;
        hit = {from_t + *s * whole_t, cell, before == Side::inside};
        if (!(hit.t * walk.t_scale <= walk.most_t)) hit.t = RayWalk::kInfinity;
        return true;
    }

    const CellNodes& nodes_;
    const FieldBricks& field_;
    double sign_, threshold_;  // inside is where sign * value >= threshold
    int levels_;
    FieldRay ray_;
    double scale_ = 1.0;         // t of the caller = t of the walk * scale
    Side side_ = Side::unknown;  // where the ray ended in the cell before, if the surface passes through that
};

void cast(const FieldSurface& surface, const FieldRay& ray, const RayLimits& limits, FieldHit& hit) {
    RayWalk walk;
    WalkStart start;
    if (!prepare_walk(surface.cells.frame, ray, limits, walk) || !enter_cube(walk, 3, 0, start)) return;
    const CellNodes nodes(surface.cells);
    NodePath path;
    SurfaceLook look(surface, nodes);
    look.begin(ray);
    if (!walk_to_hit(look, walk, start, path, hit)) hit = {};
}

void cast(const FieldSurface& surface, const VoxelTile& tile, const RayLimits& limits, std::span<FieldHit> hits) {
    const CellNodes nodes(surface.cells);
    GroupCaster<CellNodes, SurfaceLook> caster(nodes, surface.cells.frame, limits, SurfaceLook(surface, nodes));
    caster.cast_tile(tile, hits);
}

// For each instruction set. The arithmetic is the same, and so are the hits.
STRATA_KERNEL_BASELINE void ray_baseline(const FieldSurface& surface, const FieldRay& ray, const RayLimits& limits, FieldHit& hit) {
    cast(surface, ray, limits, hit);
}
STRATA_KERNEL_AVX2 void ray_avx2(const FieldSurface& surface, const FieldRay& ray, const RayLimits& limits, FieldHit& hit) {
    cast(surface, ray, limits, hit);
}
STRATA_KERNEL_BASELINE void tile_baseline(const FieldSurface& surface, const VoxelTile& tile, const RayLimits& limits, std::span<FieldHit> hits) {
    cast(surface, tile, limits, hits);
}
STRATA_KERNEL_AVX2 void tile_avx2(const FieldSurface& surface, const VoxelTile& tile, const RayLimits& limits, std::span<FieldHit> hits) {
    cast(surface, tile, limits, hits);
}

}  // namespace

std::optional<FieldHit> cast_ray(const FieldSurface& surface, const FieldRay& ray, double least_t, double most_t, SimdLevel level) {
    if (surface.empty()) return std::nullopt;
    const RayLimits limits = {.least_t = least_t, .most_t = most_t};
    FieldHit hit;
    level == SimdLevel::baseline ? ray_baseline(surface, ray, limits, hit) : ray_avx2(surface, ray, limits, hit);
    return hit.t < RayWalk::kInfinity ? std::optional(hit) : std::nullopt;
}

void cast_tile(const FieldSurface& surface, const VoxelTile& tile, double least_t, double most_t, std::span<FieldHit> hits, SimdLevel level) {
    assert(hits.size() == size_t(tile.width) * size_t(tile.height));
    if (surface.empty()) return std::fill(hits.begin(), hits.end(), FieldHit{});
    const RayLimits limits = {.least_t = least_t, .most_t = most_t};
    level == SimdLevel::baseline ? tile_baseline(surface, tile, limits, hits) : tile_avx2(surface, tile, limits, hits);
}

FieldNormals::FieldNormals(const FieldSurface& surface)
    : field_(*surface.field),
      outward_from_gradient_((surface.level.inside == ContourInside::above ? -1.0 : 1.0) * field_.placement().axes.transpose().inverse()) {}

Vec3f FieldNormals::outward(const FieldRay& ray, const FieldHit& hit) const {
    const std::array<float, 64> around = field_.cube<4>({hit.cell[0] - 1, hit.cell[1] - 1, hit.cell[2] - 1});
    const Vec3d place = ray.origin + hit.t * ray.direction;
    Vec3d part;
    for (int a = 0; a < 3; ++a) part[a] = std::clamp(place[a] - hit.cell[size_t(a)], 0.0, 1.0);
    Vec3d gradient = Vec3d::Zero();
    constexpr size_t kStep[] = {1, 4, 16};
    for (size_t corner = 0; corner < 8; ++corner) {
        const size_t x = corner & 1, y = corner >> 1 & 1, z = corner >> 2, here = (z + 1) * 16 + (y + 1) * 4 + x + 1;
        const double weight = (x ? part[0] : 1.0 - part[0]) * (y ? part[1] : 1.0 - part[1]) * (z ? part[2] : 1.0 - part[2]);
        for (size_t axis = 0; axis < 3; ++axis)
            gradient[int(axis)] += weight * slope_between(double(around[here - kStep[axis]]), double(around[here]), double(around[here + kStep[axis]]));
    }
    return unit_normal(outward_from_gradient_ * gradient);
}

}  // namespace strata
