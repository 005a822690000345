#pragma once

#include "core/simulate/tile.h"

namespace strata {

/// Where a building stands and how large it is, metres.
struct HousePlan {
    Vec2d center = Vec2d::Zero();
    Vec2d axis = Vec2d::UnitX();  // along the ridge
    double length = 11.0, width = 8.5;
    double ground_low = 0.0, ground_high = 0.0;  // of the ground below it
    double wall_height = 5.0;                    // from ground_high to the eaves
    double pitch = 1.0;                          // rise over run of the roof
    bool chimney = true;
    uint64_t seed = 0;
};

/// A gabled house with rows of recessed windows, a door, roof slabs that overhang, and a chimney.
Building build_house(const HousePlan& plan);

/// A church: a high nave with tall windows, a tower at its west end and an eight-sided spire on it.
Building build_church(const HousePlan& plan);

/// An upright box; `axis` along its length.
ConvexSolid build_box(const Vec2d& center, const Vec2d& axis, double length, double width, double low, double high, Part part);

}  // namespace strata
