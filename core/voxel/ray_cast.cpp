#include "core/voxel/ray_cast.h"

#include <cassert>

#include "core/simd_level.h"
#include "core/simd_target.h"
#include "core/voxel/ray_group.h"
#include "core/voxel/voxel_dag.h"

namespace strata {

namespace {

// A tree or a DAG, as the walk asks it.
template <class Tree>
class NodesOf {
public:
    explicit NodesOf(const Tree& tree) : tree_(tree) {}

    int levels() const { return int(tree_.levels.size()); }
    uint64_t mask(int level, uint32_t node) const { return tree_.levels[size_t(level)].masks[node]; }
    uint64_t full_mask(int level, uint32_t node) const { return tree_.levels[size_t(level)].full_mask(node); }
    uint32_t child(int level, uint32_t node, int bit) const { return tree_.levels[size_t(level)].child(node, bit); }

private:
    const Tree& tree_;
};

using Rays = std::span<const VoxelRay>;
using Hits = std::span<VoxelHit>;

template <class Tree>
bool cast(const Tree& tree, const VoxelRay& ray, const RayLimits& limits, VoxelHit& hit) {
    RayWalk walk;
    WalkStart start;
    if (tree.empty() || !prepare_walk(tree.frame, ray, limits, walk) || !enter_cube(walk, 3, 0, start)) return false;
    const NodesOf nodes(tree);
    NodePath path;
    return walk_to_hit(VoxelLook(nodes, tree.frame, limits), walk, start, path, hit);
}

// One ray, a span of rays and a tile, for each instruction set. The arithmetic is the same, and so are the hits.
template <class Tree>
STRATA_KERNEL_BASELINE bool cast_baseline(const Tree& tree, const VoxelRay& ray, const RayLimits& limits, VoxelHit& hit) {
    return cast(tree, ray, limits, hit);
}
template <class Tree>
STRATA_KERNEL_AVX2 bool cast_avx2(const Tree& tree, const VoxelRay& ray, const RayLimits& limits, VoxelHit& hit) {
    return cast(tree, ray, limits, hit);
}
template <class Tree>
bool cast_at(SimdLevel level, const Tree& tree, const VoxelRay& ray, const RayLimits& limits, VoxelHit& hit) {
    return level == SimdLevel::baseline ? cast_baseline(tree, ray, limits, hit) : cast_avx2(tree, ray, limits, hit);
}

// What casts a span or a tile.
template <class Tree, class Cast>
void cast_groups(const Tree& tree, const RayLimits& limits, const Cast& cast) {
    const NodesOf nodes(tree);
    GroupCaster<NodesOf<Tree>> caster(nodes, tree.frame, limits, VoxelLook(nodes, tree.frame, limits));
    cast(caster);
}
template <class Tree, class Cast>
STRATA_KERNEL_BASELINE void groups_baseline(const Tree& tree, const RayLimits& limits, const Cast& cast) {
    cast_groups(tree, limits, cast);
}
template <class Tree, class Cast>
STRATA_KERNEL_AVX2 void groups_avx2(const Tree& tree, const RayLimits& limits, const Cast& cast) {
    cast_groups(tree, limits, cast);
}
template <class Tree, class Cast>
void groups_at(SimdLevel level, const Tree& tree, const RayLimits& limits, Hits hits, const Cast& cast) {
    if (tree.empty()) std::fill(hits.begin(), hits.end(), VoxelHit{});
    else if (level == SimdLevel::baseline) groups_baseline(tree, limits, cast);
    else groups_avx2(tree, limits, cast);
}

template <class Tree>
void span_at(SimdLevel level, const Tree& tree, Rays rays, const RayLimits& limits, Hits hits) {
    assert(rays.size() == hits.size());
    groups_at(level, tree, limits, hits, [&](auto& caster) { caster.cast_span(rays, hits); });
}

template <class Tree>
void tile_at(SimdLevel level, const Tree& tree, const VoxelTile& tile, const RayLimits& limits, Hits hits) {
    assert(hits.size() == size_t(tile.width) * size_t(tile.height));
    groups_at(level, tree, limits, hits, [&](auto& caster) { caster.cast_tile(tile, hits); });
}

}  // namespace

std::optional<VoxelHit> cast_ray(const VoxelTree& tree, const VoxelRay& ray, const RayLimits& limits, SimdLevel level) {
    VoxelHit hit;
    if (!cast_at(level, tree, ray, limits, hit)) return std::nullopt;
    return hit;
}

bool is_occluded(const VoxelTree& tree, const VoxelRay& ray, const RayLimits& limits, SimdLevel level) {
    VoxelHit hit;
    return cast_at(level, tree, ray, limits, hit);
}

void cast_rays(const VoxelTree& tree, Rays rays, const RayLimits& limits, Hits hits, SimdLevel level) {
    span_at(level, tree, rays, limits, hits);
}

void cast_tile(const VoxelTree& tree, const VoxelTile& tile, const RayLimits& limits, Hits hits, SimdLevel level) {
    tile_at(level, tree, tile, limits, hits);
}

std::optional<VoxelHit> cast_ray(const VoxelDag& tree, const VoxelRay& ray, const RayLimits& limits, SimdLevel level) {
    VoxelHit hit;
    if (!cast_at(level, tree, ray, limits, hit)) return std::nullopt;
    return hit;
}

bool is_occluded(const VoxelDag& tree, const VoxelRay& ray, const RayLimits& limits, SimdLevel level) {
    VoxelHit hit;
    return cast_at(level, tree, ray, limits, hit);
}

void cast_rays(const VoxelDag& tree, Rays rays, const RayLimits& limits, Hits hits, SimdLevel level) {
    span_at(level, tree, rays, limits, hits);
}

void cast_tile(const VoxelDag& tree, const VoxelTile& tile, const RayLimits& limits, Hits hits, SimdLevel level) {
    tile_at(level, tree, tile, limits, hits);
}

}  // namespace strata
