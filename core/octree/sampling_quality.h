#pragma once

#include <cstdint>
#include <vector>

#include "core/octree/layered_cloud.h"

namespace strata {

/// How evenly one level of an additive layered cloud is sampled. Distances are in units of the level's spacing.
///
/// kept at level l     the points of inner nodes of levels 0 to l (leaves hold what is left and are no sample)
/// removed at level l  the points below inner nodes of level l: what a picture of levels 0 to l leaves out
/// A kept point counts for level l where it lies in the cube of an inner node of level l; elsewhere the tree ends
/// above, and nothing was left out. Neighbors are sought among all kept points, across the borders of nodes.
struct LevelSampling {
    uint32_t level = 0;
    double spacing = 0.0;         // world units
    uint64_t inner_nodes = 0;     // of this level
    uint64_t measured_nodes = 0;  // of those; fewer where the budget did not reach
    uint64_t kept_points = 0;     // measured
    uint64_t removed_points = 0;  // measured
    uint64_t removed_total = 0;   // below all inner nodes of this level
    double reach = 0.0;           // distances beyond it count as it: kSamplingReach, or a node's side where that is less
    // From a kept point to the nearest other: 1 and more where no two are nearer than the spacing. NaN: none measured.
    double neighbor_min = 0.0, neighbor_p5 = 0.0, neighbor_median = 0.0;
    // From a removed point to the nearest kept one: at most 1 where the sample is maximal. NaN: none measured.
    double coverage_p99 = 0.0, coverage_max = 0.0;
};

inline constexpr double kSamplingReach = 4.0;  // spacings

struct SamplingSettings {
    uint64_t point_budget = 4'000'000;  // about the most kept and the most removed points of a level: 64 bytes each
    int threads = 1;
};

/// Measures every level that has inner nodes. A level too large for the budget is measured on nodes picked by a hash of
/// their keys, the same in every run; around those the sample is complete, so each distance is exact all the same.
/// Loads the whole hierarchy.
/// throws  whatever the cloud throws
std::vector<LevelSampling> measure_sampling(LayeredCloud& cloud, const SamplingSettings& settings);

}  // namespace strata
