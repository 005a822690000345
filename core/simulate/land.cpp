#include "core/simulate/land.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace strata {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

struct Bend {
    double length, amplitude;
};
constexpr std::array<Bend, 2> kBends = {{{430.0, 9.0}, {187.0, 3.2}}};  // metres

double bend_phase(uint64_t seed, int64_t line, uint64_t direction, size_t bend) {
    return lattice_value(line, int64_t(bend), int64_t(direction), seed ^ 0x726f6164u);
}

struct Course {
    double lateral, slope;
};

Course course(uint64_t seed, int64_t line, uint64_t direction, double along) {
    Course sum = {double(line) * kTileSize, 0.0};
    for (size_t i = 0; i < kBends.size(); ++i) {
        const SinCos wave = sin_cos_turns(along * (1.0 / kBends[i].length) + bend_phase(seed, line, direction, i));
        sum.lateral += kBends[i].amplitude * wave.sin;
        sum.slope += kBends[i].amplitude * kTwoPi / kBends[i].length * wave.cos;
    }
    return sum;
}

Vec3f mix(const Vec3f& a, const Vec3f& b, double share) { return a + float(share) * (b - a); }

}  // namespace

double Land::east_road_y(int64_t row, double x) const { return course(seed_, row, 0, x).lateral; }
double Land::north_road_x(int64_t column, double y) const { return course(seed_, column, 1, y).lateral; }
double Land::east_road_slope(int64_t row, double x) const { return course(seed_, row, 0, x).slope; }
double Land::north_road_slope(int64_t column, double y) const { return course(seed_, column, 1, y).slope; }

Vec2d Land::crossing(int64_t column, int64_t row) const {
    double x = double(column) * kTileSize, y = double(row) * kTileSize;
    for (int i = 0; i < 12; ++i) {  // the roads' slopes stay below 0.25, so this contracts
        y = east_road_y(row, x);
        x = north_road_x(column, y);
    }
    return {x, y};
}

double Land::road_distance(double x, double y, double* along, double* other) const {
    constexpr double kReach = 40.0;  // beyond, only "far" matters
    const int64_t column = tile_index(x), row = tile_index(y);
    double east = 1e3, north = 1e3;
    if (std::abs(y - double(row) * kTileSize) < kReach) {
        const Course road = course(seed_, row, 0, x);
        east = (y - road.lateral) / std::sqrt(1.0 + road.slope * road.slope);
    }
    if (std::abs(x - double(column) * kTileSize) < kReach) {
        const Course road = course(seed_, column, 1, y);
        north = (x - road.lateral) / std::sqrt(1.0 + road.slope * road.slope);
    }
    const bool east_nearer = std::abs(east) < std::abs(north);
    if (along) *along = east_nearer ? x : y;
    if (other) *other = std::abs(east_nearer ? north : east);
    return east_nearer ? east : north;
}

bool Land::settled(int64_t column, int64_t row) const {
    return (column == 0 && row == 0) || lattice_value(column, row, 0, seed_ ^ 0x76696cu) < 0.42;
}

double Land::village_radius(int64_t column, int64_t row) const {
    return column == 0 && row == 0 ? 165.0 : 80.0 + 90.0 * lattice_value(column, row, 1, seed_ ^ 0x76696cu);
}

bool Land::in_village(double x, double y) const {
    const int64_t column = tile_index(x), row = tile_index(y);
    if (!settled(column, row)) return false;
    const double dx = x - double(column) * kTileSize, dy = y - double(row) * kTileSize;
    constexpr double kRagged = 30.0;  // metres, of the outline
    const double least = village_radius(column, row), reach2 = dx * dx + dy * dy;
    if (reach2 < least * least) return true;
    if (reach2 >= (least + kRagged) * (least + kRagged)) return false;
    const double radius = least + kRagged * smooth_noise(x / 40.0, y / 40.0, seed_ ^ 0x676172u);
    return reach2 < radius * radius;
}

bool Land::in_wood(double x, double y) const {
    const double wide = 0.65 * smooth_noise(x / 260.0, y / 260.0, seed_ ^ 0x776f6f64u);
    if (wide < 0.58 - 0.35) return false;
    const double density = wide + 0.35 * smooth_noise(x / 90.0, y / 90.0, seed_ ^ 0x776f6f65u);
    if (density < 0.58 || in_village(x, y)) return false;
    return std::abs(road_distance(x, y)) > 11.0;
}

