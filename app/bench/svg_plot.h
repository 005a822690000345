#pragma once

#include <string>
#include <vector>

#include "core/math/vec.h"

namespace strata {

struct PlotSeries {
    std::string name;
    std::vector<Vec2d> points;  // joined in this order; those that are not finite are left out
    bool expected = false;      // what theory says of the series before: in its color, dashed, without markers
};

struct PlotAxis {
    std::string label;         // with its unit
    bool logarithmic = false;  // values must be positive
};

/// Lines with markers over two axes.
struct Plot {
    std::string title;  // says what is better
    PlotAxis x, y;
    std::vector<PlotSeries> series;
};

/// Places of ticks from low to high: multiples of 1, 2 or 5 times a power of ten, about `count` of them; on a logarithmic
/// axis 1, 2 and 5 times powers of ten, or the powers alone where those were too many. They enclose the range.
std::vector<double> tick_values(double low, double high, bool logarithmic, int count);

/// The plot as a self-contained SVG of 640 x 400 on white.
std::string svg_of(const Plot& plot);

}  // namespace strata
