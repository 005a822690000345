#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/math/box.h"
#include "core/simulate/land.h"
#include "core/simulate/shapes.h"
#include "core/simulate/terrain.h"

namespace strata {

/// How a building is painted.
struct BuildingLook {
    Vec3f wall = Vec3f::Ones(), roof = Vec3f::Ones(), shutter = Vec3f::Ones();
    bool timbered = false;
    double floor_level = 0.0;  // world height of the ground floor
    uint64_t seed = 0;
};

struct Building {
    Box3d bounds;
    std::vector<ConvexSolid> solids;  // their union
    BuildingLook look;
};

/// A paved rectangle on the ground: no height, only a color.
struct Pad {
    Vec2d center = Vec2d::Zero(), axis = Vec2d::UnitX();
    double half_length = 1.0, half_width = 1.0;
    Shade shade;

    bool covers(double x, double y) const {
        const Vec2d q = Vec2d(x, y) - center;
        return std::abs(q.dot(axis)) < half_length && std::abs(axis.x() * q.y() - axis.y() * q.x()) < half_width;
    }
};

struct CrownLook {
    Vec3f color = Vec3f(0.3f, 0.45f, 0.2f);
};

/// Everything that stands on one square of the scene, with a grid over it. A pure function of the scene's seed and the
/// tile's place, so it is made when a beam comes near and dropped afterwards. What reaches over the border is in both tiles.
struct SceneTile {
    static constexpr int kCells = 64;                             // a side
    static constexpr double kCellSize = kTileSize / kCells;       // 8 m
    enum class ItemKind : uint32_t { building, pillar, wire, crown, pad };
    struct Item {
        ItemKind kind;
        uint32_t index;
    };
    struct Cell {
        float ground_top = 0.0f;  // the ground and the water in this cell are lower
        float top = 0.0f;         // so is everything else, counting the width of a beam
        uint32_t first = 0, count = 0;
    };

    int64_t column = 0, row = 0;
    Vec2d low = Vec2d::Zero();  // south-west corner
    double top = 0.0;           // of all cells
    double curvature_bound = 0.0;
    Pond pond;
    std::vector<Building> buildings;
    std::vector<Pillar> pillars;
    std::vector<Wire> wires;
    std::vector<Crown> crowns;
    std::vector<CrownLook> crown_looks;  // [crowns]
    std::vector<Pad> pads;
    std::vector<Cell> cells;             // [kCells * kCells] rows of x
    std::vector<Item> items;             // of the cells, one after another
    std::vector<GroundPatch> patches;    // [kCells * kCells] the ground of each cell, but for the pond
    double patch_error = 0.0;            // metres

    const Cell& cell(int x, int y) const { return cells[size_t(y) * kCells + size_t(x)]; }
    std::span<const Item> items_of(const Cell& c) const { return {items.data() + c.first, c.count}; }
    const GroundPatch& patch(int x, int y) const { return patches[size_t(y) * kCells + size_t(x)]; }
    /// The cell that holds a place in this tile.
    Vec2i cell_of(double x, double y) const;
};

/// Fills the grid from the lists. `terrain`: the ground without the pond.
void index_tile(SceneTile& tile, const Terrain& terrain);

}  // namespace strata
