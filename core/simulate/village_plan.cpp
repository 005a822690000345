#include "core/simulate/village_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/math/random.h"
#include "core/simulate/house_plan.h"
#include "core/simulate/waves.h"

namespace strata {
namespace {

Vec2d left_of(const Vec2d& v) { return {-v.y(), v.x()}; }

Vec2d direction(double turns) {
    const SinCos angle = sin_cos_turns(turns);
    return {angle.cos, angle.sin};
}

class TilePlanner {
public:
    TilePlanner(const Land& land, const Terrain& terrain, int64_t column, int64_t row)
        : land_(land), terrain_(terrain), column_(column), row_(row),
          random_(mix_bits(uint64_t(column) * 0x9e3779b97f4a7c15u ^ mix_bits(uint64_t(row) ^ land.seed()))) {
        tile_.column = column;
        tile_.row = row;
        middle_ = Vec2d(double(column), double(row)) * kTileSize;
        tile_.low = middle_ - Vec2d::Constant(0.5 * kTileSize);
        crossing_ = land.crossing(column, row);
    }

    SceneTile plan() {
        if (land_.settled(column_, row_)) {
            place_pond();
            place_church();
            place_houses();
            place_gardens();
            place_lamps();
        }
        place_power_line();
        place_avenue();
        place_woods();
        place_hedges();
        index_tile(tile_, terrain_);
        return std::move(tile_);
    }

private:
    struct Spot {
        Vec2d center;
        double radius;
    };

    double ground(const Vec2d& p) const {
        GroundSample sample = terrain_.slope(p.x(), p.y());
        tile_.pond.lower(p.x(), p.y(), sample);
        return sample.height;
    }
    bool inside(const Vec2d& p, double margin) const {
        return ((p - middle_).array().abs() < 0.5 * kTileSize + margin).all();
    }
    bool clear(const Vec2d& center, double radius, double road_margin) const {
        if (!inside(center, -radius - 1.0)) return false;
        if (std::abs(land_.road_distance(center.x(), center.y())) < road_margin) return false;
        return std::none_of(spots_.begin(), spots_.end(),
                            [&](const Spot& spot) { return (spot.center - center).norm() < spot.radius + radius; });
    }
    // The first place clear of roads on a line outward from the crossing.
    Vec2d push_out(const Vec2d& toward, double radius, double road_margin) const {
        Vec2d place = crossing_ + toward;
        for (int i = 0; i < 60 && !clear(place, radius, road_margin); ++i) place += toward.normalized();
        return place;
    }
    void measure_ground(HousePlan& plan) const {
        plan.ground_low = INFINITY;
        plan.ground_high = -INFINITY;
        for (const double u : {-0.5, 0.0, 0.5})
            for (const double v : {-0.5, 0.0, 0.5}) {
                const double height = ground(plan.center + u * plan.length * plan.axis + v * plan.width * left_of(plan.axis));
                plan.ground_low = std::min(plan.ground_low, height);
                plan.ground_high = std::max(plan.ground_high, height);
            }
    }

    void place_pond() {
        Pond pond;
        pond.radius = 21.0 + 6.0 * random_.uniform();
        pond.center = push_out(34.0 * direction(0.86), pond.radius - 3.0, pond.radius + 3.0);
        const double middle = terrain_.height(pond.center.x(), pond.center.y());
        double rim = INFINITY;
        for (int i = 0; i < 32; ++i) {
            const Vec2d p = pond.center + pond.radius * direction(i / 32.0);
            rim = std::min(rim, terrain_.height(p.x(), p.y()));
        }
        pond.water_level = rim - 0.35;
        pond.depth = middle - pond.water_level + 1.6;
        tile_.pond = pond;
        spots_.push_back({pond.center, pond.radius - 3.0});
        for (int i = 0; i < 22; ++i) {  // reeds and willows around
            const Vec2d p = pond.center + pond.radius * random_.uniform(0.88, 1.05) * direction(random_.uniform());
            if (ground(p) < pond.water_level + 0.1 || std::abs(land_.road_distance(p.x(), p.y())) < 5.0) continue;
            if (i < 4) add_tree(p, Crown::Kind::broadleaf, random_.uniform(2.4, 3.6), random_.uniform(7.0, 10.0), Vec3f(0.46f, 0.56f, 0.26f));
            else add_bush(p, random_.uniform(0.5, 1.1), Vec3f(0.48f, 0.53f, 0.24f));
        }
    }

