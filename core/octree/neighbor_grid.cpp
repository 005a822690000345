#include "core/octree/neighbor_grid.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/math/random.h"

namespace strata {
namespace {

constexpr int64_t kRings = 2;  // of cells around a point's own: together they hold all points within the reach

uint64_t hash_cell(int64_t x, int64_t y, int64_t z) {
    return mix_bits(mix_bits(mix_bits(uint64_t(x)) ^ uint64_t(y)) ^ uint64_t(z));
}

}  // namespace

NeighborGrid::NeighborGrid(std::span<const Vec3i> points, const Vec3d& scale, double reach)
    : points_(points), scale_(scale), reach_(reach), cell_side_(reach / double(kRings)) {
    entries_.resize(points.size());
    for (size_t i = 0; i < points.size(); ++i) {
        const Cell cell = cell_of(points[i]);
        entries_[i] = {hash_cell(cell.x(), cell.y(), cell.z()), uint32_t(i)};
    }
    std::sort(entries_.begin(), entries_.end());
    table_.resize(std::bit_ceil(2 * points.size() + 1));
    const size_t mask = table_.size() - 1;
    for (size_t i = 0; i < entries_.size(); ++i) {
        if (i > 0 && entries_[i].hash == entries_[i - 1].hash) continue;
        size_t slot = entries_[i].hash & mask;
        while (table_[slot] != 0) slot = (slot + 1) & mask;
        table_[slot] = uint32_t(i + 1);
    }
}

NeighborGrid::Cell NeighborGrid::cell_of(const Vec3i& p) const {
    const Vec3d at = p.cast<double>().cwiseProduct(scale_) / cell_side_;
    return at.array().floor().max(-0x1p60).min(0x1p60).cast<int64_t>();
}

std::span<const NeighborGrid::Entry> NeighborGrid::entries_of(uint64_t hash) const {
    const size_t mask = table_.size() - 1;
    for (size_t slot = hash & mask; table_[slot] != 0; slot = (slot + 1) & mask) {
        const size_t begin = table_[slot] - 1;
        if (entries_[begin].hash != hash) continue;
        size_t end = begin + 1;
        while (end < entries_.size() && entries_[end].hash == hash) ++end;
        return std::span(entries_).subspan(begin, end - begin);
    }
    return {};
}

double NeighborGrid::distance(const Vec3i& p, size_t skip) const {
    const Vec3d world = p.cast<double>().cwiseProduct(scale_);
    const Cell own = cell_of(p);
    double best = reach_ * reach_;
    const auto axis_gap = [&](int axis, int64_t step) {  // from p to the nearest border of a cell `step` cells away
        if (step == 0) return 0.0;
        const double border = double(own[axis] + (step > 0 ? step : step + 1)) * cell_side_;
        return std::max(0.0, step > 0 ? border - world[axis] : world[axis] - border);
    };
    const auto search = [&](int64_t dx, int64_t dy, int64_t dz) {
        const Vec3d gap(axis_gap(0, dx), axis_gap(1, dy), axis_gap(2, dz));
        if (gap.squaredNorm() > best) return;
        for (const Entry& entry : entries_of(hash_cell(own.x() + dx, own.y() + dy, own.z() + dz))) {
            if (entry.point == skip) continue;
            const Eigen::Matrix<int64_t, 3, 1> apart = points_[entry.point].cast<int64_t>() - p.cast<int64_t>();
            best = std::min(best, apart.cast<double>().cwiseProduct(scale_).squaredNorm());
        }
    };
    for (int64_t ring = 0; ring <= kRings; ++ring)
        for (int64_t dx = -ring; dx <= ring; ++dx)
            for (int64_t dy = -ring; dy <= ring; ++dy) {
                const bool side = std::max(std::abs(dx), std::abs(dy)) == ring;
                for (int64_t dz = -ring; dz <= ring; dz += side ? 1 : std::max<int64_t>(2 * ring, 1)) search(dx, dy, dz);
            }
    return std::sqrt(best);
}

}  // namespace strata
