#include "core/surface/cell_interior.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/surface/joined.h"

namespace strata {
namespace {

// The four corners of a slice, in order around it, as corners of the cell's lower face.
constexpr std::array<uint8_t, 4> kRound = {0, 1, 3, 2};
constexpr int kMostEvents = 6;

// Where a + t (b - a) changes its sign within the cell.
void add_root(double a, double b, std::array<double, kMostEvents + 2>& heights, int& count) {
    if ((a >= 0.0) == (b >= 0.0)) return;
    heights[size_t(count++)] = a / (a - b);
}

// Whether the trilinear function may have a saddle in the cell. Without one its surfaces run as they begin on the faces.
// With X = x + g / h, Y = y + f / h, Z = z + e / h the function is h XYZ + p X + q Y + r Z and a constant, so that h YZ = -p, h XZ = -q and
// h XY = -r at its saddles.
bool may_have_saddle(const CellValues& v) {
    const double b = v[1] - v[0], c = v[2] - v[0], d = v[4] - v[0];
    const double e = v[3] - v[2] - b, f = v[5] - v[4] - b, g = v[6] - v[4] - c;
    const double h = v[7] - v[6] - v[5] + v[4] - e;
    constexpr double kNoCube = 1e-9, kMargin = 1e-6;  // of a saddle's place: more than its rounding where h is not less than that
    if (std::abs(h) <= kNoCube * std::max({std::abs(e), std::abs(f), std::abs(g)})) return true;
    const double p = b - e * f / h, q = c - e * g / h, r = d - f * g / h;
    const double square = -q * r / (p * h);
    if (square < 0.0) return false;
    const double x = std::sqrt(square);
    const auto within = [](double place) { return !(place < -kMargin || place > 1.0 + kMargin); };  // true for what is not a number
    for (const double side : {x, -x})
        if (within(side - g / h) && within(-r / (h * side) - f / h) && within(-q / (h * side) - e / h)) return true;
    return false;
}

}  // namespace

std::array<uint8_t, 8> join_corners_within(const CellValues& values, unsigned cell_case) {
    // Nodes: the cell's corners, then those of a slice in each of up to 7 intervals of height.
    Joined<8 + 4 * (kMostEvents + 1)> joined;
    const auto labels = [&] {
        std::array<uint8_t, 8> out;
        for (int c = 0; c < 8; ++c) out[size_t(c)] = uint8_t(joined.find(c));
        return out;
    };
    std::array<double, 4> low, rise;
    for (size_t i = 0; i < 4; ++i) {
        low[i] = values[kRound[i]];
        rise[i] = values[kRound[i] + 4] - low[i];
        if (!std::isfinite(low[i]) || !std::isfinite(rise[i])) return labels();
    }

    if (!may_have_saddle(values)) return labels();

    std::array<double, kMostEvents + 2> heights;
    int count = 0;
    heights[size_t(count++)] = 0.0;
    for (size_t i = 0; i < 4; ++i) add_root(low[i], low[i] + rise[i], heights, count);
    // The decider, (0)(2) - (1)(3), is quadratic in height.
    const double c2 = rise[0] * rise[2] - rise[1] * rise[3];
    const double c1 = low[0] * rise[2] + low[2] * rise[0] - low[1] * rise[3] - low[3] * rise[1];
    const double c0 = low[0] * low[2] - low[1] * low[3];
    const double discriminant = c1 * c1 - 4.0 * c2 * c0;
    if (discriminant > 0.0) {
        const double q = -0.5 * (c1 + std::copysign(std::sqrt(discriminant), c1));
        for (const double root : {q / c2, c0 / q})
            if (root > 0.0 && root < 1.0) heights[size_t(count++)] = root;
    }
    for (int i = 2; i < count; ++i)  // a few numbers
        for (int j = i; j > 1 && heights[size_t(j)] < heights[size_t(j) - 1]; --j) std::swap(heights[size_t(j)], heights[size_t(j) - 1]);
    heights[size_t(count++)] = 1.0;

    unsigned before = 0;  // signs of the four corners in the interval below, and its first node
    for (size_t i = 0; i < 4; ++i) before |= (cell_case >> kRound[i] & 1) << i;
    std::array<int, 4> nodes_before;
    for (size_t i = 0; i < 4; ++i) nodes_before[i] = kRound[i];
    for (int interval = 0; interval + 1 < count; ++interval) {
        const double height = 0.5 * (heights[size_t(interval)] + heights[size_t(interval) + 1]);
        std::array<double, 4> at;
        std::array<int, 4> nodes;
        unsigned signs = 0;
        for (size_t i = 0; i < 4; ++i) {
            at[i] = low[i] + height * rise[i];
            nodes[i] = 8 + 4 * interval + int(i);
            signs |= unsigned(at[i] >= 0.0) << i;
        }
        for (size_t i = 0; i < 4; ++i)
            if ((signs >> i & 1) == (signs >> (i + 1) % 4 & 1)) joined.join(nodes[i], nodes[(i + 1) % 4]);
        if (signs == 0b0101 || signs == 0b1010) {
            const double even = at[0] * at[2], odd = at[1] * at[3];
            const bool even_joined = signs == 0b0101 ? even >= odd : even > odd;  // at a tie, what is inside
            joined.join(nodes[even_joined ? 0 : 1], nodes[even_joined ? 2 : 3]);
        }
        for (size_t i = 0; i < 4; ++i)
            if ((signs >> i & 1) == (before >> i & 1)) joined.join(nodes_before[i], nodes[i]);
        before = signs;
        nodes_before = nodes;
    }
    for (size_t i = 0; i < 4; ++i)
        if ((cell_case >> (kRound[i] + 4) & 1) == (before >> i & 1)) joined.join(nodes_before[i], kRound[i] + 4);
    return labels();
}

}  // namespace strata
