#include "render/colormap.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/error.h"
#include "render/srgb.h"

namespace strata {
namespace {

// A control point: lightness, chroma and hue (degrees) in OKLab's polar form.
struct ControlPoint {
    double lightness, chroma, hue_deg;
};

struct ColormapRow {
    ColormapName name;
    std::vector<ControlPoint> points;
};

const std::vector<ColormapRow>& colormap_rows() {
    static const std::vector<ColormapRow> rows = {
        {{"fjord", "dark violet, blue, green, yellow; for any quantity", ColormapKind::sequential},
         {{0.26, 0.10, 300}, {0.41, 0.12, 268}, {0.55, 0.095, 225}, {0.69, 0.125, 170}, {0.81, 0.17, 130}, {0.94, 0.17, 107}}},
        {{"ember", "black, violet, red, orange, pale yellow; for intensity and heat", ColormapKind::sequential},
         {{0.10, 0.03, 290}, {0.28, 0.12, 303}, {0.45, 0.17, 355}, {0.60, 0.19, 28}, {0.76, 0.16, 62}, {0.97, 0.08, 103}}},
        {{"gray", "black to white", ColormapKind::sequential}, {{0.0, 0.0, 0}, {1.0, 0.0, 0}}},
        {{"spectrum", "blue, green, yellow, red; for elevations with much detail", ColormapKind::rainbow},
         {{0.40, 0.15, 278}, {0.60, 0.15, 250}, {0.76, 0.12, 205}, {0.83, 0.18, 150}, {0.89, 0.17, 110}, {0.76, 0.155, 70},
          {0.61, 0.19, 36}, {0.42, 0.15, 27}}},
        {{"polar", "blue, white, red; for signed differences, with a range that is symmetric about 0", ColormapKind::diverging},
         {{0.38, 0.12, 262}, {0.67, 0.11, 248}, {0.97, 0.0, 0}, {0.67, 0.13, 42}, {0.38, 0.12, 25}}},
    };
    return rows;
}

Vec3d lab_of(const ControlPoint& point) {
    const double hue = point.hue_deg * std::numbers::pi / 180.0;
    return {point.lightness, point.chroma * std::cos(hue), point.chroma * std::sin(hue)};
}

// Tangents that keep every component monotone between control points. Source: F. Fritsch, J. Butland, "A method for
// constructing local monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 1984, for equal spacing.
double monotone_tangent(double before, double after) {
    return before * after <= 0.0 ? 0.0 : 2.0 * before * after / (before + after);
}

// The curve through the control points, one unit of s a span.
class LabCurve {
public:
    explicit LabCurve(const std::vector<ControlPoint>& points) {
        for (const ControlPoint& point : points) points_.push_back(lab_of(point));
        const size_t n = points_.size();
        tangents_.resize(n);
        tangents_.front() = points_[1] - points_[0];
        tangents_.back() = points_[n - 1] - points_[n - 2];
        for (size_t i = 1; i + 1 < n; ++i)
            for (int axis = 0; axis < 3; ++axis)
                tangents_[i][axis] = monotone_tangent(points_[i][axis] - points_[i - 1][axis], points_[i + 1][axis] - points_[i][axis]);
    }

    double end() const { return double(points_.size() - 1); }

    Vec3d at(double s) const {
        const size_t i = std::min(size_t(s), points_.size() - 2);
        const double t = s - double(i), u = 1.0 - t;
        return points_[i] * (u * u * (1.0 + 2.0 * t)) + tangents_[i] * (u * u * t) + points_[i + 1] * (t * t * (3.0 - 2.0 * t)) -
               tangents_[i + 1] * (t * t * u);
    }

private:
    std::vector<Vec3d> points_, tangents_;
};

bool displayable(const Vec3d& rgb) { return rgb.minCoeff() >= -1e-4 && rgb.maxCoeff() <= 1.0 + 1e-4; }

// The color nearest to `lab` of the same lightness and hue that a screen can show: its chroma is lowered.
Vec3d displayable_linear(const Vec3d& lab) {
    if (displayable(linear_from_oklab(lab))) return linear_from_oklab(lab);
    double low = 0.0, high = 1.0;
    for (int step = 0; step < 30; ++step) {
        const double share = 0.5 * (low + high);
        (displayable(linear_from_oklab({lab.x(), share * lab.y(), share * lab.z()})) ? low : high) = share;
    }
    return linear_from_oklab({lab.x(), low * lab.y(), low * lab.z()});
}

Rgba8 encode(const Vec3d& linear) {
    const auto code = [](double value) { return uint8_t(std::lround(255.0 * srgb_from_linear(std::clamp(value, 0.0, 1.0)))); };
    return make_rgba(code(linear.x()), code(linear.y()), code(linear.z()));
}

}  // namespace

std::span<const ColormapName> all_colormaps() {
    static const std::vector<ColormapName> names = [] {
        std::vector<ColormapName> list;
        for (const ColormapRow& row : colormap_rows()) list.push_back(row.name);
        return list;
    }();
    return names;
}

Colormap::Colormap(std::string_view name) {
    const std::vector<ColormapRow>& rows = colormap_rows();
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const ColormapRow& each) { return each.name.name == name; });
    if (row == rows.end()) {
        std::string known;
        for (const ColormapRow& each : rows) known += (known.empty() ? "" : ", ") + std::string(each.name.name);
        throw Error(ErrorKind::usage, "colormap '" + std::string(name) + "' is not known; there are " + known);
    }
    // Walk the curve in small steps and take a color whenever another equal part of its length is behind.
    constexpr int kSteps = 4096;
    const LabCurve curve(row->points);
    std::vector<Vec3d> linear(kSteps + 1);
    std::vector<double> length(kSteps + 1, 0.0);
    for (int i = 0; i <= kSteps; ++i) {
        linear[size_t(i)] = displayable_linear(curve.at(curve.end() * i / kSteps));
        if (i > 0)
            length[size_t(i)] = length[size_t(i) - 1] + (oklab_from_linear(linear[size_t(i)].cwiseMax(0.0)) -
                                                         oklab_from_linear(linear[size_t(i) - 1].cwiseMax(0.0))).norm();
    }
    for (size_t color = 0, i = 0; color < kColors; ++color) {
        const double wanted = length.back() * double(color) / double(kColors - 1);
        while (i < size_t(kSteps) && length[i] < wanted) ++i;
        colors_[color] = encode(linear[i]);
    }
}

