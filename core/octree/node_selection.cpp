#include "core/octree/node_selection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "core/error.h"
#include "core/math/frustum.h"

namespace strata {
namespace {

struct Candidate {
    double error_px;  // what leaving this node out costs
    NodeKey key;
    NodeId id;

    bool operator<(const Candidate& other) const {  // the top of the queue is the largest
        return error_px != other.error_px ? error_px < other.error_px : key > other.key;
    }
};

}  // namespace

double least_depth(const Camera& camera, double aspect, const Box3d& box) {
    const Vec3d center = box.center() - camera.eye, half = 0.5 * box.size();
    const Vec3d forward = camera.forward();
    const double planar = forward.dot(center) - forward.cwiseAbs().dot(half);
    if (camera.projection == Projection::orthographic) return std::max(planar, camera.near_depth);
    // Beside the eye the planar bound is zero or less; distance times the cosine of the widest ray also bounds it.
    const double distance = (center.cwiseAbs() - half).cwiseMax(0.0).norm();
    const double slope = std::tan(0.5 * camera.fov_rad);
    const double widest_cosine = 1.0 / std::sqrt(1.0 + slope * slope * (1.0 + aspect * aspect));
    return std::max({planar, distance * widest_cosine, camera.near_depth});
}

Selection select_nodes(LayeredCloud& cloud, const Camera& camera, uint32_t width_px, uint32_t height_px,
                       const SelectionSettings& settings) {
    if (cloud.refinement() != Refinement::add)
        throw Error(ErrorKind::unsupported, "clouds whose children replace their parent cannot be drawn yet");
    Selection selection;
    if (cloud.node_count() == 0) return selection;
    const double aspect = double(width_px) / height_px;
    const Frustum frustum(camera, aspect);
    const auto projected = [&](double error, const Box3d& box) {
        return error * pixels_per_unit(camera, least_depth(camera, aspect, box), height_px);
    };

    const auto coverage = [&](const LayeredNode& node) {
        return settings.clip == nullptr ? Coverage::whole : settings.clip->coverage(node.bounds);
    };
    const auto visible = [&](const LayeredNode& node) {
        return frustum.intersects(node.bounds) && coverage(node) != Coverage::none;
    };
    // How near a node is counts as if nothing were cut: so the points that are left keep their sizes.
    std::priority_queue<Candidate> queue;
    if (visible(cloud.node(cloud.root())))
        queue.push({std::numeric_limits<double>::infinity(), cloud.node(cloud.root()).key, cloud.root()});
    uint64_t used_bytes = 0;
    std::vector<Candidate> chosen_nodes;
    while (!queue.empty()) {
        const Candidate next = queue.top();
        queue.pop();
        const LayeredNode& chosen = cloud.node(next.id);
        const uint64_t cut_bytes = coverage(chosen) == Coverage::part ? chosen.points * settings.cut_point_bytes : 0;
        const uint64_t bytes = settings.node_bytes + chosen.points * settings.point_bytes + cut_bytes;
        const bool over_budget = chosen.points > settings.point_budget - std::min(settings.point_budget, selection.points);
        const bool over_memory = bytes > settings.memory_bytes - std::min(settings.memory_bytes, used_bytes);
        // The root is always drawn: a picture of nothing answers no question.
        if (!chosen_nodes.empty() && (over_budget || over_memory)) {
            selection.bound_by = over_memory ? BoundBy::memory : BoundBy::budget;
            selection.error_px = std::max(selection.error_px, next.error_px);
            break;
        }
        selection.points += chosen.points;
        selection.cut_bytes += cut_bytes;
        used_bytes += bytes;
        chosen_nodes.push_back(next);
        const double error = cloud.node(next.id).error;
        const double own_error_px = projected(error, cloud.node(next.id).bounds);
        if (own_error_px <= settings.error_px) {
            selection.error_px = std::max(selection.error_px, own_error_px);
            continue;
        }
        if (chosen.children_pending && !settings.load_pages) {
            selection.error_px = std::max(selection.error_px, own_error_px);
            selection.pending.push_back(next.id);
            continue;
        }
        cloud.load_children(next.id);
        const LayeredNode& node = cloud.node(next.id);
        for (NodeId child = node.first_child; child < node.first_child + node.child_count; ++child) {
            const LayeredNode& child_node = cloud.node(child);
            if (!visible(child_node)) continue;
            const double error_px = projected(error, child_node.bounds);
            if (error_px > settings.error_px)
                queue.push({error_px, child_node.key, child});
            else
                selection.error_px = std::max(selection.error_px, error_px);
        }
    }
    std::sort(chosen_nodes.begin(), chosen_nodes.end(), [](const Candidate& a, const Candidate& b) { return a.key < b.key; });
    for (const Candidate& node : chosen_nodes) {
        selection.nodes.push_back(node.id);
        selection.errors_px.push_back(node.error_px);
    }
    return selection;
}

}  // namespace strata