    void place_church() {
        HousePlan plan;
        plan.length = 19.0;
        plan.width = 9.4;
        plan.wall_height = 7.2;
        plan.pitch = 1.25;
        plan.axis = direction(0.03 * random_.uniform(-1.0, 1.0));
        plan.center = push_out(Vec2d(-17.0, 19.0), 13.0, 15.5);
        plan.seed = random_.bits();
        measure_ground(plan);
        tile_.buildings.push_back(build_church(plan));
        spots_.push_back({plan.center, 12.0});
        spots_.push_back({plan.center - 12.0 * plan.axis, 6.0});
        tile_.pads.push_back({.center = plan.center - 2.0 * plan.axis, .axis = plan.axis, .half_length = 17.0, .half_width = 8.2,
                              .shade = {Vec3f(0.72f, 0.68f, 0.58f), 0.35f, 2}});
        for (int i = 0; i < 4; ++i) {  // lindens in the churchyard
            const Vec2d p = plan.center + (i - 1.2) * 7.5 * plan.axis + 10.5 * left_of(plan.axis);
            if (std::abs(land_.road_distance(p.x(), p.y())) > 6.0)
                add_tree(p, Crown::Kind::broadleaf, random_.uniform(2.6, 3.2), random_.uniform(8.0, 10.0), Vec3f(0.36f, 0.52f, 0.20f));
        }
    }

    void place_houses() {
        const double radius = land_.village_radius(column_, row_);
        for (const bool east : {true, false})
            for (const double forward : {1.0, -1.0})
                for (const double side : {1.0, -1.0})
                    for (double s = random_.uniform(11.0, 15.0); s < radius; s += 1.5) {
                        if (place_roadside_house(east, forward, side, s)) s += random_.uniform(7.0, 12.0);
                        else if (s > 0.6 * radius) s += random_.uniform(0.0, 20.0);
                    }
        for (int i = 0; i < 160; ++i) {  // behind the first row
            const Vec2d p = crossing_ + radius * 0.9 * std::sqrt(random_.uniform()) * direction(random_.uniform());
            const bool east = std::abs(land_.east_road_y(row_, p.x()) - p.y()) < std::abs(land_.north_road_x(column_, p.y()) - p.x());
            place_house(p, east ? Vec2d::UnitX() : Vec2d::UnitY(), random_.uniform() < 0.5, 3.0, 17.0);
        }
    }

    bool place_roadside_house(bool east, double forward, double side, double s) {
        Vec2d place, tangent;
        if (east) {
            const double x = crossing_.x() + forward * s;
            place = {x, land_.east_road_y(row_, x)};
            tangent = Vec2d(1.0, land_.east_road_slope(row_, x)).normalized();
        } else {
            const double y = crossing_.y() + forward * s;
            place = {land_.north_road_x(column_, y), y};
            tangent = Vec2d(land_.north_road_slope(column_, y), 1.0).normalized();
        }
        const bool gable_to_road = random_.uniform() < 0.35;
        const double setback = random_.uniform(5.8, 8.5) + (gable_to_road ? 5.4 : 4.2);
        return place_house(place + side * setback * left_of(tangent), tangent, gable_to_road, random_.uniform(0.8, 2.6), 9.4);
    }

