#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "core/cloud/neighbor_tree.h"

namespace strata {

/// The points nearest to one position.
struct Neighborhood {
    Vec3i center = Vec3i::Zero();
    std::span<const Vec3i> points;  // in no order; the center's own among them where it is a point of the tree
    double radius_squared = 0.0;    // of the farthest, world units
};

/// Finds the k nearest of a tree's points. Of points equally far, those of lesser (x, y, z) are nearer, so that the
/// answer depends on the points alone: neither on how the tree is cut nor on what was asked before.
/// Keeps buffers; one for each thread. An answer holds until the next question.
class NeighborSearch {
public:
    /// k  >= 1; where the tree has fewer points, all of them are neighbors
    NeighborSearch(const NeighborTree& tree, uint32_t k);

    /// Around any position.
    /// known          points that are neighbors besides those of the tree
    /// bound_squared  points farther than that are left out
    Neighborhood nearest(const Vec3i& center, std::span<const Vec3i> known = {},
                         double bound_squared = std::numeric_limits<double>::infinity());

    /// Around a leaf's points, one after the other: start, then ask for each. Twice as fast as `nearest`.
    void start_leaf(const NeighborTree::Node& leaf);
    Neighborhood nearest_in_leaf(const Vec3i& center);

private:
    struct Neighbor {
        double distance_squared;
        Vec3i position;
        bool operator<(const Neighbor& other) const;
    };
    static constexpr size_t kMostCandidates = 1536;

    void gather(double reach_squared);
    void drop_far_candidates();
    Vec3f unit_scale() const;
    float float_limit(double bound_squared) const;
    void measure(const Vec3i& center);
    bool select(const Vec3i& center, double bound_squared);
    void keep_nearest(double bound_squared);
    void break_ties();
    void offer(const Vec3i& center, const Vec3i& position);
    void search(const Vec3i& center, uint32_t node);
    double farthest() const { return nearest_.size() < k_ ? bound_squared_ : nearest_.front().distance_squared; }
    Neighborhood found(const Vec3i& center);

    const NeighborTree& tree_;
    uint32_t k_;
    std::vector<Neighbor> nearest_;  // a heap, the farthest first
    double bound_squared_ = 0.0;
    std::vector<Vec3i> positions_;
    Neighborhood answer_;

    // Of the leaf: all points within reach of its box are candidates. Floats are relative to its lowest corner and exact.
    const NeighborTree::Node* leaf_ = nullptr;
    bool gathered_ = false;
    double reach_squared_ = 0.0, widest_squared_ = 0.0, guess_squared_ = 0.0;
    uint32_t misses_ = 0;  // points whose neighbors lie beyond the reach
    double radius_sum_ = 0.0;
    uint32_t radius_count_ = 0;
    std::vector<Vec3i> candidates_;
    std::array<std::vector<float>, 3> local_;  // [axis][kMostCandidates]
    std::vector<float> distances_;             // squares, in the largest scale
    std::vector<uint32_t> chosen_;             // of the candidates, those within a bound
    std::vector<double> squares_;              // exact squares of their distances
    size_t chosen_count_ = 0;
    std::vector<uint32_t> stack_;
};

/// Calls visit for every point of the tree, from several threads at once; those of a leaf one after the other.
void for_each_neighborhood(const NeighborTree& tree, uint32_t k, int threads,
                           const std::function<void(const TreePoint& point, const Neighborhood& neighbors)>& visit);

}  // namespace strata
