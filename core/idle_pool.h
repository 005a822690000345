#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

namespace strata {

/// Objects that are costly to make and serve one thread at a time: those that no thread uses now.
template <typename T>
class IdlePool {
public:
    /// One that was given back, or what make() gives. Safe from several threads.
    template <typename Make>
    std::unique_ptr<T> take(const Make& make) {
        {
            const std::lock_guard lock(mutex_);
            if (!idle_.empty()) {
                std::unique_ptr<T> object = std::move(idle_.back());
                idle_.pop_back();
                return object;
            }
        }
        return make();
    }
    void give_back(std::unique_ptr<T> object) {
        const std::lock_guard lock(mutex_);
        idle_.push_back(std::move(object));
    }
    /// While no thread takes or gives.
    std::span<const std::unique_ptr<T>> idle() const { return idle_; }

private:
    std::mutex mutex_;
    std::vector<std::unique_ptr<T>> idle_;
};

}  // namespace strata
