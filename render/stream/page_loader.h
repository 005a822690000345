#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <unordered_set>
#include <utility>
#include <vector>

#include "core/octree/layered_cloud.h"
#include "render/stream/node_cache.h"

namespace strata {

/// Reads pages of a hierarchy for frames that do not wait, on a thread of its own, one after the other.
class PageLoader {
public:
    /// The cloud must outlive this.
    explicit PageLoader(const LayeredCloud& cloud) : cloud_(cloud) {}
    /// Waits for the read under way.
    ~PageLoader();
    PageLoader(const PageLoader&) = delete;
    PageLoader& operator=(const PageLoader&) = delete;

    /// Wants the pages below these nodes, the first the most; what was wanted before and is not begun is dropped.
    void want(std::vector<NodeId> nodes);
    /// Makes the pages that have arrived part of the cloud. From the thread that asks it for nodes.
    void add_arrived(LayeredCloud& cloud);
    /// Pages that could not be read, or added, since the last call. They are not tried again: the nodes above them are what is drawn.
    std::vector<LoadFailure> take_failures();
    bool has_failed(NodeId node) const;

private:
    struct Arrived {
        NodeId node;
        std::unique_ptr<HierarchyPage> page;
    };

    void work();
    void read_one(std::unique_lock<std::mutex>& lock);
    void fail(NodeId node, const std::string& message);

    const LayeredCloud& cloud_;
    mutable std::mutex mutex_;
    std::condition_variable wanted_changed_;
    bool stopping_ = false;
    std::vector<NodeId> wanted_;  // the first last
    NodeId reading_ = kNoNode;
    std::vector<Arrived> arrived_;
    std::unordered_set<NodeId> failed_;
    std::vector<LoadFailure> new_failures_;
    std::jthread thread_;  // started when first needed
};

}  // namespace strata
