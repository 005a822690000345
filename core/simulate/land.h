#pragma once

#include <cstdint>

#include "core/math/vec.h"
#include "core/simulate/waves.h"

namespace strata {

/// Side of a tile of the scene, metres. Each tile holds one crossing of two roads, near its middle.
inline constexpr double kTileSize = 512.0;
/// Column or row of the tile that holds a coordinate; tile 0 is centred on the origin.
inline int64_t tile_index(double coordinate) { return floor_to_int(coordinate / kTileSize + 0.5); }

/// What covers a patch of ground, or any surface, to the eye and to the beam.
struct Shade {
    Vec3f color = Vec3f::Zero();  // sRGB, 0..1
    float reflectance = 0.5f;     // of the beam, 0..1
    uint8_t classification = 2;   // ASPRS
};

/// Where roads run, where people live, what grows where: functions of the place, the same however large the scene.
class Land {
public:
    explicit Land(uint64_t seed) : seed_(seed) {}

    uint64_t seed() const { return seed_; }

    // Roads that run east (one a row of tiles) and north (one a column): the lateral coordinate at a place along them.
    double east_road_y(int64_t row, double x) const;
    double north_road_x(int64_t column, double y) const;
    double east_road_slope(int64_t row, double x) const;      // dy/dx
    double north_road_slope(int64_t column, double y) const;  // dx/dy
    Vec2d crossing(int64_t column, int64_t row) const;
    /// Signed distance to the nearest centre line of either direction, metres, exact to a few percent; `along`: metres
    /// along that road; `other`: distance to the road of the other direction.
    double road_distance(double x, double y, double* along = nullptr, double* other = nullptr) const;

    bool settled(int64_t column, int64_t row) const;  // is there a village at the crossing
    double village_radius(int64_t column, int64_t row) const;
    bool in_village(double x, double y) const;
    bool in_wood(double x, double y) const;  // not within villages and not near roads

    struct Field {
        uint64_t id = 0;
        double edge = 0.0;  // distance to the nearest border, about, metres
        double row = 0.0;   // coordinate across the furrows, metres
        uint64_t edge_id = 0;
    };
    Field field(double x, double y) const;

    Shade ground(double x, double y) const;

private:
    uint64_t seed_;
};

inline constexpr double kRoadHalfWidth = 3.0;      // metres
inline constexpr double kSidewalkHalfWidth = 4.3;  // from the centre line to its outer edge

}  // namespace strata
