#include "core/simulate/terrain.h"

#include <cmath>
#include <numbers>

#include "core/simulate/waves.h"

namespace strata {

Terrain::Terrain(uint64_t seed) {
    struct Wave {
        double length, amplitude;
    };
    constexpr std::array<Wave, kWaves> waves = {{{1510, 14}, {730, 6.5}, {410, 3.2}, {235, 1.5}, {128, 0.55}, {71, 0.2}, {43, 0.07}, {24, 0.025}}};
    constexpr double kGoldenTurn = 0.38196601125010515;  // no two directions near each other
    Random random(mix_bits(seed ^ 0x7465727261696eu));
    const double first_turn = random.uniform();
    for (size_t i = 0; i < kWaves; ++i) {
        const auto [sine, cosine] = sin_cos_turns(first_turn + kGoldenTurn * double(i));
        x_turns_[i] = cosine / waves[i].length;
        y_turns_[i] = sine / waves[i].length;
        phase_turns_[i] = random.uniform();
        amplitude_[i] = waves[i].amplitude;
        const double k = 2.0 * std::numbers::pi / waves[i].length;
        highest_ += amplitude_[i];
        curvature_bound_ += amplitude_[i] * k * k;
        fifth_derivative_bound_ += amplitude_[i] * k * k * k * k * k;
    }
}

// The waves' sines and cosines land in arrays first: that loop vectorizes, sums in a fixed order would not.
double Terrain::height(double x, double y) const {
    alignas(32) std::array<double, kWaves> sine;
    for (size_t i = 0; i < kWaves; ++i) sine[i] = amplitude_[i] * sin_cos_turns(x_turns_[i] * x + y_turns_[i] * y + phase_turns_[i]).sin;
    double sum = 0.0;
    for (size_t i = 0; i < kWaves; ++i) sum += sine[i];
    return sum;
}

GroundSample Terrain::slope(double x, double y) const {
    alignas(32) std::array<double, kWaves> sine, along_x, along_y;
    for (size_t i = 0; i < kWaves; ++i) {
        const SinCos wave = sin_cos_turns(x_turns_[i] * x + y_turns_[i] * y + phase_turns_[i]);
        sine[i] = amplitude_[i] * wave.sin;
        const double rate = amplitude_[i] * wave.cos * (2.0 * std::numbers::pi);
        along_x[i] = rate * x_turns_[i];
        along_y[i] = rate * y_turns_[i];
    }
    GroundSample ground;
    for (size_t i = 0; i < kWaves; ++i) {
        ground.height += sine[i];
        ground.slope_x += along_x[i];
        ground.slope_y += along_y[i];
    }
    return ground;
}

GroundSample Terrain::sample(double x, double y) const {
    GroundSample ground = slope(x, y);
    for (size_t i = 0; i < kWaves; ++i) {
        const double bend = -amplitude_[i] * (4.0 * std::numbers::pi * std::numbers::pi) *
                            sin_cos_turns(x_turns_[i] * x + y_turns_[i] * y + phase_turns_[i]).sin;
        ground.curve_xx += bend * x_turns_[i] * x_turns_[i];
        ground.curve_xy += bend * x_turns_[i] * y_turns_[i];
        ground.curve_yy += bend * y_turns_[i] * y_turns_[i];
    }
    return ground;
}

GroundPatch Terrain::patch(double x, double y) const {
    GroundPatch patch;
    patch.middle = Vec2d(x, y);
    for (size_t i = 0; i < kWaves; ++i) {
        const SinCos wave = sin_cos_turns(x_turns_[i] * x + y_turns_[i] * y + phase_turns_[i]);
        const double kx = 2.0 * std::numbers::pi * x_turns_[i], ky = 2.0 * std::numbers::pi * y_turns_[i];
        const double s = amplitude_[i] * wave.sin, c = amplitude_[i] * wave.cos;  // derivatives: s, c, -s, -c, s
        const double y2 = ky * ky / 2.0, y3 = y2 * ky / 3.0, y4 = y3 * ky / 4.0;
        const double x2 = kx * kx / 2.0, x3 = x2 * kx / 3.0, x4 = x3 * kx / 4.0;
        patch.row0[0] += s;
        patch.row0[1] += c * ky;
        patch.row0[2] -= s * y2;
        patch.row0[3] -= c * y3;
        patch.row0[4] += s * y4;
        patch.row1[0] += c * kx;
        patch.row1[1] -= s * kx * ky;
        patch.row1[2] -= c * kx * y2;
        patch.row1[3] += s * kx * y3;
        patch.row2[0] -= s * x2;
        patch.row2[1] -= c * x2 * ky;
        patch.row2[2] += s * x2 * y2;
        patch.row3[0] -= c * x3;
        patch.row3[1] += s * x3 * ky;
        patch.row4 += s * x4;
    }
    return patch;
}

double Terrain::patch_error(double reach) const {
    return fifth_derivative_bound_ * reach * reach * reach * reach * reach / 120.0;
}

GroundSample GroundPatch::slope(double x, double y) const {
    const double u = x - middle.x(), v = y - middle.y();
    const double p0 = row0[0] + v * (row0[1] + v * (row0[2] + v * (row0[3] + v * row0[4])));
    const double p1 = row1[0] + v * (row1[1] + v * (row1[2] + v * row1[3]));
    const double p2 = row2[0] + v * (row2[1] + v * row2[2]);
    const double p3 = row3[0] + v * row3[1];
    const double q0 = row0[1] + v * (2.0 * row0[2] + v * (3.0 * row0[3] + v * 4.0 * row0[4]));
    const double q1 = row1[1] + v * (2.0 * row1[2] + v * 3.0 * row1[3]);
    const double q2 = row2[1] + v * 2.0 * row2[2];
    GroundSample ground;
    ground.height = p0 + u * (p1 + u * (p2 + u * (p3 + u * row4)));
    ground.slope_x = p1 + u * (2.0 * p2 + u * (3.0 * p3 + u * 4.0 * row4));
    ground.slope_y = q0 + u * (q1 + u * (q2 + u * row3[1]));
    return ground;
}

void Pond::lower(double x, double y, GroundSample& ground) const {
    if (!near(x, y)) return;
    const double dx = x - center.x(), dy = y - center.y();
    const double u = 1.0 - (dx * dx + dy * dy) / (radius * radius);
    const double pull = 6.0 * depth / (radius * radius);
    ground.height -= depth * u * u * u;
    ground.slope_x += pull * u * u * dx;
    ground.slope_y += pull * u * u * dy;
    const double fold = 4.0 * u / (radius * radius);
    ground.curve_xx += pull * (u * u - fold * dx * dx);
    ground.curve_xy += pull * (-fold * dx * dy);
    ground.curve_yy += pull * (u * u - fold * dy * dy);
}

}  // namespace strata
