#include "core/voxel/surface_attributes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>

namespace strata {
namespace {

constexpr double kHeaviest = 1.0;  // square voxels
constexpr double kNormalUnit = 0x1p32, kColorUnit = 0x1p24;

}  // namespace

void SurfaceAttributes::start(std::span<const uint64_t> masks) {
    masks_ = masks;
    first_.resize(masks.size());
    uint32_t count = 0;
    for (size_t i = 0; i < masks.size(); ++i) {
        first_[i] = count;
        count += uint32_t(std::popcount(masks[i]));
    }
    sums_.assign(count, Sum());
}

void SurfaceAttributes::take_triangle(size_t i) {
    const std::array<int64_t, 3> n = normal_of(grid_[i]);
    const Vec3d normal = {double(n[0]), double(n[1]), double(n[2])};
    const double size = normal.norm(), weight = std::min(0.5 * std::ldexp(size, -2 * grid_.bits()), kHeaviest);
    for (size_t a = 0; a < 3; ++a) normal_[a] = size > 0.0 ? std::llround(normal[int(a)] / size * weight * kNormalUnit) : 0;
    if (!attributes_.color) return;
    weight_ = std::max<int64_t>(1, std::llround(weight * kColorUnit));  // what has no area has a color
    const std::array<uint32_t, 3>& t = mesh_.triangles[grid_.source(i)];
    for (size_t k = 0; k < 3; ++k) {
        corners_voxel_[k] = grid_.frame().voxel_from_world(mesh_.positions[t[k]]);
        colors_[k] = mesh_.colors[t[k]];
    }
    // Rows of the pseudoinverse of the two edges; of a triangle without area, zero.
    const Vec3d e = corners_voxel_[1] - corners_voxel_[0], f = corners_voxel_[2] - corners_voxel_[0];
    const double ee = e.squaredNorm(), ef = e.dot(f), ff = f.squaredNorm(), det = ee * ff - ef * ef;
    if (det > 1e-12 * ee * ff) {
        to_barycentric_[1] = (ff * e - ef * f) / det;
        to_barycentric_[2] = (ee * f - ef * e) / det;
    } else {
        to_barycentric_[1] = to_barycentric_[2] = Vec3d::Zero();
    }
}

void SurfaceAttributes::add(uint32_t place, const std::array<int32_t, 3>& voxel) {
    const uint64_t mask = masks_[place >> 6];
    Sum& sum = sums_[first_[place >> 6] + uint32_t(std::popcount(mask & ((uint64_t{1} << (place & 63)) - 1)))];
    for (size_t a = 0; a < 3; ++a) sum.normal[a] += normal_[a];
    if (!attributes_.color) return;
    const Vec3d p = Vec3d(voxel[0] + 0.5, voxel[1] + 0.5, voxel[2] + 0.5) - corners_voxel_[0];
    std::array<double, 3> share = {0.0, std::max(0.0, to_barycentric_[1].dot(p)), std::max(0.0, to_barycentric_[2].dot(p))};
    share[0] = std::max(0.0, 1.0 - to_barycentric_[1].dot(p) - to_barycentric_[2].dot(p));
    const double all = share[0] + share[1] + share[2];
    for (size_t channel = 0; channel < 3; ++channel) {
        double color = 0.0;
        for (size_t k = 0; k < 3; ++k) color += share[k] / all * colors_[k][channel];
        sum.color[channel] += std::llround(color * double(weight_));
    }
    sum.weight += weight_;
}

void SurfaceAttributes::append_columns(VoxelBatch& batch) const {
    for (const Sum& sum : sums_) {
        if (attributes_.normal) {
            const Vec3d n = {double(sum.normal[0]), double(sum.normal[1]), double(sum.normal[2])};
            const double size = n.norm();
            VoxelNormal normal = {};  // triangles back to back have none
            if (size > 0.0)
                for (size_t a = 0; a < 3; ++a) normal[a] = int8_t(std::lround(127.0 * n[int(a)] / size));
            batch.normals.push_back(normal);
        }
        if (attributes_.color) {
            VoxelColor color = {};
            for (size_t a = 0; a < 3; ++a)
                color[a] = uint8_t(std::clamp<int64_t>((sum.color[a] + sum.weight / 2) / std::max<int64_t>(sum.weight, 1), 0, 255));
            batch.colors.push_back(color);
        }
    }
}

}  // namespace strata
