#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <queue>
#include <span>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "core/octree/layered_cloud.h"
#include "render/stream/resident_node.h"

namespace strata {

/// A node that a frame wants, with all that loading it needs to know: the hierarchy may grow meanwhile.
struct NodeRequest {
    NodeId id = kNoNode;
    double error_px = 0.0;        // what leaving it out costs: the largest is read first and evicted last
    uint64_t bytes = 0;           // it takes at most so many
    uint32_t level = 0;
};

/// A node that could not be read.
struct LoadFailure {
    NodeId id = kNoNode;
    std::string message;
};

/// Which nodes of a cloud are in memory. Threads of its own read what frames want, the most wanted first; one thread draws
/// frames, and only there nodes are evicted. Room is set aside before a node is read, so that the cap holds at any time.
class NodeCache {
public:
    using Clock = std::chrono::steady_clock;
    using Load = std::function<ResidentNode(const NodeRequest&)>;

    /// load  reads a node, from several threads at once; an Error it throws marks the node as failed, for good
    NodeCache(int threads, Load load);
    /// Waits for the reads under way.
    ~NodeCache();
    NodeCache(const NodeCache&) = delete;
    NodeCache& operator=(const NodeCache&) = delete;

    /// Begins a frame. Requests of frames before that have not been started are dropped unless wanted again. What is not
    /// wanted is evicted where room is needed: the least recently wanted first, of those of one frame that with the least
    /// error, so that children go before their parents. Wanted nodes that find no room wait for `wait` or a later frame.
    /// cap_bytes  most that nodes may take; a single node that is larger still has its way when all others are gone
    void begin_frame(std::span<const NodeRequest> wanted, uint64_t cap_bytes);

    /// Waits until all that is wanted is here, has failed or has no room.  returns  false at the deadline
    bool wait(Clock::time_point deadline = Clock::time_point::max());

    /// The node, if it is here: until the next begin_frame or wait. Of a node that failed, one without points.
    ResidentNode* find(NodeId id);
    /// The failures that this has not returned before, in the order of their ids.
    std::vector<LoadFailure> take_failures();

    uint64_t used_bytes() const;   // by nodes here and those on their way
    uint64_t reads_begun() const;  // so far

private:
    struct Entry {
        ResidentNode node;
        uint64_t bytes = 0;
        uint64_t last_wanted = 0;  // frame
        double error_px = 0.0;     // then
    };
    struct LessWanted {
        bool operator()(const NodeRequest& a, const NodeRequest& b) const {
            return a.error_px != b.error_px ? a.error_px < b.error_px : a.id > b.id;
        }
    };

    void work();
    // With mutex_ held:
    void issue();
    void evict_down_to(uint64_t bytes);
    void load_one(std::unique_lock<std::mutex>& lock);
    bool is_complete() const;
    void rethrow_broken();

    const Load load_;
    mutable std::mutex mutex_;
    std::condition_variable requested_, arrived_;
    bool stopping_ = false;
    uint64_t cap_bytes_ = 0, used_bytes_ = 0, frame_ = 0, reads_begun_ = 0;
    std::unordered_map<NodeId, Entry> entries_;
    std::vector<NodeRequest> without_room_;  // the most wanted last
    std::priority_queue<NodeRequest, std::vector<NodeRequest>, LessWanted> queue_;
    std::unordered_map<NodeId, NodeRequest> reading_;
    std::unordered_map<NodeId, NodeRequest> wanted_;  // of this frame
    std::unordered_map<NodeId, ResidentNode> failed_;  // empty nodes: their parents are what is drawn
    std::vector<LoadFailure> new_failures_;
    std::exception_ptr broken_;  // what is no Error
    std::vector<std::jthread> team_;
};

}  // namespace strata