    bool place_house(const Vec2d& center, const Vec2d& tangent, bool turned, double gap, double road_margin) {
        HousePlan plan;
        plan.center = center;
        plan.seed = random_.bits();
        plan.length = random_.uniform(9.5, 13.5);
        plan.width = random_.uniform(7.6, 9.6);
        plan.wall_height = random_.uniform() < 0.6 ? random_.uniform(5.1, 5.8) : random_.uniform(2.9, 3.4);
        plan.pitch = random_.uniform(0.85, 1.2);
        plan.axis = (turned ? left_of(tangent) : tangent) + 0.04 * random_.uniform(-1.0, 1.0) * left_of(turned ? left_of(tangent) : tangent);
        plan.axis.normalize();
        const double reach = 0.5 * std::hypot(plan.length, plan.width);
        if (!clear(center, 0.86 * reach + gap, road_margin)) return false;
        measure_ground(plan);
        if (plan.ground_high - plan.ground_low > 2.2) return false;
        tile_.buildings.push_back(build_house(plan));
        spots_.push_back({center, 0.86 * reach});
        // A paved terrace around, and a drive towards the nearer road.
        const Shade paving = {Vec3f(0.63f, 0.60f, 0.56f) + Vec3f::Constant(float(random_.uniform(-0.05, 0.05))), 0.3f, 2};
        tile_.pads.push_back({.center = center, .axis = plan.axis, .half_length = 0.5 * plan.length + 1.0, .half_width = 0.5 * plan.width + 1.0, .shade = paving});
        const double distance = land_.road_distance(center.x(), center.y());
        constexpr double kStep = 0.5;
        Vec2d to_road(land_.road_distance(center.x() + kStep, center.y()) - land_.road_distance(center.x() - kStep, center.y()),
                      land_.road_distance(center.x(), center.y() + kStep) - land_.road_distance(center.x(), center.y() - kStep));
        if (std::abs(distance) < 30.0 && to_road.norm() > 0.5 && to_road.norm() < 1.5) {
            to_road *= -std::copysign(1.0, distance) / to_road.norm();
            const double half = 0.5 * std::abs(distance) - 1.0;
            const Vec2d drive = center + (half - 0.5) * to_road + random_.uniform(2.0, 3.2) * left_of(to_road);
            tile_.pads.push_back({.center = drive, .axis = to_road, .half_length = half - 1.0, .half_width = 1.4, .shade = paving});
        }
        return true;
    }

    void place_gardens() {
        const double radius = land_.village_radius(column_, row_) + 12.0;
        for (int i = 0; i < 1300; ++i) {
            const Vec2d p = crossing_ + radius * std::sqrt(random_.uniform()) * direction(random_.uniform());
            const double pick = random_.uniform();
            const double crown = pick < 0.3 ? random_.uniform(0.5, 1.0) : random_.uniform(1.4, 3.1);
            if (!clear(p, 0.75 * crown + 0.4, 5.4 + 0.6 * crown)) continue;
            if (tile_.pond.near(p.x(), p.y())) continue;
            if (pick < 0.3) {
                const float warm = float(random_.uniform());
                add_bush(p, crown, warm > 0.85f ? Vec3f(0.72f, 0.42f, 0.50f) : Vec3f(0.30f + 0.12f * warm, 0.45f, 0.18f));
            } else if (pick < 0.42) {
                add_tree(p, Crown::Kind::conifer, 0.5 * crown + 1.0, random_.uniform(7.0, 13.0), Vec3f(0.20f, 0.34f, 0.20f));
            } else {
                add_broadleaf(p, crown, random_.uniform(1.9, 2.5) * crown + 2.0);
            }
        }
    }

    void place_lamps() {
        const double radius = land_.village_radius(column_, row_);
        for (double s = -radius; s < radius; s += 27.0) {
            const double y = crossing_.y() + s;
            const Vec2d p(land_.north_road_x(column_, y) + 4.05, y);
            if (std::abs(land_.road_distance(p.x(), p.y())) < 3.4) continue;
            add_pillar(p, 4.6, 0.06, Part::pole, 0);
            const double top = ground(p) + 4.6;
            add_arm(build_box(p - Vec2d(0.35, 0.0), Vec2d::UnitX(), 0.9, 0.22, top - 0.02, top + 0.12, Part::pole));
        }
    }

