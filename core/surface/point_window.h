#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "core/surface/point_layers.h"

namespace strata {

/// Layers of points that a surface's pieces may still ask for: the field that reads them puts them in, and who passes the pieces on takes out
/// what lies below. Both may be at it at once.
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
    void forget_below(size_t layer) {
        const std::lock_guard lock(mutex_);
        while (!layers_.empty() && layers_.begin()->first < layer) {
            bytes_ -= layers_.begin()->second->memory_bytes();
            layers_.erase(layers_.begin());
        }
    }
    uint64_t memory_bytes() const {
        const std::lock_guard lock(mutex_);
        return bytes_;
    }

private:
    mutable std::mutex mutex_;
    std::map<size_t, std::shared_ptr<const PointLayer>> layers_;
    uint64_t bytes_ = 0;
};

}  // namespace strata
