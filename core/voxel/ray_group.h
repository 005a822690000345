#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "core/voxel/ray_beam.h"
#include "core/voxel/ray_walk.h"

namespace strata {

inline constexpr int kGroupSide = 4, kBlockSide = 16;  // pixels
inline constexpr size_t kGroupRays = kGroupSide * kGroupSide;

/// Casts rays in groups, which share the part of their way that is surely empty.
/// Look  says what there is where a ray is: VoxelLook, or one like it
template <class Nodes, class Look = VoxelLook<Nodes>>
class GroupCaster {
public:
    using Hit = typename Look::Hit;

    GroupCaster(const Nodes& nodes, const VoxelFrame& frame, const RayLimits& limits, const Look& look)
        : nodes_(nodes), frame_(frame), limits_(limits), look_(look) {}

    void cast_span(std::span<const VoxelRay> rays, std::span<Hit> hits) {
        for (size_t i = 0; i < rays.size(); i += kGroupRays) {
            const size_t count = std::min(kGroupRays, rays.size() - i);
            cast_group(rays.subspan(i, count), {}, hits.subspan(i, count));
        }
    }

    void cast_tile(const VoxelTile& tile, std::span<Hit> hits) {
        std::array<VoxelRay, kGroupRays> rays;
        std::array<Hit, kGroupRays> found;
        const auto hit_at = [&](int x, int y) -> Hit& { return hits[size_t(y) * size_t(tile.width) + size_t(x)]; };
        for_blocks(0, 0, tile.width, tile.height, kBlockSide, [&](int bx0, int by0, int bx1, int by1) {
            Empty empty;
            RayBeam beam;
            if (bx1 - bx0 > kGroupSide && beam_of(tile, bx0, by0, bx1 - 1, by1 - 1, frame_, limits_, beam))
                empty = {beam.axis, beam.forward, search(beam, limits_.spread, 0)};
            if (empty.until == int32_t(frame_.side())) {
                for (int y = by0; y < by1; ++y)
                    for (int x = bx0; x < bx1; ++x) hit_at(x, y) = {};
                return;
            }
            for_blocks(bx0, by0, bx1, by1, kGroupSide, [&](int x0, int y0, int x1, int y1) {
                size_t count = 0;
                for (int y = y0; y < y1; ++y)
                    for (int x = x0; x < x1; ++x) rays[count++] = tile.ray(x, y);
                cast_group(std::span<const VoxelRay>(rays.data(), count), empty, std::span(found.data(), count));
                count = 0;
                for (int y = y0; y < y1; ++y)
                    for (int x = x0; x < x1; ++x) hit_at(x, y) = found[count++];
            });
        });
    }

private:
    // What is surely empty for some rays: all before a plane, counted from the side of the cube where rays along the axis come from.
    struct Empty {
        int axis = 3;  // 3: nothing known
        bool forward = true;
        int32_t until = 0;
    };

    // Calls visit(x0, y0, x1, y1) for squares that cover a rectangle.
    template <class Visit>
    static void for_blocks(int x0, int y0, int x1, int y1, int side, const Visit& visit) {
        for (int y = y0; y < y1; y += side)
            for (int x = x0; x < x1; x += side) visit(x, y, std::min(x + side, x1), std::min(y + side, y1));
    }

    int32_t search(const RayBeam& beam, double spread, int32_t from) const {
        return BeamSearch(nodes_, frame_, limits_.depth, beam, spread, limits_.footprint).empty_until(from);
    }

    // At most kGroupRays.
    void cast_group(std::span<const VoxelRay> rays, Empty empty, std::span<Hit> hits) {
        size_t count = 0;
        for (size_t i = 0; i < rays.size(); ++i) {
            hits[i] = {};
            if (!prepare_walk(frame_, rays[i], limits_, walks_[count])) continue;
            numbers_[count++] = i;
        }
        if (count == 0) return;
        const int32_t side = int32_t(frame_.side());
        RayBeam beam;
        if (count > 1 && beam_of(std::span<const RayWalk>(walks_.data(), count), 0.0, beam)) {
            double spread = 0.0;  // scaled as t is, for each ray
            for (size_t i = 0; i < count; ++i) spread = std::max(spread, walks_[i].spread);
            const bool continues = empty.axis == beam.axis && empty.forward == beam.forward;
            empty = {beam.axis, beam.forward, search(beam, spread, continues ? empty.until : 0)};
            if (empty.until == side) return;
        }
        const int32_t plane = empty.forward ? empty.until : side - empty.until;
        WalkStart start;
        for (size_t i = 0; i < count; ++i) {
            if (!enter_cube(walks_[i], empty.axis, plane, start)) continue;
            look_.begin(rays[numbers_[i]]);
            walk_to_hit(look_, walks_[i], start, path_, hits[numbers_[i]]);
        }
    }

    const Nodes& nodes_;
    const VoxelFrame& frame_;
    const RayLimits& limits_;
    Look look_;
    NodePath path_;  // of the last ray: the next is near it
    std::array<RayWalk, kGroupRays> walks_;
    std::array<size_t, kGroupRays> numbers_;  // of the rays that walk
};

}  // namespace strata
