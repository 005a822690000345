#pragma once

#include <compare>
#include <cstdint>
#include <string>

namespace strata {

/// A cell of the octree: at level l the root cube is divided into 2^l cells an axis; x, y, z are the cell's indices.
struct NodeKey {
    uint32_t level = 0;
    uint32_t x = 0, y = 0, z = 0;

    /// Octant digits as Potree has them: 4 x + 2 y + z.
    NodeKey child(int octant) const {
        return {level + 1, 2 * x + uint32_t(octant >> 2 & 1), 2 * y + uint32_t(octant >> 1 & 1), 2 * z + uint32_t(octant & 1)};
    }
    NodeKey parent() const { return {level - 1, x / 2, y / 2, z / 2}; }
    int octant() const { return int(x & 1) << 2 | int(y & 1) << 1 | int(z & 1); }

    auto operator<=>(const NodeKey&) const = default;
};

/// "r" and an octant digit a level.
std::string node_name(const NodeKey& key);

}  // namespace strata
