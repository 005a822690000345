#include "core/octree/node_key.h"

namespace strata {

std::string node_name(const NodeKey& key) {
    std::string name = "r";
    for (uint32_t level = key.level; level-- > 0;)
        name += char('0' + ((key.x >> level & 1) << 2 | (key.y >> level & 1) << 1 | (key.z >> level & 1)));
    return name;
}

}  // namespace strata
