#include "app/bench/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

namespace strata {
namespace {

constexpr double kWidth = 640, kHeight = 400;
constexpr double kLeft = 64, kRight = 620, kTop = 44, kBottom = 348;  // of the field
constexpr int kTicks = 6;
// Apart in hue and in lightness, so that they are told apart in gray too; and each has a marker of its own.
constexpr std::array kColors = {"#0b6fa4", "#d95f02", "#1b7837", "#7b3294", "#b2182b", "#4d4d4d"};

// Two decimals are enough for a place on the page.
std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f", value);
    std::string trimmed = text;
    while (trimmed.back() == '0') trimmed.pop_back();
    if (trimmed.back() == '.') trimmed.pop_back();
    return trimmed == "-0" ? "0" : trimmed;
}

std::string tick_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
}

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text) {
        if (c == '&') out += "&amp;";
        else if (c == '<') out += "&lt;";
        else if (c == '>') out += "&gt;";
        else out += c;
    }
    return out;
}

std::string text_at(double x, double y, const std::string& attributes, const std::string& text) {
    return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\"" + attributes + ">" + escaped(text) + "</text>\n";
}

// A marker around a place, by the number of its series.
std::string marker(double x, double y, size_t series) {
    const auto at = [&](double dx, double dy) { return number(x + dx) + "," + number(y + dy); };
    switch (series % 4) {
        case 0: return "<circle cx=\"" + number(x) + "\" cy=\"" + number(y) + "\" r=\"4\"/>";
        case 1: return "<path d=\"M" + at(-3.5, -3.5) + "h7v7h-7z\"/>";
        case 2: return "<path d=\"M" + at(0, -5) + "l4.5,8h-9z\"/>";
        default: return "<path d=\"M" + at(0, -5) + "l5,5l-5,5l-5,-5z\"/>";
    }
}

// How the series are drawn. Those of theory share the color of the one before, and have no markers.
struct SeriesLook {
    std::string color, dashes;
    size_t number = 0;
    bool marked = true;
};
std::vector<SeriesLook> looks_of(const Plot& plot) {
    std::vector<SeriesLook> looks;
    size_t measured = 0;
    for (const PlotSeries& series : plot.series) {
        measured += series.expected && !looks.empty() ? 0 : 1;
        looks.push_back(
            {kColors[(measured - 1) % kColors.size()], series.expected ? " stroke-dasharray=\"6,4\"" : "", measured - 1, !series.expected});
    }
    return looks;
}

// From values to places on the page.
struct Scale {
    Scale(const Plot& plot, bool vertical, double from, double to)
        : logarithmic((vertical ? plot.y : plot.x).logarithmic), begin(from), end(to) {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (const PlotSeries& series : plot.series)
            for (const Vec2d& p : series.points) {
                if (!p.allFinite()) continue;
                low = std::min(low, vertical ? p.y() : p.x());
                high = std::max(high, vertical ? p.y() : p.x());
            }
        if (!(low <= high)) low = high = 1.0;
        ticks = tick_values(low, high, logarithmic, kTicks);
    }
    double operator()(double value) const {
        const auto place = [&](double v) { return logarithmic ? std::log(v) : v; };
        return begin + (end - begin) * (place(value) - place(ticks.front())) / (place(ticks.back()) - place(ticks.front()));
    }

    bool logarithmic;
    double begin, end;
    std::vector<double> ticks;
};

std::string draw_axes(const Plot& plot, const Scale& x, const Scale& y) {
    std::string svg = "<g stroke=\"#ddd\">\n";
    for (const double tick : x.ticks) svg += "<path d=\"M" + number(x(tick)) + "," + number(kTop) + "V" + number(kBottom) + "\"/>\n";
    for (const double tick : y.ticks) svg += "<path d=\"M" + number(kLeft) + "," + number(y(tick)) + "H" + number(kRight) + "\"/>\n";
    svg += "</g>\n<path d=\"M" + number(kLeft) + "," + number(kTop) + "V" + number(kBottom) + "H" + number(kRight) +
           "\" fill=\"none\" stroke=\"#333\"/>\n";
    for (const double tick : x.ticks) svg += text_at(x(tick), kBottom + 18, " text-anchor=\"middle\"", tick_text(tick));
    for (const double tick : y.ticks) svg += text_at(kLeft - 8, y(tick) + 4, " text-anchor=\"end\"", tick_text(tick));
    svg += text_at(0.5 * (kLeft + kRight), kHeight - 12, " text-anchor=\"middle\"", plot.x.label);
    const double middle = 0.5 * (kTop + kBottom);
    svg += text_at(16, middle, " text-anchor=\"middle\" transform=\"rotate(-90 16 " + number(middle) + ")\"", plot.y.label);
    svg += text_at(kLeft, 24, " font-size=\"15\" font-weight=\"bold\"", plot.title);
    return svg;
}

