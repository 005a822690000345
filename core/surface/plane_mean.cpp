#include "core/surface/plane_mean.h"

#include <algorithm>
#include <cmath>
#include <cstring>
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

// A row of 8 samples.
static_assert(kFieldBrickSide == 8);
using Row = float __attribute__((vector_size(32)));
constexpr Row kAlong = {0, 1, 2, 3, 4, 5, 6, 7};

#define STRATA_INLINE inline __attribute__((always_inline))

STRATA_INLINE void load(Row& row, const float* from) { std::memcpy(&row, from, sizeof row); }
STRATA_INLINE void store(const Row& row, float* to) { std::memcpy(to, &row, sizeof row); }

}  // namespace

// By row, as sums over a row stay in registers then. In the order of the points.
void PlaneMean::gather_rows(const NearPoints& points) {
    const float radius_square = radius_ * radius_;
    row_points_.clear();
    for (size_t k = 0; k < kSide; ++k) {
        plane_.clear();
        for (size_t p = 0; p < points.size(); ++p)
            if (std::abs(float(k) - points.z[p]) < radius_) plane_.push_back(uint32_t(p));
        for (size_t j = 0; j < kSide; ++j) {
            row_begins_[k * kSide + j] = uint32_t(row_points_.size());
            for (const uint32_t p : plane_) {
                const float dy = float(j) - points.y[p], dz = float(k) - points.z[p], square = dy * dy + dz * dz;
                if (square >= radius_square) continue;
                const Vec3f& n = points.normals[p];
                row_points_.push_back({square, points.x[p], n.x(), n.y(), n.z(), dy, dz, n.y() * dy + n.z() * dz});
            }
        }
    }
    row_begins_[kSide * kSide] = uint32_t(row_points_.size());
}

STRATA_INLINE void PlaneMean::add_normals() {
    const float scale = 1.0f / (radius_ * radius_);
    for (size_t row = 0; row < kSide * kSide; ++row) {
        Row sx = {}, sy = {}, sz = {}, sw = {};
        for (size_t p = row_begins_[row]; p < row_begins_[row + 1]; ++p) {
            const RowPoint& point = row_points_[p];
            const Row dx = kAlong - point.x, rest = 1.0f - (dx * dx + point.square) * scale, kept = rest > 0.0f ? rest : Row{}, square = kept * kept, w = square * square;
            sx += w * point.nx;
            sy += w * point.ny;
            sz += w * point.nz;
            sw += w;
        }
        store(sx, sums(kNormalX) + row * kSide);
        store(sy, sums(kNormalY) + row * kSide);
        store(sz, sums(kNormalZ) + row * kSide);
        store(sw, sums(kCoherence) + row * kSide);
    }
}

STRATA_INLINE void PlaneMean::add_planes() {
    const float scale = 1.0f / (radius_ * radius_);
    for (size_t row = 0; row < kSide * kSide; ++row) {
        Row mx, my, mz, all, sw = {}, sn = {}, sd = {}, sdd = {}, sx = {}, sy = {}, sz = {};
        load(mx, sums(kNormalX) + row * kSide);
        load(my, sums(kNormalY) + row * kSide);
        load(mz, sums(kNormalZ) + row * kSide);
        load(all, sums(kAllAgree) + row * kSide);
        for (size_t p = row_begins_[row]; p < row_begins_[row + 1]; ++p) {
            const RowPoint& point = row_points_[p];
            const Row dx = kAlong - point.x, rest = 1.0f - (dx * dx + point.square) * scale, kept = rest > 0.0f ? rest : Row{}, square = kept * kept;
            const Row agreement = all + mx * point.nx + my * point.ny + mz * point.nz, agreed = agreement > 0.0f ? agreement : Row{};
            const Row w = square * square * (agreed * agreed), d = dx * point.nx + point.beside, wd = w * d;
            sw += w;
            sn += w > 0.0f ? Row{} + 1.0f : Row{};
            sd += wd;
            sdd += wd * d;
            sx += w * dx;
            sy += w * point.dy;
            sz += w * point.dz;
        }
        store(sw, sums(kWeight) + row * kSide);
        store(sn, sums(kCount) + row * kSide);
        store(sd, sums(kDistance) + row * kSide);
        store(sdd, sums(kDistanceSquare) + row * kSide);
        store(sx, sums(kX) + row * kSide);
        store(sy, sums(kY) + row * kSide);
        store(sz, sums(kZ) + row * kSide);
    }
}

STRATA_KERNEL_BASELINE void PlaneMean::normals_baseline(PlaneMean& mean) { mean.add_normals(); }
STRATA_KERNEL_AVX2 void PlaneMean::normals_avx2(PlaneMean& mean) { mean.add_normals(); }
STRATA_KERNEL_BASELINE void PlaneMean::planes_baseline(PlaneMean& mean) { mean.add_planes(); }
STRATA_KERNEL_AVX2 void PlaneMean::planes_avx2(PlaneMean& mean) { mean.add_planes(); }

bool PlaneMean::evaluate(const NearPoints& points, std::span<float, kFieldBrickSamples> values) {
    const float unknown = std::numeric_limits<float>::quiet_NaN();
    if (points.size() < size_t{kLeastPoints}) {
        std::fill(values.begin(), values.end(), unknown);
        return false;
    }
    gather_rows(points);
    const bool wide = level_ != SimdLevel::baseline;
    (wide ? normals_avx2 : normals_baseline)(*this);
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
    (wide ? planes_avx2 : planes_baseline)(*this);
    const float *const sw = sums(kWeight), *const sn = sums(kCount), *const sd = sums(kDistance), *const sdd = sums(kDistanceSquare), *const sx = sums(kX), *const sy = sums(kY),
                       *const sz = sums(kZ);
    const float most_beside = kMostBeside * radius_, most_spread = kMostSpread * radius_;
    bool any = false;
    for (int n = 0; n < kFieldBrickSamples; ++n) {
        values[size_t(n)] = unknown;
        if (!(sw[n] > 0.0f) || sn[n] < float(kLeastPoints)) continue;
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
