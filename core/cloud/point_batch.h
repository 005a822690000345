#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/cloud/attribute.h"

namespace strata {

/// A run of points as columns. Positions are quanta of the cloud that the batch came from.
struct PointBatch {
    size_t size = 0;                            // points
    std::vector<int32_t> x, y, z;               // [size] quanta
    std::vector<std::vector<std::byte>> columns;  // one per attribute of the cloud, [size * size_bytes]; empty: not asked for

    /// The values of column `index`: size * components of them.
    template <typename T>
    std::span<const T> column(size_t index) const {
        return {reinterpret_cast<const T*>(columns[index].data()), columns[index].size() / sizeof(T)};
    }
    template <typename T>
    std::span<T> column(size_t index) {
        return {reinterpret_cast<T*>(columns[index].data()), columns[index].size() / sizeof(T)};
    }
};

/// Sizes the position columns and those of the `wanted` attributes for `size` points; the other columns become empty.
void resize_batch(PointBatch& batch, size_t size, const std::vector<Attribute>& attributes, std::span<const int> wanted);

}  // namespace strata
