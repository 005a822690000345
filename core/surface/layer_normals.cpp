#include "core/surface/layer_normals.h"

#include <algorithm>

#include "core/cloud/plane_fit.h"
#include "core/parallel.h"
#include "core/simd_level.h"
#include "core/simd_target.h"
#include "core/surface/near_points.h"

namespace strata {
namespace {

constexpr size_t kLanes = 8;
constexpr float kFar = 1e6f;            // spacings: beyond any radius
constexpr double kLeastNeighbors = 3.5; // 4, as counted in floats
constexpr double kLeastWidth = 0.01;    // of what points spread across a line, relative to along it, as variances

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

inline __attribute__((always_inline)) void add_moments(const NearPoints& points, const Vec3f& center, float radius, Moments& moments) {
    Moments m = {};
    const float scale = 1.0f / (radius * radius);
    const float *const x = points.x.data(), *const y = points.y.data(), *const z = points.z.data();
    const float cx = center.x(), cy = center.y(), cz = center.z();
    for (size_t n = 0; n < points.x.size(); n += kLanes)
        for (size_t lane = 0; lane < kLanes; ++lane) {
            const float dx = x[n + lane] - cx, dy = y[n + lane] - cy, dz = z[n + lane] - cz;
            const float w = std::max(0.0f, 1.0f - (dx * dx + dy * dy + dz * dz) * scale);
            const float wx = w * dx, wy = w * dy, wz = w * dz;
            m.sums[Moments::kCount][lane] += w > 0.0f ? 1.0f : 0.0f;
            m.sums[Moments::kWeight][lane] += w;
            m.sums[Moments::kX][lane] += wx;
            m.sums[Moments::kY][lane] += wy;
            m.sums[Moments::kZ][lane] += wz;
            m.sums[Moments::kXX][lane] += wx * dx;
            m.sums[Moments::kXY][lane] += wx * dy;
            m.sums[Moments::kXZ][lane] += wx * dz;
            m.sums[Moments::kYY][lane] += wy * dy;
            m.sums[Moments::kYZ][lane] += wy * dz;
            m.sums[Moments::kZZ][lane] += wz * dz;
        }
    moments = m;
}
STRATA_KERNEL_BASELINE void moments_baseline(const NearPoints& points, const Vec3f& center, float radius, Moments& moments) { add_moments(points, center, radius, moments); }
STRATA_KERNEL_AVX2 void moments_avx2(const NearPoints& points, const Vec3f& center, float radius, Moments& moments) { add_moments(points, center, radius, moments); }

Vec3f normal_of(const Moments& m) {
    const double weight = m.total(Moments::kWeight);
    if (m.total(Moments::kCount) < kLeastNeighbors) return Vec3f::Zero();
    const Vec3d mean = Vec3d(m.total(Moments::kX), m.total(Moments::kY), m.total(Moments::kZ)) / weight;
    Mat3d spread;
    spread << m.total(Moments::kXX), m.total(Moments::kXY), m.total(Moments::kXZ), 0.0, m.total(Moments::kYY), m.total(Moments::kYZ), 0.0, 0.0, m.total(Moments::kZZ);
    spread = spread / weight - mean * mean.transpose();
    const SymmetricEigen eigen = symmetric_eigen(spread);
    if (!(eigen.values[1] > kLeastWidth * eigen.values[2])) return Vec3f::Zero();
    return eigen.vectors.col(0).cast<float>();
}

}  // namespace

std::vector<Vec3f> layer_normals(const std::array<const PointLayer*, 3>& layers, float radius, int threads) {
    const PointLayer& layer = *layers[1];
    std::vector<Vec3f> normals(layer.points());
    const auto add = best_simd_level() == SimdLevel::baseline ? moments_baseline : moments_avx2;
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
