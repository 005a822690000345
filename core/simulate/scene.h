#pragma once

#include <array>
#include <cstdint>
#include <list>
#include <memory>
#include <span>

#include "core/simulate/land.h"
#include "core/simulate/terrain.h"
#include "core/simulate/tile.h"

namespace strata {

/// The village scene: endless rolling land with villages, roads, fields and woods, the same for the same seed. Coordinates
/// are metres east, north and up from the scene's origin, which lies in the middle of a village. Immutable.
class VillageScene {
public:
    explicit VillageScene(uint64_t seed) : terrain_(seed), land_(seed) {}

    const Terrain& terrain() const { return terrain_; }
    const Land& land() const { return land_; }
    double top() const { return terrain_.highest() + kTallest; }  // nothing is higher

private:
    static constexpr double kTallest = 45.0;  // metres; the spire

    Terrain terrain_;
    Land land_;
};

/// A stretch of a beam inside a crown.
struct LeafSpan {
    double enter = 0.0, leave = 0.0;
    const Crown* crown = nullptr;
    const CrownLook* look = nullptr;
};

/// A wire that the beam touches on its way: it takes a part of the beam and lets the rest pass.
struct WireTouch {
    RayHit hit;
    Vec3d point = Vec3d::Zero();
};

/// What a beam meets, in no order but that all of it lies before the hard surface.
struct BeamPath {
    RayHit hard;  // not found(): the sky
    const SceneTile* tile = nullptr;  // that the hard surface belongs to
    std::array<LeafSpan, 12> leaves;
    size_t leaf_count = 0;
    std::array<WireTouch, 4> wires;
    size_t wire_count = 0;
};

/// Answers questions about a scene. Keeps the tiles it met last, at most kTilesKept: one probe for each thread.
class SceneProbe {
public:
    explicit SceneProbe(const VillageScene& scene) : scene_(&scene) {}

    const VillageScene& scene() const { return *scene_; }

    /// Casts a beam. Solids, poles and trunks are met exactly, the ground to 1e-10 m of height; wires when they touch the
    /// beam. Pointers in `path` hold until the next call.
    void trace(const Ray& ray, double farthest, double beam_radius, BeamPath& path);

    /// The truth: the point of the exposed surface (ground, water, buildings, poles, trunks, wires; no leaves) nearest to
    /// `query`. Exact to 1e-9 m for a query within 100 m of the ground and outside matter. Inside matter, where noise puts
    /// points, it is exact too unless the nearest exposed point lies on a line where two solids of a building meet: there
    /// it is an upper bound.
    NearestPoint nearest_surface(const Vec3d& query);

    /// The ground without water, of the tile at that place: pond beds included.
    GroundSample ground(double x, double y);
    /// Is the point inside a building, pole or trunk, or below ground or water, deeper than `margin`?
    bool buried(const Vec3d& p, double margin);
    /// Color, reflectance and class of what a beam met at `point`, before light falls on it. `tile`: of the path; wires need
    /// none.
    Shade shade(const RayHit& hit, const Vec3d& point, const SceneTile* tile) const;

private:
    static constexpr size_t kTilesKept = 24;  // more than any beam crosses; about 1 MB each

    const SceneTile& tile_at(int64_t column, int64_t row);
    void trace_tile(const SceneTile& tile, const Ray& ray, const Vec3d& pace, double enter, double leave, double beam_radius, BeamPath& path);
    void meet_items(const SceneTile& tile, std::span<const SceneTile::Item> items, const Ray& ray, const Vec3d& pace, double beam_radius, BeamPath& path);
    void meet_ground(const SceneTile& tile, const GroundPatch& patch, const Ray& ray, double enter, double leave, BeamPath& path) const;
    void meet_water(const SceneTile& tile, const Ray& ray, double enter, double leave, BeamPath& path) const;
    NearestPoint nearest_ground(const Vec3d& query);
    bool exposed(const Vec3d& p) { return !buried(p, 1e-7); }

    const VillageScene* scene_;
    std::list<std::unique_ptr<SceneTile>> tiles_;  // the one used last comes first
};

}  // namespace strata
