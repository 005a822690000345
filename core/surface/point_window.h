#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "core/surface/point_layers.h"

namespace strata {

/// Layers of points that a surface's pieces may still ask for: the field that reads them puts them in and takes them out, by what it made itself, so that
/// its memory does not depend on when pieces are passed on. They may be looked at meanwhile.
class PointWindow {
public:
    void put(size_t layer, std::shared_ptr<const PointLayer> points) {
        const std::lock_guard lock(mutex_);
        bytes_ += points->memory_bytes();
        layers_[layer] = std::move(points);
    }
    /// The layer and those below and above it; null where there are none.
    std::array<std::shared_ptr<const PointLayer>, 3> around(size_t layer) const {
        const std::lock_guard lock(mutex_);
        std::array<std::shared_ptr<const PointLayer>, 3> found;
        for (size_t n = 0; n < 3; ++n)
            if (const auto at = layers_.find(layer + n - 1); at != layers_.end()) found[n] = at->second;
        return found;
    }
    /// The field goes on to the layer above this one, which has bricks or has none: forgets those that neither needs any more, the field or pieces. Whoever
    /// makes these holds up to four layers with bricks (contour_bricks), and a piece asks for points from one layer below its bricks to two above.
    void pass(size_t layer, bool has_bricks) {
        const std::lock_guard lock(mutex_);
        if (has_bricks) {
            if (held_.size() == kHeld) held_.erase(held_.begin());
            held_.push_back(layer);
        }
        std::erase_if(layers_, [&](const auto& entry) {
            const size_t at = entry.first;
            const bool kept = at + 1 >= layer || std::any_of(held_.begin(), held_.end(), [&](size_t bricks) { return at + 1 >= bricks && at <= bricks + 2; });
            if (!kept) bytes_ -= entry.second->memory_bytes();
            return !kept;
        });
    }
    uint64_t memory_bytes() const {
        const std::lock_guard lock(mutex_);
        return bytes_;
    }

private:
    static constexpr size_t kHeld = 4;

    mutable std::mutex mutex_;
    std::map<size_t, std::shared_ptr<const PointLayer>> layers_;
    std::vector<size_t> held_;  // the last layers with bricks
    uint64_t bytes_ = 0;
};

}  // namespace strata