    void place_power_line() {
        constexpr int kPoles = 12;
        constexpr double kStep = kTileSize / kPoles, kHeight = 8.2, kReach = 0.75;
        std::array<Vec3d, kPoles + 2> tips;
        std::array<Vec2d, kPoles + 2> across;
        for (int i = 0; i < kPoles + 2; ++i) {
            const double x = tile_.low.x() + (i - 0.5) * kStep;
            const Vec2d tangent = Vec2d(1.0, land_.east_road_slope(row_, x)).normalized();
            const Vec2d p = Vec2d(x, land_.east_road_y(row_, x)) + 5.0 * left_of(tangent);
            across[size_t(i)] = left_of(tangent);
            tips[size_t(i)] = Vec3d(p.x(), p.y(), ground(p) + kHeight);
            if (!inside(p, 1.0)) continue;
            add_pillar(p, kHeight, 0.14, Part::pole, 0);
            add_arm(build_box(p, across[size_t(i)], 2.0 * kReach + 0.2, 0.12, tips[size_t(i)].z() - 0.6, tips[size_t(i)].z() - 0.46, Part::pole));
        }
        for (size_t i = 0; i + 1 < tips.size(); ++i)
            for (const double offset : {-kReach, kReach}) {
                const Vec3d lift(0.0, 0.0, -0.36);
                const Vec3d shift_a(offset * across[i].x(), offset * across[i].y(), 0.0), shift_b(offset * across[i + 1].x(), offset * across[i + 1].y(), 0.0);
                tile_.wires.push_back({.begin = tips[i] + shift_a + lift, .end = tips[i + 1] + shift_b + lift, .sag = 0.75, .radius = 0.012});
            }
    }

    void place_avenue() {
        // Trees along the northward road, outside the villages.
        constexpr double kStep = 16.0;
        const int64_t first = floor_to_int(tile_.low.y() / kStep) - 1;
        for (int64_t k = first; k < first + int64_t(kTileSize / kStep) + 3; ++k)
            for (const double side : {-1.0, 1.0}) {
                const double y = double(k) * kStep + 2.0 * side;
                const Vec2d p(land_.north_road_x(column_, y) + side * 6.8, y);
                if (lattice_value(column_, k, int64_t(side), land_.seed() ^ 0x6176u) < 0.25 || land_.in_village(p.x(), p.y())) continue;
                if (std::abs(land_.east_road_y(row_, p.x()) - p.y()) < 12.0) continue;
                add_hashed_tree(p, mix_bits(uint64_t(k) * 2 + uint64_t(side > 0.0) + uint64_t(column_) * 7919), false);
            }
    }

    void place_woods() {
        constexpr double kStep = 5.6;
        const auto index = [&](double coordinate) { return floor_to_int(coordinate / kStep); };
        for (int64_t j = index(tile_.low.y()) - 1; j <= index(tile_.low.y() + kTileSize) + 1; ++j)
            for (int64_t i = index(tile_.low.x()) - 1; i <= index(tile_.low.x() + kTileSize) + 1; ++i) {
                const Vec2d p = kStep * Vec2d(double(i) + 0.15 + 0.7 * lattice_value(i, j, 1, land_.seed()), double(j) + 0.15 + 0.7 * lattice_value(i, j, 2, land_.seed()));
                if (inside(p, 5.0) && land_.in_wood(p.x(), p.y())) add_hashed_tree(p, mix_bits(uint64_t(i) * 0x9e3779b97f4a7c15u ^ uint64_t(j)), true);
            }
    }

    void place_hedges() {
        constexpr double kStep = 2.2;
        const auto index = [&](double coordinate) { return floor_to_int(coordinate / kStep); };
        for (int64_t j = index(tile_.low.y()) - 1; j <= index(tile_.low.y() + kTileSize) + 1; ++j)
            for (int64_t i = index(tile_.low.x()) - 1; i <= index(tile_.low.x() + kTileSize) + 1; ++i) {
                const Vec2d p = kStep * Vec2d(double(i) + 0.3 * lattice_value(i, j, 3, land_.seed()), double(j) + 0.3 * lattice_value(i, j, 4, land_.seed()));
                const Land::Field field = land_.field(p.x(), p.y());
                if (field.edge > 0.9 || field.edge_id % 3 != 0 || !inside(p, 3.0)) continue;
                if (land_.in_village(p.x(), p.y()) || land_.in_wood(p.x(), p.y()) || std::abs(land_.road_distance(p.x(), p.y())) < 8.0) continue;
                const uint64_t hash = mix_bits(uint64_t(i) * 0x9e3779b97f4a7c15u ^ uint64_t(j) ^ 0x6865u);
                if (hash % 17 == 0) add_hashed_tree(p, hash, false);
                else if (hash % 5 != 0) {
                    Random random(hash);
                    add_bush(p, random.uniform(0.8, 1.5), Vec3f(0.29f + 0.1f * float(random.uniform()), 0.42f, 0.17f), hash);
                }
            }
    }

