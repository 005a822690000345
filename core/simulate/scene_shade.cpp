// Colors of the village: what each surface looks like at a point.
#include <algorithm>
#include <cmath>

#include "core/simulate/scene.h"
#include "core/simulate/waves.h"

namespace strata {
namespace {

constexpr uint8_t kBuilding = 6, kWater = 9, kWireConductor = 14, kTower = 15, kHighVegetation = 5;  // ASPRS classes

Vec3f gray(double value) { return Vec3f::Constant(float(value)); }

Shade shade_wall(const RayHit& hit, const Vec3d& point, const BuildingLook& look) {
    const double grain = smooth_noise(point.x() / 0.5 + point.z(), point.y() / 0.5 - point.z(), look.seed) - 0.5;
    const double height = point.z() - look.floor_level;
    if (height < 0.4) return {Vec3f(0.60f, 0.58f, 0.55f) + gray(0.07 * grain), 0.4f, kBuilding};
    if (hit.face) {
        const double s = hit.along.x(), z = hit.along.y();
        for (const Opening& o : hit.face->openings) {
            const bool window = o.high - o.low < 1.5;  // doors and church windows have no shutters
            if (!window || z < o.low - 0.05 || z > o.high + 0.05) continue;
            if ((s > o.left - 0.55 && s < o.left - 0.03) || (s > o.right + 0.03 && s < o.right + 0.55)) {
                const double slat = z - 0.12 * double(floor_to_int(z / 0.12));
                return {look.shutter + gray(slat < 0.06 ? 0.03 : -0.03), 0.4f, kBuilding};
            }
        }
        if (look.timbered && height > 2.5) {
            const double post = s - 1.45 * double(floor_to_int(s / 1.45)), beam = height - 2.5 - 2.75 * double(floor_to_int((height - 2.5) / 2.75));
            const double brace = std::abs(post - 0.5 * beam);
            if (post < 0.17 || beam < 0.19 || (brace < 0.11 && floor_to_int(s / 1.45) % 3 == 0))
                return {Vec3f(0.36f, 0.23f, 0.15f) + gray(0.08 * grain), 0.3f, kBuilding};
        }
    }
    return {look.wall + gray(0.05 * grain), 0.55f, kBuilding};
}

Shade shade_pane(const RayHit& hit, const Vec3d& point, const BuildingLook& look) {
    const double s = hit.along.x(), z = hit.along.y();
    for (const Opening& o : hit.face->openings) {
        if (s < o.left - 1e-6 || s > o.right + 1e-6 || z < o.low - 1e-6 || z > o.high + 1e-6) continue;
        const double side = std::min(s - o.left, o.right - s), lid = std::min(z - o.low, o.high - z);
        if (o.high - o.low > 1.9 && o.high - o.low < 2.2 && o.right - o.left > 1.0)  // a door
            return {Vec3f(0.43f, 0.28f, 0.18f) + gray(0.05 * sin_cos_turns(6.4 * s).sin), 0.35f, kBuilding};
        const bool frame = side < 0.09 || lid < 0.09 || std::abs(s - 0.5 * (o.left + o.right)) < 0.04;
        if (frame) return {Vec3f(0.93f, 0.93f, 0.90f), 0.5f, kBuilding};
        const double sky = smooth_noise(point.x() / 1.5, point.z() / 1.5, look.seed);
        return {Vec3f(0.18f, 0.24f, 0.30f) + float(0.16 * sky) * Vec3f(0.8f, 0.9f, 1.0f), 0.08f, kBuilding};
    }
    return {Vec3f(0.2f, 0.25f, 0.3f), 0.08f, kBuilding};
}

Shade shade_roof(const RayHit& hit, const BuildingLook& look) {
    // Rows of tiles, each a little different, patches of older ones, and darker joints.
    const int64_t row = floor_to_int(hit.along.y() / 0.36), column = floor_to_int(hit.along.x() / 0.26 + 0.5 * double(row & 1));
    const double single = lattice_value(row, column, 0, look.seed);
    const double patch = smooth_noise(hit.along.x() / 2.2, hit.along.y() / 1.6, look.seed);
    const double joint = hit.along.y() - 0.36 * double(row) < 0.07 ? -0.10 : 0.0;
    const double light = 1.0 + 0.26 * (single - 0.5) + 0.26 * (patch - 0.5) + joint;
    return {look.roof * float(light), 0.35f, kBuilding};
}

}  // namespace

Shade SceneProbe::shade(const RayHit& hit, const Vec3d& point, const SceneTile* tile) const {
    switch (hit.part) {
        case Part::ground: {
            const Vec2i cell = tile->cell_of(point.x(), point.y());
            Shade ground = scene_->land().ground(point.x(), point.y());
            if (ground.classification != 2) return ground;
            const Pad* pad = nullptr;
            for (const SceneTile::Item& item : tile->items_of(tile->cell(cell.x(), cell.y())))
                if (item.kind == SceneTile::ItemKind::pad && tile->pads[item.index].covers(point.x(), point.y())) pad = &tile->pads[item.index];
            if (pad) {
                ground = pad->shade;
                ground.color += gray(0.10 * (smooth_noise(point.x() / 0.4, point.y() / 0.4, scene_->land().seed()) - 0.5));
            } else if (tile->pond.near(point.x(), point.y()) && point.z() < tile->pond.water_level + 0.3) {
                ground.color = Vec3f(0.47f, 0.42f, 0.31f) + gray(0.08 * (smooth_noise(point.x(), point.y(), 3) - 0.5));
            }
            return ground;
        }
        case Part::water: {
            const double ripple = smooth_noise(point.x() / 1.2, point.y() / 0.6, scene_->land().seed());
            return {Vec3f(0.25f, 0.42f, 0.50f) + float(0.12 * (ripple - 0.4)) * Vec3f(0.8f, 1.0f, 1.0f), 0.25f, kWater};
        }
        case Part::wall: return shade_wall(hit, point, tile->buildings[hit.owner].look);
        case Part::pane: return shade_pane(hit, point, tile->buildings[hit.owner].look);
        case Part::roof: return shade_roof(hit, tile->buildings[hit.owner].look);
        case Part::roof_edge:
        case Part::hidden: return {tile->buildings[hit.owner].look.roof * 0.62f, 0.3f, kBuilding};
        case Part::chimney: return {Vec3f(0.55f, 0.33f, 0.27f) + gray(0.1 * (lattice_value(floor_to_int(point.z() / 0.12), 0, 0, 5) - 0.5)), 0.35f, kBuilding};
        case Part::spire: {
            const double band = lattice_value(floor_to_int(hit.along.y() / 0.4), floor_to_int(hit.along.x() / 0.4), 1, 7);
            return {Vec3f(0.33f, 0.36f, 0.40f) + gray(0.08 * (band - 0.5)), 0.25f, kBuilding};
        }
        case Part::stone: return {Vec3f(0.72f, 0.69f, 0.62f), 0.45f, kBuilding};
        case Part::pole: return {Vec3f(0.47f, 0.40f, 0.33f) + gray(0.08 * (lattice_value(floor_to_int(point.z() / 0.2), 0, 0, 9) - 0.5)), 0.3f, kTower};
        case Part::trunk: return {Vec3f(0.36f, 0.28f, 0.20f) + gray(0.12 * (smooth_noise(point.z() * 2.0, point.x() * 9.0, 11) - 0.5)), 0.4f, kHighVegetation};
        case Part::wire: return {Vec3f(0.30f, 0.30f, 0.31f), 0.25f, kWireConductor};
        case Part::leaf: break;
    }
    return {};
}

}  // namespace strata
