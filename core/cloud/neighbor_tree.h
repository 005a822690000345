#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/math/vec.h"

namespace strata {

/// A point among others that are searched for neighbors.
struct TreePoint {
    Vec3i position;      // quanta
    uint32_t index = 0;  // what the caller calls it
};

/// A kd-tree over points in quanta, for searches that are exact (see NeighborSearch). Boxes are tight and integer.
class NeighborTree {
public:
    struct Node {
        Vec3i min, max;               // tight, quanta
        uint32_t begin = 0, end = 0;  // of points()
        uint32_t children = 0;        // the first of two that follow each other; 0: a leaf

        bool is_leaf() const { return children == 0; }
        bool is_single_position() const { return min == max; }
    };

    /// Points of a leaf, unless all of them coincide.
    static constexpr uint32_t kLeafPoints = 32;

    /// points  any order; fewer than 2^32
    /// scale   world units per quantum, positive
    /// cost    O(n log n), whatever the distribution; 3 bytes a point beside the points
    NeighborTree(std::vector<TreePoint> points, const Vec3d& scale);

    const Vec3d& scale() const { return scale_; }
    std::span<const TreePoint> points() const { return points_; }   // those of a node lie together
    std::span<const Node> nodes() const { return nodes_; }          // the root first; none where there are no points
    std::span<const uint32_t> leaves() const { return leaves_; }    // indices of nodes; neighbors follow each other
    std::span<const TreePoint> points_of(const Node& node) const { return points().subspan(node.begin, node.end - node.begin); }

private:
    void split(uint32_t node);
    uint32_t add_node(uint32_t begin, uint32_t end);

    Vec3d scale_;
    std::vector<TreePoint> points_;
    std::vector<Node> nodes_;
    std::vector<uint32_t> leaves_;
};

/// The square of a distance in world units. Differences are taken between integers, so that it does not depend on where
/// the points lie; rounding is monotone, so that the distance of a box is never beyond that of a point in it.
inline double squared_distance(const Vec3d& quanta_apart, const Vec3d& scale) {
    const Vec3d apart = quanta_apart.cwiseProduct(scale);
    return apart.x() * apart.x() + apart.y() * apart.y() + apart.z() * apart.z();
}

inline double squared_distance(const Vec3i& a, const Vec3i& b, const Vec3d& scale) {
    return squared_distance(a.cast<double>() - b.cast<double>(), scale);
}

/// Between two boxes, ends included; 0 where they meet.
inline double squared_distance(const Vec3i& min_a, const Vec3i& max_a, const Vec3i& min_b, const Vec3i& max_b, const Vec3d& scale) {
    const Vec3d below = min_a.cast<double>() - max_b.cast<double>(), above = min_b.cast<double>() - max_a.cast<double>();
    return squared_distance(below.cwiseMax(above).cwiseMax(0.0), scale);
}

}  // namespace strata
