#include "core/surface/field_rays.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/surface/field_slope.h"
#include "core/surface/trilinear_root.h"
#include "core/voxel/ray_walk.h"

namespace strata {
namespace {

// What a walk through cells asks: what may be skipped, and where the surface is.
class SurfaceLook {
public:
    SurfaceLook(const FieldBricks& field, const IsoLevel& level, const FieldRay& ray, int levels)
        : field_(field),
          ray_(ray),
          sign_(level.inside == ContourInside::above ? 1.0 : -1.0),
          threshold_(sign_ * level.isovalue),
          levels_(levels) {}

    int levels() const { return levels_; }
    void restart(const RayWalk&, double, NodePath&) const {}

    // returns  s where the ray may skip the cube of 2^s cells around, -1 where it meets the surface: `hit`
    int look(const RayWalk& walk, double t, NodePath& path, FieldHit& hit) {
        const auto [i, j, k] = path.voxel;
        const std::array<int32_t, 3>& bricks = field_.bricks();
        if (i >= 8 * bricks[0] || j >= 8 * bricks[1] || k >= 8 * bricks[2]) return pass(3, Side::unknown, t / walk.t_scale, path, hit);
        const Side wide = side_of(field_.wide_range_of(i >> 6, j >> 6, k >> 6));
        if (wide != Side::both) return pass(6, wide, t / walk.t_scale, path, hit);
        const Side brick = side_of(field_.range_of(i >> 3, j >> 3, k >> 3));
        if (brick != Side::both) return pass(3, brick, t / walk.t_scale, path, hit);
        const Side octant = side_of(field_.octant_range_of(i >> 3, j >> 3, k >> 3, (i >> 2 & 1) | (j >> 1 & 2) | (k & 4)));
        if (octant != Side::both) return pass(2, octant, t / walk.t_scale, path, hit);
        const std::array<float, 8> corners = field_.corners(path.voxel);
        unsigned inside = 0;
        bool missing = false;
        std::array<double, 8> values;
        for (size_t n = 0; n < 8; ++n) {
            values[n] = sign_ * double(corners[n]) - threshold_;
            inside |= unsigned(values[n] >= 0.0) << n;
            missing |= std::isnan(corners[n]);
        }
        if (missing || inside == 0 || inside == 255)
            return pass(0, missing ? Side::unknown : inside == 0 ? Side::outside : Side::inside, t / walk.t_scale, path, hit);
        // From where it comes into the cell, or starts in it, to where it leaves it.
        double end = walk.most_t;
        for (int a = 0; a < 3; ++a) end = std::min(end, walk.plane_t(a, path.voxel[size_t(a)] + (walk.forward[a] ? 1 : 0)));
        const double length = std::max(end - t, 0.0);
        const double from_t = t / walk.t_scale, whole_t = length / walk.t_scale;
        Vec3d from;
        for (int a = 0; a < 3; ++a) from[a] = std::clamp(ray_.origin[a] + from_t * ray_.direction[a] - path.voxel[size_t(a)], 0.0, 1.0);
        const LineCubic cubic = trilinear_on_line(values, from, whole_t * ray_.direction);
        const bool starts_inside = cubic(0.0) >= 0.0;
        const Side side = starts_inside ? Side::inside : Side::outside, before = side_ == Side::unknown ? side : side_;
        const std::optional<double> s = before == side ? first_crossing(cubic) : 0.0;
        if (!s) {
            side_ = side;
            return 0;
        }
        hit = {from_t + *s * whole_t, path.voxel, before == Side::inside};
        return -1;
    }

private:
    enum class Side { unknown, outside, inside, both };

    // Where all values of a range are; unknown: no surface is between them, but some are missing, and a cell beside one that is tells the
    // next one nothing.
    Side side_of(const FieldRange& range) const {
        if (range.least > range.greatest) return Side::unknown;
        const double low = sign_ > 0.0 ? range.least : -range.greatest, high = sign_ > 0.0 ? range.greatest : -range.least;
        if (low < threshold_ && high >= threshold_) return Side::both;
        return range.has_missing ? Side::unknown : low >= threshold_ ? Side::inside : Side::outside;
    }
    // Through cells on one side; where the ray came from the other, the surface lies on the face between.
    int pass(int shift, Side side, double t, const NodePath& path, FieldHit& hit) {
        if (side != Side::unknown && side_ != Side::unknown && side != side_) {
            hit = {t, path.voxel, side_ == Side::inside};
            return -1;
        }
        side_ = side;
        return shift;
    }

