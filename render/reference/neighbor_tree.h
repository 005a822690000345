#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/math/vec.h"

namespace strata {

/// Exact nearest neighbors among points of any density, in double precision: a balanced k-d tree, a point at each split.
class NeighborTree {
public:
    struct Neighbor {
        double square;  // squared distance
        uint32_t point;
        bool operator<(const Neighbor& other) const {
            return square < other.square || (square == other.square && point < other.point);
        }
    };

    /// points  copied; fewer than 2^32
    /// cost    O(n log^2 n) time, 29 bytes a point
    NeighborTree(std::span<const Vec3d> points, int threads);

    /// The `count` points nearest to p, the nearest first; ties go to the lower index. Fewer where there are not so many.
    /// out  kept by the caller, so that many queries need no memory of their own
    void nearest(const Vec3d& p, size_t count, std::vector<Neighbor>& out) const;

private:
    size_t split(size_t begin, size_t end);
    void build(size_t begin, size_t end);
    void visit(size_t begin, size_t end, const Vec3d& p, size_t count, std::vector<Neighbor>& heap) const;

    std::vector<Vec3d> points_;     // in the order of the tree
    std::vector<uint32_t> order_;   // index of each among the points as given
    std::vector<uint8_t> axes_;     // of the split at each point
};

}  // namespace strata
