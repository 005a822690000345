#include "app/bench/svg_plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace strata {
namespace {

using Ticks = std::vector<double>;

TEST(SvgPlot, LinearTicksAreRoundAndEncloseTheRange) {
    EXPECT_EQ(tick_values(0, 10, false, 5), (Ticks{0, 2, 4, 6, 8, 10}));
    EXPECT_EQ(tick_values(13, 27, false, 6), (Ticks{10, 15, 20, 25, 30}));
    EXPECT_EQ(tick_values(-1.5, 1, false, 5), (Ticks{-1.5, -1, -0.5, 0, 0.5, 1}));
    const Ticks same = tick_values(7, 7, false, 6);
    EXPECT_LE(same.front(), 7);
    EXPECT_GT(same.back(), 7);
}

TEST(SvgPlot, LogarithmicTicksAre125AndEncloseTheRange) {
    EXPECT_EQ(tick_values(3, 40, true, 6), (Ticks{2, 5, 10, 20, 50}));
    EXPECT_EQ(tick_values(1, 10, true, 6), (Ticks{1, 2, 5, 10}));
    const Ticks wide = tick_values(0.5, 3e5, true, 6);
    EXPECT_NEAR(wide.front(), 0.1, 1e-12);
    EXPECT_NEAR(wide.back(), 1e6, 1e-6);
    EXPECT_EQ(wide.size(), 8u);
    EXPECT_GE(tick_values(2, 2, true, 6).size(), 2u);
}

size_t count(const std::string& text, const std::string& word) {
    size_t times = 0;
    for (size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++times;
    return times;
}

TEST(SvgPlot, DrawsEveryFinitePointOnceAndEscapesNames) {
    Plot plot{"a < b", {"x", true}, {"y"}, {{"one & two", {{1, 1}, {2, 3}, {4, std::numeric_limits<double>::infinity()}}}}};
    const std::string svg = svg_of(plot);
    EXPECT_EQ(count(svg, "<circle"), 3u);  // two points and the legend
    EXPECT_EQ(count(svg, "one &amp; two"), 1u);
    EXPECT_EQ(count(svg, "a &lt; b"), 1u);
    EXPECT_EQ(count(svg, "nan") + count(svg, "inf"), 0u);
}

// Ticks 1, 2, 5, 10 on the logarithmic axis from 64 to 620 px: 10 lies at the right end, 2 at log10(2) of the way.
TEST(SvgPlot, PutsPointsWhereTheAxesSay) {
    const std::string svg = svg_of({"t", {"x", true}, {"y"}, {{"s", {{2, 0}, {10, 10}, {1, 5}}}}});
    char place[32];
    std::snprintf(place, sizeof place, "M%.2f,348", 64 + (620 - 64) * std::log10(2.0));
    EXPECT_EQ(count(svg, place), 1u) << svg;
    EXPECT_EQ(count(svg, "L620,44"), 1u) << svg;
    EXPECT_EQ(count(svg, "L64,196"), 1u) << svg;
}

// What theory says of a series has its color and no marker.
TEST(SvgPlot, TheoryIsDashedInTheColorOfItsSeries) {
    const std::string svg = svg_of({"t", {"x"}, {"y"}, {{"s", {{0, 0}, {1, 1}}}, {"theory", {{0, 0}, {1, 2}}, true}, {"other", {{0, 0}, {1, 3}}}}});
    EXPECT_EQ(count(svg, "stroke-dasharray"), 2u);  // the line and the legend's
    EXPECT_EQ(count(svg, "<circle"), 3u);           // two points and the legend
    EXPECT_EQ(count(svg, "stroke=\"#0b6fa4\" stroke-width"), 2u);
    EXPECT_EQ(count(svg, "stroke=\"#d95f02\" stroke-width"), 1u);
}

TEST(SvgPlot, AnEmptyPlotIsStillAPicture) { EXPECT_EQ(count(svg_of({"t", {"x", true}, {"y"}, {}}), "</svg>"), 1u); }

}  // namespace
}  // namespace strata
