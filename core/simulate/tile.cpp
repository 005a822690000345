#include "core/simulate/tile.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace strata {
namespace {

constexpr double kWidestBeam = 0.5;  // metres; wires are met this far from their axis

Box3d bounds_of(const Pillar& pillar) {
    Box3d box;
    box.extend(Vec3d(pillar.center.x() - pillar.radius, pillar.center.y() - pillar.radius, pillar.low));
    box.extend(Vec3d(pillar.center.x() + pillar.radius, pillar.center.y() + pillar.radius, pillar.high));
    return box;
}

Box3d bounds_of(const Crown& crown) {
    const Vec3d half(crown.radius, crown.radius, crown.half_height);
    return {crown.center - half, crown.center + half};
}

Box3d bounds_of(const Pad& pad) {
    const double reach = std::hypot(pad.half_length, pad.half_width);
    Box3d box;
    box.extend(Vec3d(pad.center.x() - reach, pad.center.y() - reach, -1e6));
    box.extend(Vec3d(pad.center.x() + reach, pad.center.y() + reach, -1e6));
    return box;
}

// A piece of a wire, short enough for its box to be slim.
Box3d bounds_of(const Wire& wire, double from, double to) {
    Box3d box;
    for (const double s : {from, to}) {
        const double reach = wire.radius + kWidestBeam;
        box.extend(wire.at(s) - Vec3d::Constant(reach));
        box.extend(wire.at(s) + Vec3d::Constant(reach));
    }
    return box;
}

}  // namespace

Vec2i SceneTile::cell_of(double x, double y) const {
    const auto clamped = [](double index) { return std::clamp(int(floor_to_int(index)), 0, kCells - 1); };
    return {clamped((x - low.x()) / kCellSize), clamped((y - low.y()) / kCellSize)};
}

void index_tile(SceneTile& tile, const Terrain& terrain) {
    constexpr int n = SceneTile::kCells;
    constexpr double size = SceneTile::kCellSize;
    tile.curvature_bound = terrain.curvature_bound() + tile.pond.curvature_bound();
    tile.cells.assign(size_t(n) * n, {});
    tile.patches.resize(size_t(n) * n);
    tile.patch_error = terrain.patch_error(0.5 * std::numbers::sqrt2 * size);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            // Above the tangent plane at the middle by no more than the curvature allows. The pond only lowers the ground.
            const double cx = tile.low.x() + (x + 0.5) * size, cy = tile.low.y() + (y + 0.5) * size;
            const GroundPatch& patch = tile.patches[size_t(y) * n + size_t(x)] = terrain.patch(cx, cy);
            const double half = 0.5 * size, reach2 = 2.0 * half * half;
            const double highest = patch.row0[0] + (std::abs(patch.row1[0]) + std::abs(patch.row0[1])) * half +
                                   0.5 * terrain.curvature_bound() * reach2;
            SceneTile::Cell& cell = tile.cells[size_t(y) * n + size_t(x)];
            cell.ground_top = std::nextafter(float(highest), INFINITY);
            cell.top = cell.ground_top;
        }

    struct Entry {
        uint32_t cell;
        SceneTile::Item item;
    };
    std::vector<Entry> entries;
    const auto insert = [&](const Box3d& box, SceneTile::ItemKind kind, size_t index) {
        const auto cell_at = [&](double p, double origin) { return int(floor_to_int((p - origin) / size)); };
        const int x0 = std::max(0, cell_at(box.min.x(), tile.low.x())), x1 = std::min(n - 1, cell_at(box.max.x(), tile.low.x()));
        const int y0 = std::max(0, cell_at(box.min.y(), tile.low.y())), y1 = std::min(n - 1, cell_at(box.max.y(), tile.low.y()));
        for (int y = y0; y <= y1; ++y)
            for (int x = x0; x <= x1; ++x) {
                const uint32_t cell = uint32_t(y * n + x);
                if (!entries.empty() && kind == SceneTile::ItemKind::wire) {  // the pieces of a wire meet in cells
                    const bool known = std::any_of(entries.end() - std::min<std::ptrdiff_t>(std::ptrdiff_t(entries.size()), 16), entries.end(), [&](const Entry& e) {
                        return e.cell == cell && e.item.kind == kind && e.item.index == uint32_t(index);
                    });
                    if (known) {
                        tile.cells[cell].top = std::max(tile.cells[cell].top, std::nextafter(float(box.max.z()), INFINITY));
                        continue;
                    }
                }
                entries.push_back({cell, {kind, uint32_t(index)}});
                tile.cells[cell].top = std::max(tile.cells[cell].top, std::nextafter(float(box.max.z()), INFINITY));
            }
    };
    using enum SceneTile::ItemKind;
    for (size_t i = 0; i < tile.buildings.size(); ++i) insert(tile.buildings[i].bounds, building, i);
    for (size_t i = 0; i < tile.pillars.size(); ++i) insert(bounds_of(tile.pillars[i]), pillar, i);
    for (size_t i = 0; i < tile.wires.size(); ++i) {
        constexpr int kPieces = 16;
        for (int k = 0; k < kPieces; ++k) insert(bounds_of(tile.wires[i], double(k) / kPieces, double(k + 1) / kPieces), wire, i);
    }
    for (size_t i = 0; i < tile.crowns.size(); ++i) insert(bounds_of(tile.crowns[i]), crown, i);
    for (size_t i = 0; i < tile.pads.size(); ++i) insert(bounds_of(tile.pads[i]), pad, i);

    for (const Entry& entry : entries) ++tile.cells[entry.cell].count;
    uint32_t first = 0;
    tile.top = -INFINITY;
    for (SceneTile::Cell& cell : tile.cells) {
        cell.first = first;
        first += cell.count;
        cell.count = 0;
        tile.top = std::max(tile.top, double(cell.top));
    }
    tile.items.resize(entries.size());
    for (const Entry& entry : entries) {
        SceneTile::Cell& cell = tile.cells[entry.cell];
        tile.items[cell.first + cell.count++] = entry.item;
    }
}

}  // namespace strata
