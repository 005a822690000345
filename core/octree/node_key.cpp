#include "core/octree/node_key.h"

namespace strata {

bool octant_order(const NodeKey& a, const NodeKey& b) {
    // The highest differing bit of any axis decides; among axes that share it, x before y before z.
    const uint32_t x = a.x ^ b.x, y = a.y ^ b.y, z = a.z ^ b.z;
    const auto lower_top_bit = [](uint32_t m, uint32_t n) { return m < n && m < (m ^ n); };
    if (!lower_top_bit(x, y) && !lower_top_bit(x, z)) return a.x < b.x;
    return lower_top_bit(y, z) ? a.z < b.z : a.y < b.y;
}

std::string node_name(const NodeKey& key) {
    std::string name = "r";
    for (uint32_t level = key.level; level-- > 0;)
        name += char('0' + ((key.x >> level & 1) << 2 | (key.y >> level & 1) << 1 | (key.z >> level & 1)));
    return name;
}

}  // namespace strata
