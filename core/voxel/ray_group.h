#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "core/voxel/ray_beam.h"

namespace strata {

inline constexpr int kGroupSide = 8;  // pixels
inline constexpr size_t kGroupRays = kGroupSide * kGroupSide;

/// Casts up to kGroupRays rays, which share the part of their way that is surely empty.
/// hits  [rays]
template <class Nodes>
void cast_group(const Nodes& nodes, const VoxelFrame& frame, std::span<const VoxelRay> rays, const RayLimits& limits,
                VoxelWalker<Nodes>& walker, std::span<VoxelHit> hits) {
    std::array<RayWalk, kGroupRays> walks;
    std::array<const RayWalk*, kGroupRays> some;
    std::array<uint8_t, kGroupRays> index;
    size_t count = 0;
    for (size_t i = 0; i < rays.size(); ++i) {
        hits[i] = {};
        if (!prepare_walk(frame, rays[i], limits, walks[count])) continue;
        some[count] = &walks[count];
        index[count++] = uint8_t(i);
    }
    if (count == 0) return;
    int axis = 3;
    int32_t plane = 0;
    RayBeam beam;
    if (count > 1 && beam_of({some.data(), count}, beam)) {
        const int32_t side = int32_t(frame.side());
        const double most_spread = std::max_element(some.begin(), some.begin() + ptrdiff_t(count),
                                                    [](const RayWalk* a, const RayWalk* b) { return a->spread < b->spread; })[0]
                                       ->spread;
        const int32_t empty = BeamSearch(nodes, frame, limits.depth, beam, most_spread, limits.footprint).empty_until(0);
        if (empty == side) return;
        axis = beam.axis;
        plane = beam.forward ? empty : side - empty;
    }
    for (size_t i = 0; i < count; ++i) {
        WalkStart start;
        if (enter_cube(walks[i], axis, plane, start)) walker.walk_to_hit(walks[i], start, hits[index[i]]);
    }
}

template <class Nodes>
void cast_span(const Nodes& nodes, const VoxelFrame& frame, std::span<const VoxelRay> rays, const RayLimits& limits,
               std::span<VoxelHit> hits) {
    VoxelWalker<Nodes> walker(nodes, frame, limits.depth);
    for (size_t i = 0; i < rays.size(); i += kGroupRays) {
        const size_t count = std::min(kGroupRays, rays.size() - i);
        cast_group(nodes, frame, rays.subspan(i, count), limits, walker, hits.subspan(i, count));
    }
}

template <class Nodes>
void cast_tile_of(const Nodes& nodes, const VoxelFrame& frame, const VoxelTile& tile, const RayLimits& limits, std::span<VoxelHit> hits) {
    VoxelWalker<Nodes> walker(nodes, frame, limits.depth);
    std::array<VoxelRay, kGroupRays> rays;
    std::array<VoxelHit, kGroupRays> found;
    for (int y0 = 0; y0 < tile.height; y0 += kGroupSide)
        for (int x0 = 0; x0 < tile.width; x0 += kGroupSide) {
            const int x1 = std::min(x0 + kGroupSide, tile.width), y1 = std::min(y0 + kGroupSide, tile.height);
            size_t count = 0;
            for (int y = y0; y < y1; ++y)
                for (int x = x0; x < x1; ++x) rays[count++] = tile.ray(x, y);
            cast_group(nodes, frame, std::span<const VoxelRay>(rays.data(), count), limits, walker, std::span(found.data(), count));
            count = 0;
            for (int y = y0; y < y1; ++y)
                for (int x = x0; x < x1; ++x) hits[size_t(y) * size_t(tile.width) + size_t(x)] = found[count++];
        }
}

}  // namespace strata
