// The truth of a scene: the nearest point of its exposed surface.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/simulate/scene.h"

namespace strata {
namespace {

// The least of f on [low, high], where f has one valley at the scale of kStarts pieces: golden section from the best start.
template <typename Function>
double least_argument(double low, double high, Function&& f) {
    constexpr int kStarts = 32;
    double best = low, best_value = f(low);
    for (int i = 1; i <= kStarts; ++i) {
        const double s = low + (high - low) * i / kStarts, value = f(s);
        if (value < best_value) best_value = value, best = s;
    }
    constexpr double kGolden = 0.6180339887498949;
    const double step = (high - low) / kStarts;
    double a = std::max(low, best - step), b = std::min(high, best + step);
    for (int i = 0; i < 60; ++i) {
        const double c = b - kGolden * (b - a), d = a + kGolden * (b - a);
        if (f(c) < f(d)) b = d;
        else a = c;
    }
    return 0.5 * (a + b);
}

}  // namespace

NearestPoint SceneProbe::nearest_ground(const Vec3d& query) {
    // Newton on the gradient of the squared distance over the foot (x, y); the ground's curvature is so small that the
    // distance has one minimum for queries within 100 m.
    Vec2d foot = query.head<2>();
    for (int i = 0; i < 60; ++i) {
        const GroundSample g = ground(foot.x(), foot.y());
        const double above = g.height - query.z();
        const Vec2d gradient = foot - query.head<2>() + above * Vec2d(g.slope_x, g.slope_y);
        const double xx = 1.0 + g.slope_x * g.slope_x + above * g.curve_xx, yy = 1.0 + g.slope_y * g.slope_y + above * g.curve_yy;
        const double xy = g.slope_x * g.slope_y + above * g.curve_xy;
        const double determinant = xx * yy - xy * xy;
        Vec2d step = determinant > 0.0 && xx > 0.0 ? Vec2d(Vec2d(yy * gradient.x() - xy * gradient.y(), xx * gradient.y() - xy * gradient.x()) / determinant)
                                                   : gradient;
        if (step.norm() > 20.0) step *= 20.0 / step.norm();
        foot -= step;
        if (step.norm() < 1e-12) break;
    }
    const GroundSample g = ground(foot.x(), foot.y());
    NearestPoint nearest;
    nearest.offer(query, Vec3d(foot.x(), foot.y(), g.height), Vec3d(-g.slope_x, -g.slope_y, 1.0).normalized(), Part::ground);
    return nearest;
}

NearestPoint SceneProbe::nearest_surface(const Vec3d& query) {
    NearestPoint best;
    const auto offer = [&](const Vec3d& candidate, const Vec3d& normal, Part part) {
        if ((candidate - query).norm() < best.distance && exposed(candidate)) best.offer(query, candidate, normal, part);
    };
    const NearestPoint on_ground = nearest_ground(query);
    if (exposed(on_ground.point)) best = on_ground;

    // Water covers its bed; straight above or below the query if there, else its edge, which is ground too.
    const auto offer_water = [&](const SceneTile& tile) {
        if (!tile.pond.near(query.x(), query.y()) || ground(query.x(), query.y()).height >= tile.pond.water_level) return;
        offer(Vec3d(query.x(), query.y(), tile.pond.water_level), Vec3d::UnitZ(), Part::water);
    };
    offer_water(tile_at(tile_index(query.x()), tile_index(query.y())));

    // The part of an upright surface that is below ground gives way to the line where it leaves the ground.
    const auto offer_wall = [&](const Vec3d& candidate, const Vec3d& normal, Part part, const Face& face) {
        if (std::abs(normal.z()) < 1e-9 && part == face.part && candidate.z() < ground(candidate.x(), candidate.y()).height) {
            double left = INFINITY, right = -INFINITY;
            for (const Vec3d& p : face.outline) {
                left = std::min(left, face.right.dot(p - face.corner));
                right = std::max(right, face.right.dot(p - face.corner));
            }
            const auto on_line = [&](double s) {
                Vec3d p = face.corner + s * face.right;
                p.z() = ground(p.x(), p.y()).height;
                return p;
            };
            const double s = least_argument(left, right, [&](double at) { return (on_line(at) - query).squaredNorm(); });
            offer(on_line(s), normal, part);
        } else {
            offer(candidate, normal, part);
        }
    };

    // Cells around the query, nearest first, until no cell can hold anything nearer.
    const auto visit_cell = [&](const SceneTile& tile, const SceneTile::Cell& cell) {
        for (const SceneTile::Item& item : tile.items_of(cell)) {
            if (item.kind == SceneTile::ItemKind::building) {
                const Building& building = tile.buildings[item.index];
                const Vec3d outside = query.cwiseMax(building.bounds.min).cwiseMin(building.bounds.max) - query;
                if (outside.norm() > best.distance) continue;
                for (const ConvexSolid& solid : building.solids) solid.nearest_points(query, offer_wall);
            } else if (item.kind == SceneTile::ItemKind::pillar) {
                const Pillar& pillar = tile.pillars[item.index];
                const Vec2d from = query.head<2>() - pillar.center;
                const double reach = from.norm();
                if (reach - pillar.radius > best.distance) continue;
                const Vec2d out = reach > 0.0 ? Vec2d(from / reach) : Vec2d::UnitX();
                const Vec2d side = pillar.center + pillar.radius * out;
                const double z = std::min(query.z(), pillar.high);
                if (z >= ground(side.x(), side.y()).height) {
                    offer(Vec3d(side.x(), side.y(), z), Vec3d(out.x(), out.y(), 0.0), pillar.part);
                } else {
                    const auto on_line = [&](double angle) {
                        const Vec2d p = pillar.center + pillar.radius * Vec2d(std::cos(angle), std::sin(angle));
                        return Vec3d(p.x(), p.y(), ground(p.x(), p.y()).height);
                    };
                    const double angle = least_argument(0.0, 2.0 * std::numbers::pi, [&](double at) { return (on_line(at) - query).squaredNorm(); });
                    offer(on_line(angle), Vec3d(std::cos(angle), std::sin(angle), 0.0), pillar.part);
                }
                const Vec2d lid = pillar.center + std::min(reach, pillar.radius) * out;
                offer(Vec3d(lid.x(), lid.y(), pillar.high), Vec3d::UnitZ(), pillar.part);
            } else if (item.kind == SceneTile::ItemKind::wire) {
                const Wire& wire = tile.wires[item.index];
                const Vec3d axis = wire.at(wire.nearest_parameter(query));
                const Vec3d out = query - axis;
                const double reach = out.norm();
                if (reach < 1e-12 || std::abs(reach - wire.radius) > best.distance) continue;
                offer(axis + wire.radius / reach * out, out / reach, Part::wire);
            }
        }
    };
    constexpr double kSize = SceneTile::kCellSize;
    const auto cell_index = [](double coordinate) { return floor_to_int(coordinate / kSize); };
    const int64_t x0 = cell_index(query.x()), y0 = cell_index(query.y());
    constexpr int kFarthestRing = 64;  // half a kilometre
    for (int ring = 0; ring < kFarthestRing && (ring <= 1 || (ring - 1) * kSize < best.distance); ++ring)
        for (int64_t y = y0 - ring; y <= y0 + ring; ++y)
            for (int64_t x = x0 - ring; x <= x0 + ring; ++x) {
                if (std::max(std::abs(x - x0), std::abs(y - y0)) != ring) continue;
                const double cx = (double(x) + 0.5) * kSize, cy = (double(y) + 0.5) * kSize;
                const SceneTile& tile = tile_at(tile_index(cx), tile_index(cy));
                const Vec2i cell = tile.cell_of(cx, cy);
                visit_cell(tile, tile.cell(cell.x(), cell.y()));
            }
    return best;
}

}  // namespace strata