    void add_hashed_tree(const Vec2d& p, uint64_t hash, bool wood) {
        Random random(hash);
        if (wood && smooth_noise(p.x() / 70.0, p.y() / 70.0, land_.seed() ^ 0x6b69u) > 0.5) {
            const float tone = float(random.uniform());
            add_tree(p, Crown::Kind::conifer, random.uniform(2.0, 2.9), random.uniform(15.0, 24.0), Vec3f(0.16f + 0.06f * tone, 0.29f + 0.07f * tone, 0.17f), hash);
            return;
        }
        const double crown = wood ? random.uniform(2.6, 3.9) : random.uniform(2.2, 3.4);
        const double height = wood ? random.uniform(13.0, 19.0) : random.uniform(8.0, 12.0);
        const float tone = float(random.uniform());
        add_tree(p, Crown::Kind::broadleaf, crown, height, Vec3f(0.26f + 0.16f * tone, 0.42f + 0.10f * tone, 0.17f), hash);
    }

    void add_broadleaf(const Vec2d& p, double crown, double height) {
        const double pick = random_.uniform();
        const float tone = float(random_.uniform());
        Vec3f color(0.27f + 0.16f * tone, 0.44f + 0.10f * tone, 0.17f + 0.04f * tone);
        if (pick < 0.06) color = Vec3f(0.90f, 0.78f, 0.80f);       // in blossom
        else if (pick < 0.10) color = Vec3f(0.48f, 0.25f, 0.22f);  // a copper beech
        else if (pick < 0.16) color = Vec3f(0.66f, 0.56f, 0.22f);
        add_tree(p, Crown::Kind::broadleaf, crown, height, color);
    }

    void add_tree(const Vec2d& p, Crown::Kind kind, double crown, double height, const Vec3f& color, uint64_t hash = 0) {
        if (hash == 0) hash = random_.bits();
        const double foot = ground(p);
        const bool conifer = kind == Crown::Kind::conifer;
        const double low = conifer ? 0.09 * height : std::min(0.28 * height, 2.4);
        const double half = 0.5 * (height - low);
        tile_.crowns.push_back({.center = Vec3d(p.x(), p.y(), foot + low + half), .radius = crown, .half_height = half, .kind = kind, .seed = uint32_t(hash)});
        tile_.crown_looks.push_back({color});
        add_pillar(p, low + (conifer ? 1.5 : 0.9) * half, 0.09 + 0.012 * height, Part::trunk, uint32_t(tile_.crowns.size() - 1));
    }

    void add_bush(const Vec2d& p, double radius, const Vec3f& color, uint64_t hash = 0) {
        if (hash == 0) hash = random_.bits();
        tile_.crowns.push_back({.center = Vec3d(p.x(), p.y(), ground(p) + 0.6 * radius), .radius = radius, .half_height = 0.85 * radius,
                                .kind = Crown::Kind::bush, .seed = uint32_t(hash)});
        tile_.crown_looks.push_back({color});
    }

    void add_pillar(const Vec2d& p, double height, double radius, Part part, uint32_t owner) {
        const double foot = ground(p);
        tile_.pillars.push_back({.center = p, .low = foot - 0.5, .high = foot + height, .radius = radius, .part = part, .owner = owner});
    }

    void add_arm(ConvexSolid solid) {
        Building arm;
        arm.bounds = solid.bounds;
        arm.solids.push_back(std::move(solid));
        tile_.buildings.push_back(std::move(arm));
    }

    const Land& land_;
    const Terrain& terrain_;
    int64_t column_, row_;
    Random random_;
    SceneTile tile_;
    Vec2d middle_, crossing_;
    std::vector<Spot> spots_;
};

}  // namespace

SceneTile plan_village_tile(const Land& land, const Terrain& terrain, int64_t column, int64_t row) {
    return TilePlanner(land, terrain, column, row).plan();
}

}  // namespace strata