std::string_view classification_name(uint8_t code) {
    static constexpr std::array<std::string_view, 23> names = {
        "never classified", "unclassified", "ground", "low vegetation", "medium vegetation", "high vegetation", "building",
        "low noise", "", "water", "rail", "road surface", "", "wire guard", "wire conductor", "transmission tower",
        "wire connector", "bridge deck", "high noise", "overhead structure", "ignored ground", "snow", "temporal exclusion"};
    return code < names.size() ? names[code] : std::string_view();
}

const std::array<Rgba8, 256>& classification_colors() {
    static const std::array<Rgba8, 256> table = [] {
        std::array<Rgba8, 256> colors;
        for (size_t code = 0; code < colors.size(); ++code) colors[code] = category_color(code);
        constexpr std::array<ControlPoint, 23> kMeanings = {{
            {0.55, 0.00, 0},     // never classified
            {0.72, 0.00, 0},     // unclassified
            {0.60, 0.075, 65},   // ground
            {0.84, 0.15, 128},   // low vegetation
            {0.70, 0.17, 138},   // medium vegetation
            {0.52, 0.14, 145},   // high vegetation
            {0.62, 0.19, 30},    // building
            {0.68, 0.27, 330},   // low noise
            {0.80, 0.00, 0},     // model key point, before LAS 1.4
            {0.62, 0.15, 250},   // water
            {0.42, 0.06, 300},   // rail
            {0.45, 0.015, 260},  // road surface
            {0.80, 0.09, 320},   // overlap, before LAS 1.4
            {0.86, 0.15, 95},    // wire guard
            {0.92, 0.18, 105},   // wire conductor
            {0.66, 0.15, 60},    // transmission tower
            {0.78, 0.16, 80},    // wire connector
            {0.70, 0.07, 40},    // bridge deck
            {0.60, 0.25, 345},   // high noise
            {0.64, 0.12, 295},   // overhead structure
            {0.45, 0.06, 60},    // ignored ground
            {0.97, 0.015, 230},  // snow
            {0.50, 0.09, 200},   // temporal exclusion
        }};
        for (size_t code = 0; code < kMeanings.size(); ++code) colors[code] = encode(displayable_linear(lab_of(kMeanings[code])));
        return colors;
    }();
    return table;
}

Rgba8 category_color(uint64_t number) {
    // Hues a golden angle apart never come close soon; four lightnesses tell those apart that do later.
    constexpr double kGoldenAngleDeg = 137.50776405003785;
    static constexpr std::array<double, 4> kLightness = {0.74, 0.60, 0.83, 0.67};
    static const std::array<Rgba8, 256> table = [] {
        std::array<Rgba8, 256> colors;
        for (size_t i = 0; i < colors.size(); ++i)
            colors[i] = encode(displayable_linear(lab_of({kLightness[i % 4], 0.14, std::fmod(250.0 + kGoldenAngleDeg * double(i), 360.0)})));
        return colors;
    }();
    return table[number % table.size()];
}

Rgba8 direction_color(const Vec3f& direction) {
    const auto code = [](float n) { return uint8_t(std::lround(255.0f * std::clamp(0.5f + 0.5f * n, 0.0f, 1.0f))); };
    return make_rgba(code(direction.x()), code(direction.y()), code(direction.z()));
}

}  // namespace strata
