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

/// Calls visit(key) for the up to 26 cells of the same level that touch a cell.
template <typename Visit>
void for_each_neighbour(const NodeKey& key, const Visit& visit) {
    const int64_t cells = int64_t{1} << key.level;
    for (int64_t x = int64_t{key.x} - 1; x <= int64_t{key.x} + 1; ++x)
        for (int64_t y = int64_t{key.y} - 1; y <= int64_t{key.y} + 1; ++y)
            for (int64_t z = int64_t{key.z} - 1; z <= int64_t{key.z} + 1; ++z) {
                if (x < 0 || y < 0 || z < 0 || x >= cells || y >= cells || z >= cells) continue;
                if (x == key.x && y == key.y && z == key.z) continue;
                visit(NodeKey{key.level, uint32_t(x), uint32_t(y), uint32_t(z)});
            }
}

/// Whether a comes before b when the cells of one level are visited octant by octant.
bool octant_order(const NodeKey& a, const NodeKey& b);

/// "r" and an octant digit a level.
std::string node_name(const NodeKey& key);

}  // namespace strata
