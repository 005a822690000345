#include "core/simulate/house_plan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/math/random.h"

namespace strata {
namespace {

constexpr double kOverhang = 0.45;       // of the eaves, metres
constexpr double kVerge = 0.3;           // of the gable ends
constexpr double kRoofThickness = 0.24;
constexpr double kFoundation = 1.5;      // below the lowest ground

Vec3d level(const Vec2d& v) { return {v.x(), v.y(), 0.0}; }
Vec2d left_of(const Vec2d& v) { return {-v.y(), v.x()}; }

// Walls up to the eaves and the gables above them, as one solid that ends inside the roof slabs.
ConvexSolid build_body(const HousePlan& plan, double eaves, Part part) {
    const Vec3d along = level(plan.axis), across = level(left_of(plan.axis));
    const double half_length = 0.5 * plan.length, half_width = 0.5 * plan.width;
    const Vec3d foot(plan.center.x(), plan.center.y(), plan.ground_low - kFoundation);
    ConvexSolid body;
    body.add_plane(across, foot + half_width * across, part);
    body.add_plane(-across, foot - half_width * across, part);
    body.add_plane(along, foot + half_length * along, part);
    body.add_plane(-along, foot - half_length * along, part);
    body.add_plane(-Vec3d::UnitZ(), foot, Part::hidden);
    const Vec3d eaves_point(plan.center.x(), plan.center.y(), eaves);
    for (const double side : {1.0, -1.0})
        body.add_plane(Vec3d(side * plan.pitch * across + Vec3d::UnitZ()), eaves_point + side * half_width * across, part);
    body.close();
    return body;
}

// One slope of the roof: a slab whose underside would touch the body's top were it not half sunk into it.
ConvexSolid build_slab(const HousePlan& plan, double eaves, double side) {
    const Vec3d along = level(plan.axis), across = side * level(left_of(plan.axis));
    const Vec3d up = (plan.pitch * across + Vec3d::UnitZ()).normalized();
    const Vec3d down_slope = (across - plan.pitch * Vec3d::UnitZ()).normalized();
    const Vec3d middle(plan.center.x(), plan.center.y(), eaves);
    const Vec3d edge = middle + 0.5 * plan.width * across;  // on the body's top
    ConvexSolid slab;
    slab.add_plane(up, edge + 0.5 * kRoofThickness * up, Part::roof);
    slab.add_plane(-up, edge - 0.5 * kRoofThickness * up, Part::roof_edge);
    slab.add_plane(down_slope, edge + kOverhang * down_slope, Part::roof_edge);
    slab.add_plane(-across, middle, Part::hidden);  // mitred at the ridge
    slab.add_plane(along, middle + (0.5 * plan.length + kVerge) * along, Part::roof_edge);
    slab.add_plane(-along, middle - (0.5 * plan.length + kVerge) * along, Part::roof_edge);
    slab.close();
    return slab;
}

// Windows in rows below the eaves, evenly spread along each wall that stands on its foundation.
void open_windows(ConvexSolid& body, const HousePlan& plan, double eaves, Random& random) {
    const int door_wall = random.uniform() < 0.5 ? 0 : 1;
    int wall_index = 0;
    for (Face& wall : body.faces) {
        if (std::abs(wall.normal.z()) > 1e-9) continue;
        const bool gable = std::abs(wall.normal.dot(level(plan.axis))) > 0.9;
        const double width = gable ? plan.width : plan.length;
        const double base = wall.corner.z();
        const int columns = std::max(1, int(width / 2.9));
        const double pitch = width / columns;
        for (double sill = eaves - 2.15; sill > plan.ground_high + 0.55; sill -= 2.75) {
            const bool lowest = sill - 2.75 <= plan.ground_high + 0.55;
            for (int i = 0; i < columns; ++i) {
                const double middle = (i + 0.5) * pitch;
                const bool door = lowest && !gable && wall_index == door_wall && i == columns / 2;
                if (door) {
                    wall.openings.push_back({middle - 0.55, middle + 0.55, plan.ground_high + 0.05 - base, plan.ground_high + 2.1 - base});
                } else if (random.uniform() > 0.1) {
                    wall.openings.push_back({middle - 0.55, middle + 0.55, sill - base, sill + 1.3 - base});
                }
            }
        }
        if (gable && plan.pitch * 0.5 * plan.width > 2.9)  // one in the gable
            wall.openings.push_back({0.5 * width - 0.45, 0.5 * width + 0.45, eaves + 0.5 - base, eaves + 1.6 - base});
        ++wall_index;
    }
}

void finish(Building& building) {
    for (const ConvexSolid& solid : building.solids) building.bounds.extend(solid.bounds);
}

}  // namespace

ConvexSolid build_box(const Vec2d& center, const Vec2d& axis, double length, double width, double low, double high, Part part) {
    const Vec3d along = level(axis), across = level(left_of(axis)), foot(center.x(), center.y(), low);
    ConvexSolid box;
    box.add_plane(across, foot + 0.5 * width * across, part);
    box.add_plane(-across, foot - 0.5 * width * across, part);
    box.add_plane(along, foot + 0.5 * length * along, part);
    box.add_plane(-along, foot - 0.5 * length * along, part);
    box.add_plane(-Vec3d::UnitZ(), foot, part);
    box.add_plane(Vec3d::UnitZ(), Vec3d(center.x(), center.y(), high), part);
    box.close();
    return box;
}

Building build_house(const HousePlan& plan) {
    static const std::array<Vec3f, 9> walls = {{{0.95f, 0.94f, 0.90f}, {0.93f, 0.88f, 0.74f}, {0.90f, 0.80f, 0.60f}, {0.87f, 0.72f, 0.63f},
                                                {0.80f, 0.84f, 0.86f}, {0.94f, 0.92f, 0.82f}, {0.85f, 0.86f, 0.76f}, {0.69f, 0.42f, 0.33f}, {0.93f, 0.83f, 0.55f}}};
    static const std::array<Vec3f, 7> roofs = {{{0.62f, 0.34f, 0.26f}, {0.68f, 0.41f, 0.31f}, {0.54f, 0.30f, 0.25f}, {0.60f, 0.38f, 0.29f},
                                                {0.49f, 0.34f, 0.28f}, {0.65f, 0.36f, 0.26f}, {0.36f, 0.36f, 0.38f}}};
    static const std::array<Vec3f, 5> shutters = {{{0.20f, 0.38f, 0.26f}, {0.46f, 0.20f, 0.16f}, {0.25f, 0.36f, 0.50f}, {0.48f, 0.36f, 0.24f}, {0.88f, 0.88f, 0.85f}}};
    Random random(plan.seed);
    const double eaves = plan.ground_high + plan.wall_height;
    Building house;
    house.look.wall = walls[random.bits() % walls.size()];
    house.look.roof = roofs[random.bits() % roofs.size()];
    house.look.shutter = shutters[random.bits() % shutters.size()];
    house.look.timbered = random.uniform() < 0.28;
    if (house.look.timbered) house.look.wall = walls[0];
    house.look.floor_level = plan.ground_high;
    house.look.seed = random.bits();
    house.solids.push_back(build_body(plan, eaves, Part::wall));
    open_windows(house.solids[0], plan, eaves, random);
    house.solids.push_back(build_slab(plan, eaves, 1.0));
    house.solids.push_back(build_slab(plan, eaves, -1.0));
    if (plan.chimney) {
        const Vec2d across = left_of(plan.axis);
        const double off = random.uniform(0.08, 0.2) * plan.width;
        const Vec2d place = plan.center + random.uniform(-0.32, 0.32) * plan.length * plan.axis + off * across;
        const double ridge = eaves + plan.pitch * 0.5 * plan.width;
        house.solids.push_back(build_box(place, plan.axis, 0.6, 0.6, ridge - plan.pitch * off - 1.2, ridge + 0.7, Part::chimney));
    }
    finish(house);
    return house;
}

Building build_church(const HousePlan& plan) {
    Building church;
    church.look.wall = Vec3f(0.94f, 0.91f, 0.83f);
    church.look.roof = Vec3f(0.55f, 0.33f, 0.27f);
    church.look.floor_level = plan.ground_high;
    church.look.seed = plan.seed;
    const double eaves = plan.ground_high + plan.wall_height;
    church.solids.push_back(build_body(plan, eaves, Part::wall));
    for (Face& wall : church.solids[0].faces) {
        if (std::abs(wall.normal.dot(level(left_of(plan.axis)))) < 0.9) continue;
        const double base = wall.corner.z();
        const int columns = int(plan.length / 4.2);
        for (int i = 0; i < columns; ++i) {
            const double middle = (i + 0.5) * plan.length / columns;
            wall.openings.push_back({middle - 0.6, middle + 0.6, plan.ground_high + 1.9 - base, eaves - 1.2 - base});
        }
    }
    church.solids.push_back(build_slab(plan, eaves, 1.0));
    church.solids.push_back(build_slab(plan, eaves, -1.0));

    constexpr double kTower = 5.6;
    const Vec2d tower_center = plan.center - (0.5 * plan.length + 0.3 * kTower) * plan.axis;
    const double tower_top = plan.ground_high + 19.0;
    ConvexSolid tower = build_box(tower_center, plan.axis, kTower, kTower, plan.ground_low - kFoundation, tower_top, Part::wall);
    for (Face& wall : tower.faces) {
        if (std::abs(wall.normal.z()) > 1e-9) continue;
        const double base = wall.corner.z(), middle = 0.5 * kTower;
        wall.openings.push_back({middle - 1.15, middle - 0.25, tower_top - 3.4 - base, tower_top - 1.3 - base});  // sound holes
        wall.openings.push_back({middle + 0.25, middle + 1.15, tower_top - 3.4 - base, tower_top - 1.3 - base});
    }
    church.solids.push_back(tower);
    church.solids.push_back(build_box(tower_center, plan.axis, kTower + 0.7, kTower + 0.7, tower_top - 0.1, tower_top + 0.35, Part::stone));
    ConvexSolid spire;
    constexpr int kSides = 8;
    const double spire_low = tower_top + 0.25, spire_height = 15.5, spire_radius = 0.5 * kTower;
    const Vec3d foot(tower_center.x(), tower_center.y(), spire_low);
    for (int i = 0; i < kSides; ++i) {
        const SinCos angle = sin_cos_turns((i + 0.5) / kSides);
        const Vec2d out = angle.cos * plan.axis + angle.sin * left_of(plan.axis);
        spire.add_plane(Vec3d(level(out) + spire_radius / spire_height * Vec3d::UnitZ()), foot + spire_radius * level(out), Part::spire);
    }
    spire.add_plane(-Vec3d::UnitZ(), foot, Part::hidden);
    spire.close();
    church.solids.push_back(spire);
    finish(church);
    return church;
}

}  // namespace strata