Land::Field Land::field(double x, double y) const {
    // Strips in a frame that turns and bends a little from place to place.
    constexpr double kLength = 150.0, kWidth = 62.0;
    const double u = 0.91 * x + 0.41 * y + 14.0 * sin_cos_turns(y / 620.0).sin;
    const double v = -0.41 * x + 0.91 * y + 11.0 * sin_cos_turns(x / 540.0).sin;
    const int64_t column = floor_to_int(u / kLength);
    const double su = u - double(column) * kLength;
    const double shift = kWidth * lattice_value(column, 0, 0, seed_ ^ 0x666cu);
    const int64_t strip = floor_to_int((v + shift) / kWidth);
    const double sv = v + shift - double(strip) * kWidth;
    Field field;
    field.id = mix_bits(uint64_t(column) * 0x9e3779b97f4a7c15u ^ uint64_t(strip) ^ seed_);
    const double to_u = std::min(su, kLength - su), to_v = std::min(sv, kWidth - sv);
    field.edge = std::min(to_u, to_v);
    const double line = to_u < to_v ? std::round(u / kLength) : std::round((v + shift) / kWidth) + 0.5 + 1000.0 * double(column);
    field.edge_id = mix_bits(uint64_t(int64_t(2.0 * line)) ^ seed_ ^ 0x65646765u);
    field.row = v;
    return field;
}

Shade Land::ground(double x, double y) const {
    const double fine = smooth_noise(x / 0.7, y / 0.7, seed_ ^ 0x66u), coarse = smooth_noise(x / 9.0, y / 9.0, seed_ ^ 0x63u);
    double along = 0.0, other = 1e3;
    const double road = road_distance(x, y, &along, &other);
    const double off = std::abs(road);
    if (off < kRoadHalfWidth + 0.15 * fine) {
        const double wear = std::abs(off - 1.5) < 0.45 ? 0.03 : 0.0;
        Vec3f color = Vec3f(0.36f, 0.36f, 0.375f) + Vec3f::Constant(float(0.07 * (fine - 0.5) + 0.08 * (coarse - 0.5) - wear));
        const bool dash = off < 0.09 && along - 6.0 * double(floor_to_int(along / 6.0)) < 3.0;
        const bool edge = std::abs(off - (kRoadHalfWidth - 0.25)) < 0.07;
        const bool painted = (dash || edge) && other > 7.0;
        if (painted) color = Vec3f(0.93f, 0.93f, 0.90f);
        return {color, painted ? 0.6f : 0.17f, 11};
    }
    const bool village = in_village(x, y);
    if (village && off < kSidewalkHalfWidth) {
        const double slab = lattice_value(floor_to_int(x / 0.8), floor_to_int(y / 0.8), 3, seed_);
        return {Vec3f(0.66f, 0.64f, 0.60f) + Vec3f::Constant(float(0.08 * (slab - 0.5))), 0.3f, 2};
    }
    const Vec3f grass = mix(Vec3f(0.34f, 0.43f, 0.21f), Vec3f(0.51f, 0.57f, 0.32f), 0.55 * fine + 0.45 * coarse);
    if (village || off < 6.0) {
        // Some lawns are mown shorter than others.
        const double lot = lattice_value(floor_to_int(x / 19.0), floor_to_int(y / 23.0), 5, seed_);
        Vec3f color = mix(grass, Vec3f(0.56f, 0.62f, 0.30f), 0.35 * lot);
        const double flower = lattice_value(floor_to_int(x / 0.25), floor_to_int(y / 0.25), 9, seed_);
        if (flower > 0.9965) color = flower > 0.9985 ? Vec3f(0.95f, 0.92f, 0.80f) : Vec3f(0.93f, 0.80f, 0.25f);
        return {color, 0.48f, 2};
    }
    if (in_wood(x, y)) return {mix(Vec3f(0.33f, 0.26f, 0.17f), Vec3f(0.25f, 0.32f, 0.14f), 0.5 * fine + 0.5 * coarse), 0.38f, 2};
    const Field plot = field(x, y);
    if (plot.edge < 1.6 + coarse) return {mix(grass, Vec3f(0.52f, 0.55f, 0.28f), 0.4), 0.46f, 2};
    struct Crop {
        Vec3f color;
        float reflectance;
        double furrow;  // metres between rows; 0: none
    };
    static const std::array<Crop, 8> crops = {{{{0.78f, 0.70f, 0.46f}, 0.45f, 0.0},    // ripe wheat
                                               {{0.47f, 0.56f, 0.30f}, 0.52f, 0.0},    // young cereal
                                               {{0.41f, 0.50f, 0.26f}, 0.50f, 0.0},    // meadow
                                               {{0.41f, 0.50f, 0.26f}, 0.50f, 0.0},
                                               {{0.48f, 0.37f, 0.26f}, 0.28f, 1.6},    // ploughed
                                               {{0.83f, 0.77f, 0.34f}, 0.50f, 0.0},    // rape in flower
                                               {{0.34f, 0.46f, 0.23f}, 0.48f, 1.5},    // maize
                                               {{0.72f, 0.63f, 0.43f}, 0.42f, 2.4}}};  // stubble
    const Crop& crop = crops[plot.id % crops.size()];
    double light = 0.92 + 0.10 * fine + 0.10 * coarse;
    if (crop.furrow > 0.0) light += 0.11 * sin_cos_turns(plot.row / crop.furrow).sin;
    const double track = plot.row - 16.0 * double(floor_to_int(plot.row / 16.0));
    if (std::abs(track - 7.2) < 0.3 || std::abs(track - 8.8) < 0.3) light -= 0.14;  // wheel tracks
    return {crop.color * float(light), crop.reflectance, 2};
}

}  // namespace strata
