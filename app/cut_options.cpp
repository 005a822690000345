#include "app/cut_options.h"

#include <algorithm>
#include <limits>

#include "app/options.h"
#include "core/error.h"

namespace strata {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<std::string> split(const std::string& text, char mark) {
    std::vector<std::string> parts;
    for (size_t begin = 0; begin <= text.size();) {
        const size_t end = std::min(text.find(mark, begin), text.size());
        parts.push_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    return parts;
}

double parse_end(std::string_view flag, const std::string& text, double open) {
    return text.empty() ? open : parse_number(flag, text);
}

Error refused(std::string_view flag, const std::string& expected, const std::string& text) {
    return {ErrorKind::usage, std::string(flag) + ": expected " + expected + ", got '" + text + "'"};
}

ValueRange parse_range(std::string_view flag, const std::string& text) {
    const size_t colon = text.find(':');
    if (colon == std::string::npos) {
        const double value = parse_number(flag, text);
        return {value, value};
    }
    const ValueRange range = {parse_end(flag, text.substr(0, colon), -kInfinity), parse_end(flag, text.substr(colon + 1), kInfinity)};
    if (range.empty()) throw refused(flag, "a range from low to high", text);
    return range;
}

}  // namespace

std::vector<ClipBox> parse_clip_boxes(std::string_view flag, const std::string& text, ClipBox::Action action) {
    std::vector<ClipBox> boxes;
    for (const std::string& part : split(text, ';')) {
        const std::vector<std::string> numbers = split(part, ',');
        if (numbers.size() != 6) throw refused(flag, "xmin,ymin,zmin,xmax,ymax,zmax", part);
        ClipBox& clip = boxes.emplace_back();
        clip.action = action;
        for (int axis = 0; axis < 3; ++axis) {
            const std::string &low = numbers[size_t(axis)], &high = numbers[size_t(axis) + 3];
            clip.box.min[axis] = parse_end(flag, low, -kInfinity);
            clip.box.max[axis] = parse_end(flag, high, kInfinity);
            if (clip.box.min[axis] > clip.box.max[axis])
                throw Error(ErrorKind::usage, std::string(flag) + ": the box's least " + "xyz"[axis] + ", " + low + ", is above its most, " + high);
        }
    }
    return boxes;
}

std::vector<FilterTerm> parse_filter(std::string_view flag, const std::string& text) {
    std::vector<FilterTerm> terms;
    for (const std::string& part : split(text, ';')) {
        const size_t equals = part.rfind('=');  // values have none
        if (equals == std::string::npos || equals == 0) throw refused(flag, "NAME=VALUES, such as class=2,6 or intensity=100:2000", part);
        FilterTerm& term = terms.emplace_back();
        term.name = part.substr(0, equals);
        const std::string place = std::string(flag) + " " + term.name;
        for (const std::string& range : split(part.substr(equals + 1), ',')) term.ranges.push_back(parse_range(place, range));
    }
    return terms;
}

}  // namespace strata
