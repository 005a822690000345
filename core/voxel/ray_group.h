#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "core/voxel/ray_beam.h"
#include "core/voxel/ray_walk.h"

namespace strata {

inline constexpr int kGroupSide = 4;  // pixels
inline constexpr size_t kGroupRays = kGroupSide * kGroupSide;

/// Casts rays in groups, which share the part of their way that is surely empty.
template <class Nodes>
class GroupCaster {
public:
    GroupCaster(const Nodes& nodes, const VoxelFrame& frame, const RayLimits& limits)
        : nodes_(nodes), frame_(frame), limits_(limits), look_(nodes, frame, limits) {}

    /// At most kGroupRays. hits  [rays]
    void cast(std::span<const VoxelRay> rays, std::span<VoxelHit> hits) {
        size_t count = 0;
        for (size_t i = 0; i < rays.size(); ++i) {
            hits[i] = {};
            if (!prepare_walk(frame_, rays[i], limits_, walks_[count])) continue;
            hits_[count++] = &hits[i];
        }
        if (count == 0) return;
        int axis = 3;
        int32_t plane = 0;
        RayBeam beam;
        if (count > 1 && beam_of(std::span<const RayWalk>(walks_.data(), count), beam)) {
            const int32_t side = int32_t(frame_.side());
            double spread = 0.0;  // of the caller, in which directions may be long or short
            for (size_t i = 0; i < count; ++i) spread = std::max(spread, walks_[i].spread);
            const int32_t empty = BeamSearch(nodes_, frame_, limits_.depth, beam, spread, limits_.footprint).empty_until(0);
            if (empty == side) return;
            axis = beam.axis;
            plane = beam.forward ? empty : side - empty;
        }
        WalkStart start;
        for (size_t i = 0; i < count; ++i)
            if (enter_cube(walks_[i], axis, plane, start)) walk_to_hit(look_, walks_[i], start, path_, *hits_[i]);
    }

    void cast_span(std::span<const VoxelRay> rays, std::span<VoxelHit> hits) {
        for (size_t i = 0; i < rays.size(); i += kGroupRays) {
            const size_t count = std::min(kGroupRays, rays.size() - i);
            cast(rays.subspan(i, count), hits.subspan(i, count));
        }
    }

    void cast_tile(const VoxelTile& tile, std::span<VoxelHit> hits) {
        std::array<VoxelRay, kGroupRays> rays;
        std::array<VoxelHit, kGroupRays> found;
        for (int y0 = 0; y0 < tile.height; y0 += kGroupSide)
            for (int x0 = 0; x0 < tile.width; x0 += kGroupSide) {
                const int x1 = std::min(x0 + kGroupSide, tile.width), y1 = std::min(y0 + kGroupSide, tile.height);
                size_t count = 0;
                for (int y = y0; y < y1; ++y)
                    for (int x = x0; x < x1; ++x) rays[count++] = tile.ray(x, y);
                cast(std::span<const VoxelRay>(rays.data(), count), std::span(found.data(), count));
                count = 0;
                for (int y = y0; y < y1; ++y)
                    for (int x = x0; x < x1; ++x) hits[size_t(y) * size_t(tile.width) + size_t(x)] = found[count++];
            }
    }

private:
    const Nodes& nodes_;
    const VoxelFrame& frame_;
    const RayLimits& limits_;
    VoxelLook<Nodes> look_;
    NodePath path_;  // of the last ray: the next is near it
    std::array<RayWalk, kGroupRays> walks_;
    std::array<VoxelHit*, kGroupRays> hits_;
};

}  // namespace strata
