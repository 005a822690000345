#pragma once

#include <array>
#include <cstdint>

#include "core/math/vec.h"

namespace strata {

/// Height of the ground and its derivatives at a place, metres.
struct GroundSample {
    double height = 0.0;
    double slope_x = 0.0, slope_y = 0.0;
    double curve_xx = 0.0, curve_xy = 0.0, curve_yy = 0.0;
};

/// The ground around a place as its Taylor polynomial of degree 4: a good first guess of where a beam lands.
struct GroundPatch {
    GroundSample slope(double x, double y) const;  // curvature left at 0

    Vec2d middle = Vec2d::Zero();
    // Of u^m v^n, where (u, v) is the offset from the middle: m first, so that each row is a polynomial in v.
    std::array<double, 5> row0{};
    std::array<double, 4> row1{};
    std::array<double, 3> row2{};
    std::array<double, 2> row3{};
    double row4 = 0.0;
};

/// Rolling ground without end: a sum of plane waves from 1500 m down to 24 m long.
class Terrain {
public:
    explicit Terrain(uint64_t seed);

    double height(double x, double y) const;
    GroundSample slope(double x, double y) const;   // height and slope; curvature left at 0
    GroundSample sample(double x, double y) const;  // all
    GroundPatch patch(double x, double y) const;
    /// How far a patch is from the ground at most, `reach` metres from its middle.
    double patch_error(double reach) const;

    double highest() const { return highest_; }                    // no point of the ground is higher, nor lower than its negative
    double curvature_bound() const { return curvature_bound_; }  // of the second derivative in any direction, 1/m

private:
    static constexpr size_t kWaves = 8;

    alignas(32) std::array<double, kWaves> x_turns_{}, y_turns_{};  // turns per metre
    alignas(32) std::array<double, kWaves> phase_turns_{}, amplitude_{};
    double highest_ = 0.0, curvature_bound_ = 0.0, fifth_derivative_bound_ = 0.0;
};

/// A hollow with water in it, well inside one tile of the scene. The bed is the terrain minus depth * (1 - r^2/R^2)^3.
struct Pond {
    Vec2d center = Vec2d::Zero();
    double radius = 0.0;  // of the hollow; 0: no pond. The water's edge lies within it
    double depth = 0.0;
    double water_level = 0.0;

    bool near(double x, double y) const {
        const double dx = x - center.x(), dy = y - center.y();
        return dx * dx + dy * dy < radius * radius;
    }
    void lower(double x, double y, GroundSample& ground) const;  // subtracts the hollow where it is
    double curvature_bound() const { return radius > 0.0 ? 6.0 * depth / (radius * radius) : 0.0; }
};

}  // namespace strata
