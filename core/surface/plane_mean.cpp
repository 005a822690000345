#include "core/surface/plane_mean.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/simd_target.h"

namespace strata {
namespace {

constexpr int kSide = kFieldBrickSide;
// Of the radius: how far the mean of the points may lie beside a sample. It lies 0.24 beside one at a straight edge of what they cover.
constexpr float kMostBeside = 0.5f;
// Likewise: the standard deviation of distances to planes. Between two sheets of the same side it is half of what is between them.
constexpr float kMostSpread = 0.35f;
// Of the sum of normals, where they agree fully: where they look both ways, as in the middle of a plate, none is asked which side a sample is on;
// and between two of them the field goes from planes, which keep edges sharp, to what keeps spheres (evaluate).
constexpr float kLeastCoherence = 0.05f, kSharp = 0.9f, kRound = 0.97f;
// Spacings: a cell that the surface crosses has no corner farther from it than 1.73. Beyond, nothing is gained, and between two sheets of the same
// side, one behind the other, the field would change sign.
constexpr float kMostDistance = 2.0f;
constexpr float kLeastPoints = 3.5f;  // 4, as counted in floats

inline __attribute__((always_inline)) float weight_of(float square) {
    const float rest = std::max(0.0f, 1.0f - square), rest_square = rest * rest;
    return rest_square * rest_square;
}

}  // namespace

// Calls row(point, first sample of the row, offsets along j and k from the point, what these leave of 1) for rows of 8 samples within reach.
template <typename Row>
inline __attribute__((always_inline)) void PlaneMean::for_rows(const NearPoints& points, const Row& row) const {
    const float radius_square = radius_ * radius_;
    for (size_t p = 0; p < points.size(); ++p) {
        const float y = points.y[p], z = points.z[p];
        const int first_k = std::max(int(std::ceil(z - radius_)), 0), last_k = std::min(int(std::floor(z + radius_)), kSide - 1);
        const int first_j = std::max(int(std::ceil(y - radius_)), 0), last_j = std::min(int(std::floor(y + radius_)), kSide - 1);
        for (int k = first_k; k <= last_k; ++k)
            for (int j = first_j; j <= last_j; ++j) {
                const float dy = float(j) - y, dz = float(k) - z, square = dy * dy + dz * dz;
                if (square < radius_square) row(p, size_t(k * kSide + j) * kSide, dy, dz, square);
            }
    }
}

inline __attribute__((always_inline)) void PlaneMean::add_normals(const NearPoints& points) {
    const float scale = 1.0f / (radius_ * radius_);
    float *const sx = sums(kNormalX), *const sy = sums(kNormalY), *const sz = sums(kNormalZ), *const sw = sums(kCoherence);
    for_rows(points, [&](size_t p, size_t first, float, float, float square) {
        const float x = points.x[p];
        const Vec3f& n = points.normals[p];
        const float nx = n.x(), ny = n.y(), nz = n.z();
        for (int i = 0; i < kSide; ++i) {
            const float dx = float(i) - x, w = weight_of((dx * dx + square) * scale);
            sx[first + size_t(i)] += w * nx;
            sy[first + size_t(i)] += w * ny;
            sz[first + size_t(i)] += w * nz;
            sw[first + size_t(i)] += w;
        }
    });
}

inline __attribute__((always_inline)) void PlaneMean::add_planes(const NearPoints& points) {
    const float scale = 1.0f / (radius_ * radius_);
    const float *const mx = sums(kNormalX), *const my = sums(kNormalY), *const mz = sums(kNormalZ), *const all = sums(kAllAgree);
    float *const sw = sums(kWeight), *const sn = sums(kCount), *const sd = sums(kDistance), *const sdd = sums(kDistanceSquare), *const sx = sums(kX), *const sy = sums(kY),
                 *const sz = sums(kZ);
    for_rows(points, [&](size_t p, size_t first, float dy, float dz, float square) {
        const float x = points.x[p];
        const Vec3f& n = points.normals[p];
        const float nx = n.x(), ny = n.y(), nz = n.z(), beside = ny * dy + nz * dz;
        for (int i = 0; i < kSide; ++i) {
            const size_t at = first + size_t(i);
            const float dx = float(i) - x;
            const float agreement = std::max(0.0f, all[at] + mx[at] * nx + my[at] * ny + mz[at] * nz);
            const float w = weight_of((dx * dx + square) * scale) * agreement * agreement;
            const float d = nx * dx + beside;
            sw[at] += w;
            sn[at] += w > 0.0f ? 1.0f : 0.0f;
            sd[at] += w * d;
            sdd[at] += w * d * d;
            sx[at] += w * dx;
            sy[at] += w * dy;
            sz[at] += w * dz;
        }
    });
}

STRATA_KERNEL_BASELINE void PlaneMean::normals_baseline(PlaneMean& mean, const NearPoints& points) { mean.add_normals(points); }
STRATA_KERNEL_AVX2 void PlaneMean::normals_avx2(PlaneMean& mean, const NearPoints& points) { mean.add_normals(points); }
STRATA_KERNEL_BASELINE void PlaneMean::planes_baseline(PlaneMean& mean, const NearPoints& points) { mean.add_planes(points); }
STRATA_KERNEL_AVX2 void PlaneMean::planes_avx2(PlaneMean& mean, const NearPoints& points) { mean.add_planes(points); }

bool PlaneMean::evaluate(const NearPoints& points, std::span<float, kFieldBrickSamples> values) {
    const float unknown = std::numeric_limits<float>::quiet_NaN();
    if (points.size() < 3) {
        std::fill(values.begin(), values.end(), unknown);
        return false;
    }
    std::fill(sums_.begin(), sums_.end(), 0.0f);
    const bool wide = level_ != SimdLevel::baseline;
    (wide ? normals_avx2 : normals_baseline)(*this, points);
    float *const mx = sums(kNormalX), *const my = sums(kNormalY), *const mz = sums(kNormalZ), *const coherence = sums(kCoherence), *const all = sums(kAllAgree);
    for (int n = 0; n < kFieldBrickSamples; ++n) {
        const float length = std::sqrt(mx[n] * mx[n] + my[n] * my[n] + mz[n] * mz[n]);
        coherence[n] = length > 0.0f ? length / coherence[n] : 0.0f;
        const float scale = coherence[n] > kLeastCoherence ? 1.0f / length : 0.0f;
        all[n] = scale > 0.0f ? 0.0f : 1.0f;
        mx[n] *= scale;
        my[n] *= scale;
        mz[n] *= scale;
    }
    (wide ? planes_avx2 : planes_baseline)(*this, points);
    const float *const sw = sums(kWeight), *const sn = sums(kCount), *const sd = sums(kDistance), *const sdd = sums(kDistanceSquare), *const sx = sums(kX), *const sy = sums(kY),
                       *const sz = sums(kZ);
    const float most_beside = kMostBeside * radius_, most_spread = kMostSpread * radius_;
    bool any = false;
    for (int n = 0; n < kFieldBrickSamples; ++n) {
        values[size_t(n)] = unknown;
        if (!(sw[n] > 0.0f) || sn[n] < kLeastPoints) continue;
        const float f = sd[n] / sw[n], spread_square = sdd[n] / sw[n] - f * f;
        const Vec3f offset = Vec3f(sx[n], sy[n], sz[n]) / sw[n], normal(mx[n], my[n], mz[n]);
        const float along = offset.dot(normal), beside_square = offset.squaredNorm() - along * along;
        if (beside_square > most_beside * most_beside || spread_square > most_spread * most_spread) continue;
        // Twice the distance to a sphere through points with normals, from a place with its own, is the sum of both normals along the offset.
        const float round = std::clamp((coherence[n] - kSharp) / (kRound - kSharp), 0.0f, 1.0f);
        const float distance = f + 0.5f * round * (along - f);
        if (std::abs(distance) > kMostDistance) continue;
        values[size_t(n)] = distance;
        any = true;
    }
    return any;
}

}  // namespace strata