    const FieldBricks& field_;
    const FieldRay& ray_;
    double sign_, threshold_;  // inside is where sign * value >= threshold
    int levels_;
    Side side_ = Side::unknown;  // of the end of the cell before
};

}  // namespace

std::vector<std::array<int32_t, 3>> crossed_bricks(const FieldBricks& field, const IsoLevel& level) {
    std::vector<std::array<int32_t, 3>> crossed;
    const auto [ni, nj, nk] = field.bricks();
    for (int32_t k = 0; k < nk; ++k)
        for (int32_t j = 0; j < nj; ++j)
            for (int32_t i = 0; i < ni; ++i) {
                const FieldRange& range = field.range_of(i, j, k);
                if (level.inside == ContourInside::above ? range.least < level.isovalue && range.greatest >= level.isovalue
                                                         : range.least <= level.isovalue && range.greatest > level.isovalue)
                    crossed.push_back({i, j, k});
            }
    return crossed;
}

Box3d crossed_cells(const FieldBricks& field, const IsoLevel& level, const std::array<int32_t, 3>& brick) {
    Box3d box;
    for (int32_t n = 0; n < kFieldBrickSamples; ++n) {
        const std::array<int32_t, 3> cell = {8 * brick[0] + (n & 7), 8 * brick[1] + (n >> 3 & 7), 8 * brick[2] + (n >> 6)};
        int inside = 0;
        bool missing = false;
        for (const float value : field.corners(cell)) {
            inside += level.inside == ContourInside::above ? value >= level.isovalue : value <= level.isovalue;
            missing |= std::isnan(value);
        }
        if (missing || inside == 0 || inside == 8) continue;
        box.extend(Vec3d(cell[0], cell[1], cell[2]));
        box.extend(Vec3d(cell[0] + 1, cell[1] + 1, cell[2] + 1));
    }
    return box;
}

Box3d surface_bounds(const FieldBricks& field, const IsoLevel& level) {
    Box3d box;
    for (const auto& [i, j, k] : crossed_bricks(field, level))
        for (int corner = 0; corner < 8; ++corner)
            box.extend(field.placement().world_from_index(8.0 * Vec3d(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2))));
    if (box.empty()) return box;
    // The last bricks may reach beyond the samples.
    return {.min = box.min.cwiseMax(field.bounds().min), .max = box.max.cwiseMin(field.bounds().max)};
}

std::optional<FieldHit> cast_ray(const FieldBricks& field, const IsoLevel& level, const FieldRay& ray, double least_t, double most_t) {
    if (field.empty()) return std::nullopt;
    // The part of it in the box of cells: beyond is nothing, and the cube that is walked may be much larger.
    const std::array<int32_t, 3> cells = field.cells();
    double from = least_t, to = most_t;
    for (int a = 0; a < 3; ++a) {
        const double inverse = 1.0 / ray.direction[a], low = -ray.origin[a] * inverse, high = (cells[size_t(a)] - ray.origin[a]) * inverse;
        if (std::isnan(low) || std::isnan(high)) continue;
        from = std::max(from, std::min(low, high));
        to = std::min(to, std::max(low, high));
    }
    from -= 0x1p-40 * std::abs(from);
    to += 0x1p-40 * std::abs(to);
    if (!(from <= to)) return std::nullopt;
    VoxelFrame frame;
    while (int32_t(frame.side()) < std::max({cells[0], cells[1], cells[2]})) ++frame.levels;
    RayWalk walk;
    WalkStart start;
    FieldHit hit;
    if (!prepare_walk(frame, {ray.origin, ray.direction}, {.least_t = std::max(from, least_t), .most_t = std::min(to, most_t)}, walk))
        return std::nullopt;
    if (!enter_cube(walk, 3, 0, start)) return std::nullopt;
    NodePath path;
    SurfaceLook look(field, level, ray, frame.levels);
    if (!walk_to_hit(look, walk, start, path, hit)) return std::nullopt;
    return hit;
}

Vec3f outward_normal(const FieldBricks& field, const IsoLevel& level, const FieldRay& ray, const FieldHit& hit) {
    const auto [i, j, k] = hit.cell;
    const auto slope = [&](int32_t x, int32_t y, int32_t z, int axis) {
        const auto at = [&](int32_t away) {
            return double(field.sample(x + (axis == 0 ? away : 0), y + (axis == 1 ? away : 0), z + (axis == 2 ? away : 0)));
        };
        return slope_between(at(-1), at(0), at(1));
    };
    const Vec3d place = ray.origin + hit.t * ray.direction;
    Vec3d part;
    for (int a = 0; a < 3; ++a) part[a] = std::clamp(place[a] - hit.cell[size_t(a)], 0.0, 1.0);
    Vec3d gradient = Vec3d::Zero();
    for (int corner = 0; corner < 8; ++corner) {
        const int x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
        const double weight = (x ? part[0] : 1.0 - part[0]) * (y ? part[1] : 1.0 - part[1]) * (z ? part[2] : 1.0 - part[2]);
        for (int axis = 0; axis < 3; ++axis) gradient[axis] += weight * slope(i + x, j + y, k + z, axis);
    }
    const double outwards = level.inside == ContourInside::above ? -1.0 : 1.0;
    return unit_normal(outwards * (field.placement().axes.transpose().inverse() * gradient));
}

}  // namespace strata
