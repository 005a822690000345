#pragma once

#include <cstdint>
#include <span>
#include <tuple>
#include <vector>

#include "core/math/quantization.h"
#include "core/math/vec.h"

namespace strata {

/// Exact nearest neighbors among points in quanta, up to a reach: a hash grid with cells of half the reach.
class NeighborGrid {
public:
    /// points  kept by the caller, unchanged, while the grid is used; fewer than 2^32
    /// scale   world units a quantum
    /// reach   world units, positive
    /// cost    O(n log n) time, 32 bytes a point
    NeighborGrid(std::span<const Vec3i> points, const Vec3d& scale, double reach);

    static constexpr size_t kNobody = ~size_t{0};

    /// Distance in world units from `p` to the nearest point, at most `reach`. Safe from several threads.
    /// skip  index of a point that does not count: `p` itself
    double distance(const Vec3i& p, size_t skip = kNobody) const;

private:
    using Cell = Eigen::Matrix<int64_t, 3, 1>;
    struct Entry {
        uint64_t hash;
        uint32_t point;
        bool operator<(const Entry& other) const { return std::tie(hash, point) < std::tie(other.hash, other.point); }
    };

    Cell cell_of(const Vec3i& p) const;
    std::span<const Entry> entries_of(uint64_t hash) const;

    std::span<const Vec3i> points_;
    Vec3d scale_;
    double reach_, cell_side_;
    std::vector<Entry> entries_;   // sorted; cells that share a hash share a run, which costs time but no truth
    std::vector<uint32_t> table_;  // open addressing: 1 + index of a run's first entry, 0 where free
};

}  // namespace strata
