#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/octree/layered_cloud.h"

namespace strata {

struct ValidationSettings {
    std::string name = {};     // of the cloud, for messages; may be empty
    bool read_points = false;  // decode every node too, not only the hierarchy
    int threads = 1;
};

/// A layered cloud as it was found.
struct LayeredSummary {
    uint64_t nodes = 0;
    uint64_t points = 0;
    uint64_t point_bytes = 0;  // stored
    std::vector<uint64_t> nodes_per_level, points_per_level;
};

/// Loads the whole hierarchy and checks it: children lie in their parents' octants, byte ranges do not overlap, the
/// nodes hold as many points as the cloud states. With read_points each node is decoded as well, and each of its points
/// must lie in the node's cube, up to one quantum: writers compare before or after they round.
/// throws  Error{malformed} naming the first fault, whatever the number of threads; Error as the cloud throws
/// cost    memory for one node a thread, and the hierarchy
LayeredSummary validate_layered(LayeredCloud& cloud, const ValidationSettings& settings);

}  // namespace strata
