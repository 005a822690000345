#include "render/stream/resident_cloud.h"

#include <algorithm>
#include <numeric>
#include <unordered_set>

#include "render/stream/node_loader.h"

namespace strata {
namespace {

ColorRange range_of(const LayeredCloud& cloud, const ResidencySettings& settings) {
    if (settings.range) return *settings.range;
    return settings.color.needs_range() ? derive_range(cloud, settings.color) : ColorRange{};
}

}  // namespace

void FrameNodes::limit_points(uint64_t most) {
    std::vector<size_t> order(ids.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return errors_px[a] > errors_px[b]; });
    uint64_t sum = 0;
    size_t taken = 0;
    while (taken < order.size() && (taken == 0 || points[order[taken]]->size() <= most - std::min(most, sum)))
        sum += points[order[taken++]]->size();
    if (taken == order.size()) return;
    missing += order.size() - taken;
    missing_error_px = std::max(missing_error_px, errors_px[order[taken]]);
    order.resize(taken);
    std::sort(order.begin(), order.end());
    const auto gather = [&](auto& values) {
        for (size_t i = 0; i < taken; ++i) values[i] = values[order[i]];
        values.resize(taken);
    };
    gather(ids);
    gather(points);
    gather(errors_px);
}

ResidentCloud::ResidentCloud(const LayeredCloud& cloud, const ResidencySettings& settings)
    : cloud_(cloud),
      settings_(settings),
      colors_(cloud.info(), settings.color, range_of(cloud, settings), settings.colormap),
      normals_(settings.normals ? std::optional<PointNormals>(cloud.info()) : std::nullopt),
      wanted_attributes_(colors_.wanted().begin(), colors_.wanted().end()),
      cache_(settings.threads, [this](const NodeRequest& request) {
          return load_node(cloud_, request, wanted_attributes_, colors_, settings_.filter, normals_ ? &*normals_ : nullptr);
      }),
      pages_(cloud) {
    const auto want = [&](std::span<const int> attributes) {
        for (const int attribute : attributes)
            if (std::find(wanted_attributes_.begin(), wanted_attributes_.end(), attribute) == wanted_attributes_.end())
                wanted_attributes_.push_back(attribute);
    };
    want(settings_.filter.wanted());
    if (normals_) want(normals_->wanted());
}

FrameNodes ResidentCloud::gather(const Selection& selection, const SelectionSettings& limits, uint64_t cap_bytes,
                                 NodeCache::Clock::time_point deadline) {
    std::vector<NodeRequest> requests;
    for (size_t i = 0; i < selection.nodes.size(); ++i) {
        const LayeredNode& node = cloud_.node(selection.nodes[i]);
        requests.push_back({selection.nodes[i], selection.errors_px[i], limits.node_bytes + node.points * limits.point_bytes, node.key.level});
    }
    if (!requests.empty() && cache_.find(cloud_.root()) == nullptr) {
        cache_.begin_frame({requests.data(), 1}, cap_bytes);
        cache_.wait();
    }
    cache_.begin_frame(requests, cap_bytes);
    cache_.wait(deadline);

    FrameNodes frame;
    std::unordered_set<NodeId> drawn;
    uint64_t points = 0;
    const auto draw = [&](NodeId id, double error_px) {
        // Without its parent a node would stand alone in a hole.
        const NodeId parent = cloud_.node(id).parent;
        ResidentNode* const node = parent == kNoNode || drawn.contains(parent) ? cache_.find(id) : nullptr;
        if (node == nullptr) return false;
        drawn.insert(id);
        frame.ids.push_back(id);
        frame.points.push_back(node);
        frame.errors_px.push_back(error_px);
        points += node->size();
        return true;
    };
    for (const NodeRequest& request : requests)
        if (!draw(request.id, request.error_px)) {
            ++frame.missing;
            frame.missing_error_px = std::max(frame.missing_error_px, request.error_px);
        }
    if (frame.missing > 0 && !frame.ids.empty()) {
        for (const NodeId id : drawn_)  // ascending by key, so that parents come first
            if (!drawn.contains(id) && cloud_.node(id).points <= limits.point_budget - std::min(limits.point_budget, points))
                draw(id, 0.0);
        std::vector<size_t> order(frame.ids.size());
        std::iota(order.begin(), order.end(), size_t{0});
        std::sort(order.begin(), order.end(),
                  [&](size_t a, size_t b) { return cloud_.node(frame.ids[a]).key < cloud_.node(frame.ids[b]).key; });
        FrameNodes sorted;
        for (const size_t i : order) {
            sorted.ids.push_back(frame.ids[i]);
            sorted.points.push_back(frame.points[i]);
            sorted.errors_px.push_back(frame.errors_px[i]);
        }
        sorted.missing = frame.missing;
        sorted.missing_error_px = frame.missing_error_px;
        frame = std::move(sorted);
    }
    for (const NodeId id : selection.pending) {
        if (pages_.has_failed(id)) continue;
        ++frame.missing;
        frame.missing_error_px = std::max(frame.missing_error_px, selection.error_px);
    }
    drawn_ = frame.ids;
    return frame;
}

LoadFailures ResidentCloud::take_failures() {
    std::vector<LoadFailure> failures = cache_.take_failures();
    for (LoadFailure& failure : pages_.take_failures()) failures.push_back(std::move(failure));
    if (failures.empty()) return {};
    return {failures.size(), failures.front().message};
}

}  // namespace strata
