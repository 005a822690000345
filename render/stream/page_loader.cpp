#include "render/stream/page_loader.h"

#include <algorithm>
#include <system_error>

#include "core/error.h"

namespace strata {

PageLoader::~PageLoader() {
    {
        const std::lock_guard lock(mutex_);
        stopping_ = true;
    }
    wanted_changed_.notify_all();
}

void PageLoader::work() {
    std::unique_lock lock(mutex_);
    while (true) {
        wanted_changed_.wait(lock, [&] { return stopping_ || !wanted_.empty(); });
        if (stopping_) return;
        read_one(lock);
    }
}

void PageLoader::read_one(std::unique_lock<std::mutex>& lock) {
    reading_ = wanted_.back();
    wanted_.pop_back();
    lock.unlock();
    std::unique_ptr<HierarchyPage> page;
    std::string failure;
    try {
        page = cloud_.read_page(reading_);
    } catch (const std::exception& error) {  // also of what is no Error: nothing must escape the thread
        failure = error.what();
    }
    lock.lock();
    if (page)
        arrived_.push_back({reading_, std::move(page)});
    else if (!failure.empty())
        fail(reading_, failure);
    reading_ = kNoNode;
}

void PageLoader::fail(NodeId node, const std::string& message) {
    failed_.insert(node);
    new_failures_.push_back({node, message});
}

void PageLoader::want(std::vector<NodeId> nodes) {
    std::unique_lock lock(mutex_);
    std::erase_if(nodes, [&](NodeId node) {
        return node == reading_ || failed_.contains(node) ||
               std::any_of(arrived_.begin(), arrived_.end(), [&](const Arrived& page) { return page.node == node; });
    });
    std::reverse(nodes.begin(), nodes.end());
    wanted_ = std::move(nodes);
    if (wanted_.empty()) return;
    if (!thread_.joinable()) {
        try {
            thread_ = std::jthread([this] { work(); });
        } catch (const std::system_error&) {
            return read_one(lock);  // the machine has no thread to give: a page a frame
        }
    }
    wanted_changed_.notify_one();
}

void PageLoader::add_arrived(LayeredCloud& cloud) {
    std::vector<Arrived> pages;
    {
        const std::lock_guard lock(mutex_);
        pages = std::exchange(arrived_, {});
    }
    for (const Arrived& page : pages) {
        try {
            cloud.add_page(page.node, *page.page);
        } catch (const Error& error) {
            const std::lock_guard lock(mutex_);
            fail(page.node, error.what());
        }
    }
}

std::vector<LoadFailure> PageLoader::take_failures() {
    const std::lock_guard lock(mutex_);
    return std::exchange(new_failures_, {});
}

bool PageLoader::has_failed(NodeId node) const {
    const std::lock_guard lock(mutex_);
    return failed_.contains(node);
}

}  // namespace strata
