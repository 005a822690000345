#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/cloud/point_filter.h"
#include "core/octree/node_selection.h"
#include "render/point_color.h"
#include "render/point_normals.h"
#include "render/stream/node_cache.h"
#include "render/stream/page_loader.h"

namespace strata {

/// Nodes that were to be drawn but could not be read; the frame goes on without them.
struct LoadFailures {
    uint64_t count = 0;
    std::string first;  // of the lowest id, whatever the threads
};

/// How a cloud's nodes are read and kept.
struct ResidencySettings {
    ColorChannel color;
    std::string colormap;
    std::optional<ColorRange> range;  // none: derived from the cloud
    PointFilter filter;
    bool normals = false;  // as surfels want them
    int threads = 1;

    bool operator==(const ResidencySettings&) const = default;
};

/// What a frame draws.
struct FrameNodes {
    std::vector<NodeId> ids;            // ascending by key, parents with their children
    std::vector<ResidentNode*> points;  // [ids] the cache's, until the next frame
    std::vector<double> errors_px;      // [ids]
    uint64_t missing = 0;               // nodes of the selection, and pages below it, that are still to come
    double missing_error_px = 0.0;      // what that costs

    /// Leaves out the least wanted nodes that the points are too many by; never the root.
    void limit_points(uint64_t most);
};

/// The nodes of one cloud that are in memory, read and colored for drawing, from frame to frame.
class ResidentCloud {
public:
    /// Takes the color range from a sample of the cloud unless it is given. The cloud must outlive this.
    /// throws  Error{usage}: normals are asked for and the cloud has none
    ResidentCloud(const LayeredCloud& cloud, const ResidencySettings& settings);

    bool is_for(const LayeredCloud& cloud, const ResidencySettings& settings) const {
        return &cloud == &cloud_ && settings == settings_;
    }

    /// For frames that do not wait: adds what has arrived of the hierarchy to the cloud, before a selection, and begins to read
    /// what that selection found missing.
    void add_pages(LayeredCloud& cloud) { pages_.add_arrived(cloud); }
    void want_pages(const Selection& selection) { pages_.want(selection.pending); }

    /// Waits for the nodes of the selection until the deadline, and takes what is here. As long as some are missing, the nodes
    /// of the frame before stay where the budget has room for them. The first frame waits for the root in any case.
    /// cap_bytes  most that nodes may take in memory
    FrameNodes gather(const Selection& selection, const SelectionSettings& limits, uint64_t cap_bytes,
                      NodeCache::Clock::time_point deadline);

    LoadFailures take_failures();
    const NodeCache& cache() const { return cache_; }

private:
    const LayeredCloud& cloud_;
    ResidencySettings settings_;
    PointColorizer colors_;
    std::optional<PointNormals> normals_;
    std::vector<int> wanted_attributes_;
    std::vector<NodeId> drawn_;  // by the last frame
    NodeCache cache_;
    PageLoader pages_;
};

}  // namespace strata
