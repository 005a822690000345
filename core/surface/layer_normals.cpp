#include "core/surface/layer_normals.h"

#include <algorithm>
#include <cstring>

#include "core/cloud/plane_fit.h"
#include "core/parallel.h"
#include "core/simd_level.h"
#include "core/simd_target.h"
#include "core/surface/near_points.h"

namespace strata {
namespace {

constexpr size_t kLanes = 8;
constexpr float kFar = 1e6f;          // spacings: beyond any radius
constexpr double kLeastWidth = 0.01;  // of what points spread across a line, relative to along it, as variances

// Of points within a radius of a place: how many, and sums of weights, of weighted offsets and of products of these; lane by lane, so that all
// instruction sets add alike.
struct Moments {
    enum { kCount, kWeight, kX, kY, kZ, kXX, kXY, kXZ, kYY, kYZ, kZZ, kAll };
    float sums[kAll][kLanes];

    double total(int which) const {
        double sum = 0.0;
        for (const float lane : sums[which]) sum += double(lane);
        return sum;
    }
};

using Lanes = float __attribute__((vector_size(4 * kLanes)));

inline __attribute__((always_inline)) void add_moments(const NearPoints& points, const Vec3f& center, float radius, Moments& moments) {
    const float scale = 1.0f / (radius * radius), cx = center.x(), cy = center.y(), cz = center.z();
    const float *const px = points.x.data(), *const py = points.y.data(), *const pz = points.z.data();
    Lanes count = {}, weight = {}, x = {}, y = {}, z = {}, xx = {}, xy = {}, xz = {}, yy = {}, yz = {}, zz = {};
    for (size_t n = 0; n < points.x.size(); n += kLanes) {
        Lanes dx, dy, dz;
        std::memcpy(&dx, px + n, sizeof dx);
        std::memcpy(&dy, py + n, sizeof dy);
        std::memcpy(&dz, pz + n, sizeof dz);
        dx -= cx, dy -= cy, dz -= cz;
        const Lanes rest = 1.0f - (dx * dx + dy * dy + dz * dz) * scale, w = rest > 0.0f ? rest : Lanes{}, wx = w * dx, wy = w * dy, wz = w * dz;
        count += w > 0.0f ? Lanes{} + 1.0f : Lanes{};
        weight += w;
        x += wx, y += wy, z += wz;
        xx += wx * dx, xy += wx * dy, xz += wx * dz, yy += wy * dy, yz += wy * dz, zz += wz * dz;
    }
    const Lanes all[Moments::kAll] = {count, weight, x, y, z, xx, xy, xz, yy, yz, zz};
    std::memcpy(moments.sums, all, sizeof all);
}
STRATA_KERNEL_BASELINE void moments_baseline(const NearPoints& points, const Vec3f& center, float radius, Moments& moments) { add_moments(points, center, radius, moments); }
STRATA_KERNEL_AVX2 void moments_avx2(const NearPoints& points, const Vec3f& center, float radius, Moments& moments) { add_moments(points, center, radius, moments); }

Vec3f normal_of(const Moments& m) {
    const double weight = m.total(Moments::kWeight);
    if (m.total(Moments::kCount) < double(kLeastPoints)) return Vec3f::Zero();
    const Vec3d mean = Vec3d(m.total(Moments::kX), m.total(Moments::kY), m.total(Moments::kZ)) / weight;
    Mat3d spread;
    spread << m.total(Moments::kXX), m.total(Moments::kXY), m.total(Moments::kXZ), 0.0, m.total(Moments::kYY), m.total(Moments::kYZ), 0.0, 0.0, m.total(Moments::kZZ);
    spread = spread / weight - mean * mean.transpose();
    const SymmetricEigen eigen = symmetric_eigen(spread);
    if (!(eigen.values[1] > kLeastWidth * eigen.values[2])) return Vec3f::Zero();
    return eigen.vectors.col(0).cast<float>();
}

}  // namespace

std::vector<Vec3f> layer_normals(const std::array<const PointLayer*, 3>& layers, float radius, int threads, SimdLevel level) {
    const PointLayer& layer = *layers[1];
    std::vector<Vec3f> normals(layer.points());
    const auto add = level == SimdLevel::baseline ? moments_baseline : moments_avx2;
    parallel_blocks(threads, layer.corners.size(), 16, [&](size_t begin, size_t end) {
        NearPoints near;
        for (size_t b = begin; b < end; ++b) {
            near.gather(layers, layer.corners[b], radius, false);
            while (near.x.size() % kLanes != 0) near.x.push_back(kFar), near.y.push_back(kFar), near.z.push_back(kFar);
            for (uint32_t p = layer.begins[b]; p < layer.begins[b + 1]; ++p) {
                Moments moments;
                add(near, layer.places[p], radius, moments);
                normals[p] = normal_of(moments);
            }
        }
    });
    return normals;
}

}  // namespace strata
