#include "core/voxel/ray_cast.h"

#include <algorithm>
#include <cassert>

#include "core/voxel/ray_walk.h"

namespace strata {

namespace {

struct TreeNodes {
    const VoxelTree& tree;

    int levels() const { return int(tree.levels.size()); }
    uint64_t mask(int level, uint32_t node) const { return tree.levels[size_t(level)].masks[node]; }
    uint64_t full_mask(int level, uint32_t node) const { return tree.levels[size_t(level)].full_mask(node); }
    uint32_t child(int level, uint32_t node, int bit) const { return tree.levels[size_t(level)].child(node, bit); }
};

bool cast(const VoxelTree& tree, const VoxelRay& ray, const RayLimits& limits, VoxelHit& hit) {
    RayWalk walk;
    WalkStart start;
    if (tree.empty() || !prepare_walk(tree.frame, ray, limits, walk) || !enter_cube(walk, start)) return false;
    return walk_to_hit(TreeNodes{tree}, tree.frame, walk, start, std::clamp(limits.depth, 1, tree.frame.depth()), hit);
}

}  // namespace

std::optional<VoxelHit> cast_ray(const VoxelTree& tree, const VoxelRay& ray, const RayLimits& limits) {
    VoxelHit hit;
    if (!cast(tree, ray, limits, hit)) return std::nullopt;
    return hit;
}

bool is_occluded(const VoxelTree& tree, const VoxelRay& ray, const RayLimits& limits) {
    VoxelHit hit;
    return cast(tree, ray, limits, hit);
}

void cast_rays(const VoxelTree& tree, std::span<const VoxelRay> rays, const RayLimits& limits, std::span<VoxelHit> hits) {
    assert(rays.size() == hits.size());
    for (size_t i = 0; i < rays.size(); ++i) {
        hits[i] = {};
        cast(tree, rays[i], limits, hits[i]);
    }
}

void cast_tile(const VoxelTree& tree, const VoxelTile& tile, const RayLimits& limits, std::span<VoxelHit> hits) {
    assert(hits.size() == size_t(tile.width) * size_t(tile.height));
    size_t i = 0;
    for (int y = 0; y < tile.height; ++y)
        for (int x = 0; x < tile.width; ++x, ++i) {
            hits[i] = {};
            cast(tree, tile.ray(x, y), limits, hits[i]);
        }
}

}  // namespace strata
