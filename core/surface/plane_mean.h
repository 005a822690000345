#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/simd_level.h"
#include "core/surface/near_points.h"
#include "core/surface/scalar_field.h"

namespace strata {

/// Evaluates the field of point_surface.h at the samples of a brick. All lengths are in spacings. Keeps buffers: one for each thread.
class PlaneMean {
public:
    explicit PlaneMean(float radius, SimdLevel level = best_simd_level()) : radius_(radius), level_(level), sums_(kAll * kFieldBrickSamples) {}

    /// points  within the radius of the brick, with unit normals
    /// returns  whether any value is not NaN
    bool evaluate(const NearPoints& points, std::span<float, kFieldBrickSamples> values);

private:
    // Sums over points, with weights: of normals and of weights first; then, with weights that are less the more a normal differs from their mean, of weights, of
    // points, of distances to planes, of squares of those, and of offsets.
    enum { kNormalX, kNormalY, kNormalZ, kCoherence, kAllAgree, kWeight, kCount, kDistance, kDistanceSquare, kX, kY, kZ, kAll };

    float* sums(int which) { return sums_.data() + which * kFieldBrickSamples; }
    void gather_rows(const NearPoints& points);
    void add_normals();
    void add_planes();
    static void normals_baseline(PlaneMean& mean);
    static void normals_avx2(PlaneMean& mean);
    static void planes_baseline(PlaneMean& mean);
    static void planes_avx2(PlaneMean& mean);

    // A point that reaches a row of 8 samples: the square of its distance from the row's line, its offset along that line, its normal, and what the
    // normal and the offset across it add to the distance to its plane.
    struct RowPoint {
        float square, x, nx, ny, nz, dy, dz, beside;
    };
    float radius_;
    SimdLevel level_;
    std::vector<float> sums_;
    std::vector<uint32_t> plane_;       // points that reach a plane of samples
    std::vector<RowPoint> row_points_;  // row after row
    std::array<uint32_t, kFieldBrickSide * kFieldBrickSide + 1> row_begins_;
};

}  // namespace strata
