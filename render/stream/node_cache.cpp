#include "render/stream/node_cache.h"

#include <algorithm>
#include <system_error>
#include <tuple>
#include <utility>

#include "core/error.h"

namespace strata {

NodeCache::NodeCache(int threads, Load load) : load_(std::move(load)) {
    try {
        for (int i = 0; i < std::max(threads, 1); ++i) team_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
        // The machine has no more threads to give: those that run do all the work, or `wait` does.
    }
}

NodeCache::~NodeCache() {
    {
        const std::lock_guard lock(mutex_);
        stopping_ = true;
    }
    requested_.notify_all();
}

void NodeCache::work() {
    std::unique_lock lock(mutex_);
    while (true) {
        requested_.wait(lock, [&] { return stopping_ || !queue_.empty(); });
        if (stopping_) return;
        load_one(lock);
    }
}

void NodeCache::load_one(std::unique_lock<std::mutex>& lock) {
    const NodeRequest request = queue_.top();
    queue_.pop();
    reading_.emplace(request.id, request);
    const uint64_t serial = ++reads_begun_;
    lock.unlock();
    ResidentNode node;
    std::string failure;
    std::exception_ptr broken;
    try {
        node = load_(request);
        node.serial = serial;
    } catch (const Error& error) {
        failure = error.what();
    } catch (...) {
        broken = std::current_exception();
    }
    lock.lock();
    reading_.erase(request.id);
    if (failure.empty() && !broken) {
        const auto wanted = wanted_.find(request.id);
        Entry& entry = entries_[request.id];
        entry = {std::move(node), request.bytes, 0, request.error_px};
        if (wanted != wanted_.end()) entry.last_wanted = frame_, entry.error_px = wanted->second.error_px;
    } else {
        used_bytes_ -= request.bytes;
        failed_.emplace(request.id, ResidentNode());
        if (broken)
            broken_ = broken;
        else
            new_failures_.push_back({request.id, failure});
    }
    arrived_.notify_all();
}

void NodeCache::evict_down_to(uint64_t bytes) {
    if (used_bytes_ <= bytes) return;
    std::vector<std::tuple<uint64_t, double, NodeId>> evictable;
    for (const auto& [id, entry] : entries_)
        if (entry.last_wanted < frame_) evictable.emplace_back(entry.last_wanted, entry.error_px, id);
    std::sort(evictable.begin(), evictable.end());
    for (const auto& [last_wanted, error_px, id] : evictable) {
        if (used_bytes_ <= bytes) return;
        const auto entry = entries_.find(id);
        used_bytes_ -= entry->second.bytes;
        entries_.erase(entry);
    }
}

void NodeCache::issue() {
    uint64_t needed = 0;  // all at once: what to evict is sorted once
    for (const NodeRequest& request : without_room_) needed += request.bytes;
    evict_down_to(cap_bytes_ - std::min(cap_bytes_, needed));
    while (!without_room_.empty()) {
        const NodeRequest& next = without_room_.back();
        const bool fits = used_bytes_ <= cap_bytes_ && next.bytes <= cap_bytes_ - used_bytes_;
        if (!fits && used_bytes_ > 0) break;
        used_bytes_ += next.bytes;
        queue_.push(next);
        without_room_.pop_back();
        requested_.notify_one();
    }
}

void NodeCache::begin_frame(std::span<const NodeRequest> wanted, uint64_t cap_bytes) {
    const std::lock_guard lock(mutex_);
    rethrow_broken();
    ++frame_;
    cap_bytes_ = cap_bytes;
    for (; !queue_.empty(); queue_.pop()) used_bytes_ -= queue_.top().bytes;
    wanted_.clear();
    without_room_.clear();
    for (const NodeRequest& request : wanted) {
        wanted_.emplace(request.id, request);
        if (const auto entry = entries_.find(request.id); entry != entries_.end()) {
            entry->second.last_wanted = frame_;
            entry->second.error_px = request.error_px;
        } else if (!reading_.contains(request.id) && !failed_.contains(request.id)) {
            without_room_.push_back(request);
        }
    }
    std::sort(without_room_.begin(), without_room_.end(), LessWanted());
    issue();
}

// Nothing more will come of what is wanted.
bool NodeCache::is_complete() const {
    if (!queue_.empty()) return false;
    // What is being read may make room when it turns out not to be wanted.
    if (!without_room_.empty()) return reading_.empty();
    return std::none_of(reading_.begin(), reading_.end(), [&](const auto& read) { return wanted_.contains(read.first); });
}

void NodeCache::rethrow_broken() {
    if (broken_) std::rethrow_exception(std::exchange(broken_, nullptr));
}

bool NodeCache::wait(Clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    while (true) {
        rethrow_broken();
        issue();
        if (is_complete()) return true;
        if (Clock::now() >= deadline) return false;
        if (team_.empty())
            load_one(lock);
        else if (deadline == Clock::time_point::max())
            arrived_.wait(lock);
        else
            arrived_.wait_until(lock, deadline);
    }
}

ResidentNode* NodeCache::find(NodeId id) {
    const std::lock_guard lock(mutex_);
    if (const auto entry = entries_.find(id); entry != entries_.end()) return &entry->second.node;
    const auto failed = failed_.find(id);
    return failed == failed_.end() ? nullptr : &failed->second;
}

std::vector<LoadFailure> NodeCache::take_failures() {
    const std::lock_guard lock(mutex_);
    std::vector<LoadFailure> failures = std::exchange(new_failures_, {});
    std::sort(failures.begin(), failures.end(), [](const LoadFailure& a, const LoadFailure& b) { return a.id < b.id; });
    return failures;
}

uint64_t NodeCache::used_bytes() const {
    const std::lock_guard lock(mutex_);
    return used_bytes_;
}

uint64_t NodeCache::reads_begun() const {
    const std::lock_guard lock(mutex_);
    return reads_begun_;
}

}  // namespace strata
