#pragma once

#include <cstdint>
#include <vector>

#include "core/cloud/clip_box.h"
#include "core/math/camera.h"
#include "core/octree/layered_cloud.h"

namespace strata {

struct SelectionSettings {
    double error_px = 1.0;             // refine until what is left out lies within this many pixels of a drawn point
    uint64_t point_budget = 20'000'000;
    uint64_t memory_bytes = ~uint64_t{0};  // that the drawn nodes may take
    uint64_t node_bytes = 0, point_bytes = 1, cut_point_bytes = 0;  // what they take; the last in nodes that are cut in part
    bool load_pages = true;  // of the hierarchy, where the view goes; false: nodes whose children are pending are not refined
    const ClipRegion* clip = nullptr;  // nodes that it leaves nothing of are neither drawn nor refined
};

/// What stopped the refinement of a view. Selection knows no time: whoever draws may.
enum class BoundBy { error, budget, memory, time };

/// The nodes to draw for a view.
struct Selection {
    std::vector<NodeId> nodes;  // ascending by key; parents always come with their children
    std::vector<double> errors_px;  // [nodes] what leaving the node out costs: less than its parent; infinite at the root
    uint64_t cut_bytes = 0;  // of the memory, what copies of cut nodes may take
    uint64_t points = 0;    // of the nodes; at most so many are drawn after cutting
    std::vector<NodeId> pending;  // nodes that the hierarchy's missing pages keep from being refined, the largest error first
    double error_px = 0.0;  // bound reached: no point in sight is farther from a drawn one, as projected
    BoundBy bound_by = BoundBy::error;
};

/// Refines from the root, which is always drawn when in sight, the region with the largest projected error first, which is the nearest of those in sight;
/// loads hierarchy pages where it goes, if it may. The result depends on cloud, camera, size and settings alone.
/// throws  Error{unsupported} for clouds whose children replace their parent; what load_children throws
Selection select_nodes(LayeredCloud& cloud, const Camera& camera, uint32_t width_px, uint32_t height_px,
                       const SelectionSettings& settings);

/// Least eye depth at which the camera may see a point of the box, at least near_depth.
double least_depth(const Camera& camera, double aspect, const Box3d& box);

}  // namespace strata
