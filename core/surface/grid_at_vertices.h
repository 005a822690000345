#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/surface/scalar_field.h"
#include "core/surface/vertex_values.h"

namespace strata {

/// Where places of the world lie among the samples of a grid.
class PlacesInGrid {
public:
    explicit PlacesInGrid(const GridPlacement& placement);

    /// In steps along the grid's axes; what is within the rounding of positions to float of a sample's coordinate is that coordinate, so that
    /// a vertex on an edge of the same grid lies between the two samples of that edge and no others.
    Vec3d index_of(const Vec3d& origin, const Vec3f& position) const;

private:
    Vec3d origin_;
    Mat3d from_world_, reach_;  // reach_: entries without signs
};

/// The samples around a place that have a weight in its trilinear interpolant: visit(int64 i, j, k, weight).
template <typename Visit>
void visit_corners(const Vec3d& index, const Visit& visit) {
    std::array<int64_t, 3> least;
    Vec3d part;
    for (int axis = 0; axis < 3; ++axis) {
        const double floor = std::floor(index[axis]);
        least[size_t(axis)] = int64_t(floor);
        part[axis] = index[axis] - floor;
    }
    for (int corner = 0; corner < 8; ++corner) {
        double weight = 1.0;
        for (int axis = 0; axis < 3; ++axis) weight *= corner >> axis & 1 ? part[axis] : 1.0 - part[axis];
        if (weight > 0.0) visit(least[0] + (corner & 1), least[1] + (corner >> 1 & 1), least[2] + (corner >> 2), weight);
    }
}

/// The trilinear interpolant, NaN where a sample with a weight is.
/// sample  (int64 i, j, k) -> float
template <typename Sample>
float trilinear_at(const Vec3d& index, const Sample& sample) {
    double sum = 0.0;
    visit_corners(index, [&](int64_t i, int64_t j, int64_t k, double weight) { sum += weight * double(sample(i, j, k)); });
    return float(sum);
}

/// Values of a grid, trilinear between samples; up to half a step beyond the outermost ones their values, farther out NaN.
/// source  read slice by slice as the surface comes, for vertices that come in ascending k but for rounding, as those of a surface of
///         another field on the same grid; must outlive it
/// cost    two slices of floats; 20 nanoseconds a vertex
class SlicesAtVertices : public ValuesAtVertices {
public:
    explicit SlicesAtVertices(SliceSource& source, int threads = 1);
    static uint64_t memory_bytes(const std::array<uint32_t, 3>& size) { return uint64_t{size[0]} * size[1] * 2 * sizeof(float); }

    void look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<float> out) override;
    void finish() override;

private:
    void move_to(uint32_t slice);

    SliceSource& source_;
    PlacesInGrid places_;
    int threads_;
    uint32_t slice_ = 0, read_ = 0;  // the first of the two that are held; slices read
    std::array<std::vector<float>, 2> held_;
    std::vector<Vec3d> indices_;
};

/// The same of samples in memory, for vertices in any order.
class GridAtVertices : public ValuesAtVertices {
public:
    /// Reads all slices.
    /// throws  what the source throws; Error{limit}: more memory than allowed
    GridAtVertices(SliceSource& source, uint64_t memory_bytes, int threads = 1);

    void look_up(const Vec3d& origin, std::span<const Vec3f> positions, std::span<float> out) override;

private:
    std::array<uint32_t, 3> size_;
    PlacesInGrid places_;
    int threads_;
    std::vector<float> values_;
};

/// Whether two grids have their samples at the same places, to 1/10,000 of a step.
bool is_same_grid(const SliceSource& a, const SliceSource& b);

}  // namespace strata
