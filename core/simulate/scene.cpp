#include "core/simulate/scene.h"

#include <algorithm>
#include <cmath>

#include "core/simulate/village_plan.h"

namespace strata {
namespace {

GroundSample tile_slope(const Terrain& terrain, const SceneTile& tile, double x, double y) {
    GroundSample ground = terrain.slope(x, y);
    tile.pond.lower(x, y, ground);
    return ground;
}

// Steps along one axis from border to border of a lattice.
struct AxisWalk {
    // pace: distance flown for a metre along the axis; infinite when the axis is never left
    AxisWalk(double origin, double pace, int64_t index, double low, double size)
        : step(pace > 0.0 ? 1 : -1),
          period(size * std::abs(pace)),
          next(std::isinf(pace) ? pace * step : (low + double(index + (pace > 0.0 ? 1 : 0)) * size - origin) * pace) {}

    int64_t step;
    double period, next;  // distance between borders, and to the next one
};

}  // namespace

const SceneTile& SceneProbe::tile_at(int64_t column, int64_t row) {
    for (auto tile = tiles_.begin(); tile != tiles_.end(); ++tile) {
        if ((*tile)->column != column || (*tile)->row != row) continue;
        if (tile != tiles_.begin()) tiles_.splice(tiles_.begin(), tiles_, tile);
        return *tiles_.front();
    }
    if (tiles_.size() >= kTilesKept) tiles_.pop_back();
    tiles_.push_front(std::make_unique<SceneTile>(plan_village_tile(scene_->land(), scene_->terrain(), column, row)));
    return *tiles_.front();
}

void SceneProbe::trace(const Ray& ray, double farthest, double beam_radius, BeamPath& path) {
    path.hard = RayHit{};
    path.tile = nullptr;
    path.leaf_count = path.wire_count = 0;
    const double top = scene_->top();
    double t = 0.0;
    if (ray.origin.z() > top) {
        if (ray.direction.z() >= 0.0) return;
        t = (top - ray.origin.z()) / ray.direction.z();
    } else if (ray.direction.z() > 0.0) {
        farthest = std::min(farthest, (top - ray.origin.z()) / ray.direction.z());
    }
    const Vec3d start = ray.at(t);
    int64_t column = tile_index(start.x()), row = tile_index(start.y());
    const Vec3d pace = ray.direction.cwiseInverse();
    AxisWalk x(ray.origin.x(), pace.x(), column, -0.5 * kTileSize, kTileSize);
    AxisWalk y(ray.origin.y(), pace.y(), row, -0.5 * kTileSize, kTileSize);
    while (t < farthest) {
        const double leave = std::min({x.next, y.next, farthest});
        trace_tile(tile_at(column, row), ray, pace, t, leave, beam_radius, path);
        if (path.hard.distance <= leave) break;
        t = leave;
        if (x.next <= y.next) {
            column += x.step;
            x.next += x.period;
        } else {
            row += y.step;
            y.next += y.period;
        }
    }
    if (path.hard.distance > farthest) path.hard = RayHit{};
    // What stood in the cells beyond the hard surface is not met.
    const double end = std::min(path.hard.distance, farthest);
    size_t kept = 0;
    for (size_t i = 0; i < path.leaf_count; ++i) {
        path.leaves[i].leave = std::min(path.leaves[i].leave, end);
        if (path.leaves[i].enter < path.leaves[i].leave) path.leaves[kept++] = path.leaves[i];
    }
    path.leaf_count = kept;
    kept = 0;
    for (size_t i = 0; i < path.wire_count; ++i)
        if (path.wires[i].hit.distance < end) path.wires[kept++] = path.wires[i];
    path.wire_count = kept;
}

void SceneProbe::trace_tile(const SceneTile& tile, const Ray& ray, const Vec3d& pace, double enter, double leave, double beam_radius, BeamPath& path) {
    const double oz = ray.origin.z(), dz = ray.direction.z();
    if (dz < 0.0) enter = std::max(enter, (tile.top - oz) / dz);
    else if (dz > 0.0) leave = std::min(leave, (tile.top - oz) / dz);
    else if (oz > tile.top) return;
    if (!(enter < leave)) return;
    if (tile.pond.radius > 0.0) meet_water(tile, ray, enter, leave, path);

    const Vec3d start = ray.at(enter);
    Vec2i cell = tile.cell_of(start.x(), start.y());
    AxisWalk x(ray.origin.x(), pace.x(), cell.x(), tile.low.x(), SceneTile::kCellSize);
    AxisWalk y(ray.origin.y(), pace.y(), cell.y(), tile.low.y(), SceneTile::kCellSize);
    for (double t = enter; t < leave;) {
        const double next = std::min({x.next, y.next, leave});
        const SceneTile::Cell& here = tile.cell(cell.x(), cell.y());
        const double lowest = oz + dz * (dz < 0.0 ? next : t);
        if (lowest <= here.top) {
            if (here.count > 0) meet_items(tile, tile.items_of(here), ray, pace, beam_radius, path);
            if (lowest <= here.ground_top) {
                const double reach = dz < 0.0 ? std::max(t, (here.ground_top - oz) / dz) : t;
                meet_ground(tile, tile.patch(cell.x(), cell.y()), ray, reach, std::min(next, path.hard.distance), path);
            }
        }
        if (path.hard.distance <= next) return;
        t = next;
        if (x.next <= y.next) {
            cell.x() += int(x.step);
            x.next += x.period;
        } else {
            cell.y() += int(y.step);
            y.next += y.period;
        }
        if (cell.x() < 0 || cell.y() < 0 || cell.x() >= SceneTile::kCells || cell.y() >= SceneTile::kCells) return;
    }
}

void SceneProbe::meet_items(const SceneTile& tile, std::span<const SceneTile::Item> items, const Ray& ray, const Vec3d& pace, double beam_radius, BeamPath& path) {
    for (const SceneTile::Item& item : items) {
        switch (item.kind) {
            case SceneTile::ItemKind::building:
                for (const ConvexSolid& solid : tile.buildings[item.index].solids)
                    if (solid.may_meet(ray, pace, path.hard.distance) && solid.meet(ray, path.hard)) {
                        path.hard.owner = item.index;
                        path.tile = &tile;
                    }
                break;
            case SceneTile::ItemKind::pillar:
                if (tile.pillars[item.index].meet(ray, path.hard)) path.tile = &tile;
                break;
            case SceneTile::ItemKind::wire: {
                WireTouch touch;
                if (path.wire_count == path.wires.size() || !tile.wires[item.index].meet(ray, beam_radius, touch.hit, touch.point)) break;
                const bool known = std::any_of(path.wires.begin(), path.wires.begin() + std::ptrdiff_t(path.wire_count),
                                               [&](const WireTouch& other) { return (other.point - touch.point).norm() < 1e-3; });
                if (!known) path.wires[path.wire_count++] = touch;
                break;
            }
            case SceneTile::ItemKind::crown: {
                LeafSpan span{.crown = &tile.crowns[item.index], .look = &tile.crown_looks[item.index]};
                if (path.leaf_count == path.leaves.size() || !span.crown->span(ray, span.enter, span.leave)) break;
                const bool known = std::any_of(path.leaves.begin(), path.leaves.begin() + std::ptrdiff_t(path.leaf_count), [&](const LeafSpan& other) {
                    return other.crown->seed == span.crown->seed && other.crown->center == span.crown->center;
                });
                if (!known) path.leaves[path.leaf_count++] = span;
                break;
            }
            case SceneTile::ItemKind::pad: break;
        }
    }
}

void SceneProbe::meet_ground(const SceneTile& tile, const GroundPatch& patch, const Ray& ray, double enter, double leave, BeamPath& path) const {
    // Height above ground f along the beam has |f''| <= bend, so f(t) + f'(t) s - bend s^2 / 2 is below f(t + s): its root is
    // a step that cannot pass the first crossing. Near a crossing the steps are Newton's.
    constexpr double kTouch = 1e-10;  // metres of height
    const double dx = ray.direction.x(), dy = ray.direction.y(), dz = ray.direction.z();
    const double bend = tile.curvature_bound * (dx * dx + dy * dy) + 1e-12;
    const auto rate_over = [&](const GroundSample& ground) { return dz - dx * ground.slope_x - dy * ground.slope_y; };
    const auto safe_step = [&](double f, double rate) { return 2.0 * f / (std::sqrt(rate * rate + 2.0 * bend * f) - rate); };
    // Down to the patch, which is cheap, raised by its error: until there the beam is above ground.
    const double slack = tile.patch_error;
    double t = enter;
    bool steep = false;
    for (int i = 0; i < 200 && t <= leave; ++i) {
        const Vec3d p = ray.at(t);
        GroundSample guess = patch.slope(p.x(), p.y());
        tile.pond.lower(p.x(), p.y(), guess);
        const double f = p.z() - guess.height - slack, rate = rate_over(guess);
        if (f <= slack) {
            // Within three errors of the ground. If the beam keeps falling all the way down it crosses once: Newton may jump.
            steep = rate < -1e-3 && rate * rate > 32.0 * bend * slack;
            if (steep) t -= (f + slack) / rate;
            break;
        }
        t += safe_step(f, rate);
    }
    for (int i = 0; i < 200 && (steep || t <= leave); ++i) {
        const Vec3d p = ray.at(t);
        const GroundSample ground = tile_slope(scene_->terrain(), tile, p.x(), p.y());
        const double f = p.z() - ground.height, rate = rate_over(ground);
        const double step = steep ? -f / rate : f > kTouch ? safe_step(f, rate) : 0.0;
        t += step;
        // What the step leaves of f is at most bend / 2 times its square; without bend Newton needs no second look.
        if (f > kTouch ? bend * step * step > kTouch : steep && f < -kTouch && bend * step * step > kTouch) continue;
        if (t > leave) return;
        path.hard = RayHit{.distance = t, .normal = Vec3d(-ground.slope_x, -ground.slope_y, 1.0).normalized(), .part = Part::ground};
        path.tile = &tile;
        return;
    }
}

void SceneProbe::meet_water(const SceneTile& tile, const Ray& ray, double enter, double leave, BeamPath& path) const {
    if (ray.direction.z() >= 0.0) return;
    const double t = (tile.pond.water_level - ray.origin.z()) / ray.direction.z();
    if (t < enter || t > leave || t >= path.hard.distance) return;
    const Vec3d p = ray.at(t);
    if (!tile.pond.near(p.x(), p.y()) || tile_slope(scene_->terrain(), tile, p.x(), p.y()).height >= tile.pond.water_level) return;
    path.hard = RayHit{.distance = t, .normal = Vec3d::UnitZ(), .part = Part::water};
    path.tile = &tile;
}

GroundSample SceneProbe::ground(double x, double y) {
    const SceneTile& tile = tile_at(tile_index(x), tile_index(y));
    GroundSample ground = scene_->terrain().sample(x, y);
    tile.pond.lower(x, y, ground);
    return ground;
}

bool SceneProbe::buried(const Vec3d& p, double margin) {
    const SceneTile& tile = tile_at(tile_index(p.x()), tile_index(p.y()));
    const double height = tile_slope(scene_->terrain(), tile, p.x(), p.y()).height;
    const double floor = tile.pond.near(p.x(), p.y()) ? std::max(height, tile.pond.water_level) : height;
    if (p.z() < floor - margin) return true;
    const Vec2i cell = tile.cell_of(p.x(), p.y());
    for (const SceneTile::Item& item : tile.items_of(tile.cell(cell.x(), cell.y()))) {
        if (item.kind == SceneTile::ItemKind::building) {
            for (const ConvexSolid& solid : tile.buildings[item.index].solids)
                if (solid.contains(p, margin)) return true;
        } else if (item.kind == SceneTile::ItemKind::pillar && tile.pillars[item.index].contains(p, margin)) {
            return true;
        }
    }
    return false;
}

}  // namespace strata