// The corner of the field that the fewest points lie in.
Vec2d legend_corner(const Plot& plot, const Scale& x, const Scale& y, double width, double height) {
    Vec2d best = Vec2d::Zero();
    size_t least = std::numeric_limits<size_t>::max();
    for (const double left : {kRight - width - 8, kLeft + 8})
        for (const double top : {kTop + 8, kBottom - height - 8}) {
            size_t inside = 0;
            for (const PlotSeries& series : plot.series)
                for (const Vec2d& p : series.points)
                    inside += p.allFinite() && x(p.x()) > left - 8 && x(p.x()) < left + width + 8 && y(p.y()) > top - 8 &&
                              y(p.y()) < top + height + 8;
            if (inside >= least) continue;
            least = inside;
            best = {left, top};
        }
    return best;
}

std::string draw_legend(const Plot& plot, const Scale& x, const Scale& y) {
    size_t longest = 0;
    for (const PlotSeries& series : plot.series) longest = std::max(longest, series.name.size());
    const double width = 40 + 7.5 * double(longest), height = 10 + 20 * double(plot.series.size());
    const Vec2d corner = legend_corner(plot, x, y, width, height);
    const std::vector<SeriesLook> looks = looks_of(plot);
    std::string svg = "<rect x=\"" + number(corner.x()) + "\" y=\"" + number(corner.y()) + "\" width=\"" + number(width) + "\" height=\"" +
                      number(height) + "\" fill=\"#fff\" stroke=\"#ccc\"/>\n";
    for (size_t i = 0; i < plot.series.size(); ++i) {
        const double row = corner.y() + 15 + 20 * double(i);
        const SeriesLook& look = looks[i];
        svg += "<g fill=\"" + look.color + "\" stroke=\"" + look.color + "\"><path d=\"M" + number(corner.x() + 6) + "," + number(row) +
               "h22\" stroke-width=\"2\"" + look.dashes + "/>" + (look.marked ? marker(corner.x() + 17, row, look.number) : "") + "</g>\n";
        svg += text_at(corner.x() + 34, row + 4, "", plot.series[i].name);
    }
    return svg;
}

}  // namespace

std::vector<double> tick_values(double low, double high, bool logarithmic, int count) {
    std::vector<double> ticks;
    if (logarithmic) {
        const bool fine = std::log10(high / low) < 0.5 * count;
        for (int power = int(std::floor(std::log10(low))); ticks.empty() || ticks.back() < high; ++power)
            for (const double digit : {1.0, 2.0, 5.0}) {
                if (!fine && digit > 1.0) continue;
                const double tick = digit * std::pow(10.0, power);
                if (tick <= low * (1.0 + 1e-9)) ticks.clear();  // only the last one at or below the range stays
                if (ticks.empty() || ticks.back() < high) ticks.push_back(tick);
            }
    } else {
        if (!(high > low)) high = low + std::max(1.0, std::abs(low));
        const double wanted = (high - low) / count, power = std::pow(10.0, std::floor(std::log10(wanted)));
        double step = 10.0 * power;
        for (const double digit : {5.0, 2.0, 1.0})
            if (digit * power >= wanted * (1.0 - 1e-9)) step = digit * power;
        for (double i = std::floor(low / step + 1e-9); ticks.empty() || ticks.back() < high - 1e-9 * step; ++i) ticks.push_back(i * step);
    }
    if (ticks.size() == 1) ticks.push_back(logarithmic ? 10.0 * ticks[0] : ticks[0] + 1.0);
    return ticks;
}

std::string svg_of(const Plot& plot) {
    const Scale x(plot, false, kLeft, kRight), y(plot, true, kBottom, kTop);
    std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 640 400\" width=\"" + number(kWidth) + "\" height=\"" +
                      number(kHeight) +
                      "\" font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n<rect width=\"640\" height=\"400\" fill=\"#fff\"/>\n";
    svg += draw_axes(plot, x, y);
    const std::vector<SeriesLook> looks = looks_of(plot);
    for (size_t i = 0; i < plot.series.size(); ++i) {
        std::string line, markers;
        for (const Vec2d& p : plot.series[i].points) {
            if (!p.allFinite()) continue;
            line += (line.empty() ? "M" : "L") + number(x(p.x())) + "," + number(y(p.y()));
            if (looks[i].marked) markers += marker(x(p.x()), y(p.y()), looks[i].number);
        }
        const std::string& color = looks[i].color;
        svg += "<path d=\"" + line + "\" fill=\"none\" stroke=\"" + color + "\" stroke-width=\"2\"" + looks[i].dashes + "/>\n<g fill=\"" +
               color + "\">" + markers + "</g>\n";
    }
    return svg + draw_legend(plot, x, y) + "</svg>\n";
}

}  // namespace strata
