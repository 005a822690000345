#include "tests/support/surface_shape.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <vector>

namespace strata {
namespace {

struct Half {  // an edge as one triangle walks it
    uint32_t from, to;
    bool operator<(const Half& other) const { return from != other.from ? from < other.from : to < other.to; }
    bool operator==(const Half&) const = default;
};

}  // namespace

SurfaceShape shape_of(std::span<const Vec3f> positions, std::span<const std::array<uint32_t, 3>> triangles) {
    SurfaceShape shape;
    const auto fault = [&](const std::string& words) {
        if (shape.fault.empty()) shape.fault = words;
    };
    std::vector<Half> halves;
    std::vector<uint32_t> parent(positions.size()), corners(positions.size());
    std::iota(parent.begin(), parent.end(), 0u);
    const auto find = [&](uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const auto& t : triangles) {
        for (size_t n = 0; n < 3; ++n) {
            if (t[n] >= positions.size()) {
                fault("a triangle refers to vertex " + std::to_string(t[n]) + " of " + std::to_string(positions.size()));
                return shape;
            }
            if (t[n] == t[(n + 1) % 3]) fault("a triangle has vertex " + std::to_string(t[n]) + " twice");
            halves.push_back({t[n], t[(n + 1) % 3]});
            ++corners[t[n]];
            parent[find(t[n])] = find(t[(n + 1) % 3]);
        }
        const Vec3d a = positions[t[0]].cast<double>(), b = positions[t[1]].cast<double>(), c = positions[t[2]].cast<double>();
        shape.volume += a.dot(b.cross(c)) / 6.0;
        shape.area += 0.5 * (b - a).cross(c - a).norm();
    }
    std::sort(halves.begin(), halves.end());
    if (const auto twice = std::adjacent_find(halves.begin(), halves.end()); twice != halves.end())
        fault("two triangles walk from vertex " + std::to_string(twice->from) + " to " + std::to_string(twice->to));
    std::vector<uint32_t> ends(positions.size());  // edges of one triangle that leave the vertex
    for (const Half& half : halves)
        if (!std::binary_search(halves.begin(), halves.end(), Half{half.to, half.from})) {
            ++shape.boundary_edges;
            ++ends[half.from];
        }
    // The link of a vertex: each of its triangles leads from one neighbor to another. It is one circle, or one path at the boundary.
    struct Step {
        uint32_t vertex, from, to;
    };
    std::vector<Step> steps;
    for (const auto& t : triangles)
        for (size_t n = 0; n < 3; ++n) steps.push_back({t[n], t[(n + 1) % 3], t[(n + 2) % 3]});
    std::sort(steps.begin(), steps.end(),
              [](const Step& a, const Step& b) { return a.vertex != b.vertex ? a.vertex < b.vertex : a.from < b.from; });
    for (size_t begin = 0, end; begin < steps.size(); begin = end) {
        end = begin;
        while (end < steps.size() && steps[end].vertex == steps[begin].vertex) ++end;
        const auto next = [&](uint32_t from) {
            const auto at = std::lower_bound(steps.begin() + long(begin), steps.begin() + long(end), from,
                                             [](const Step& s, uint32_t f) { return s.from < f; });
            return at == steps.begin() + long(end) || at->from != from ? end : size_t(at - steps.begin());
        };
        // A path begins where no triangle leads to.
        size_t start = begin;
        for (size_t s = begin; s < end; ++s)
            if (std::none_of(steps.begin() + long(begin), steps.begin() + long(end),
                             [&](const Step& other) { return other.to == steps[s].from; }))
                start = s;
        size_t walked = 0;
        for (size_t s = start; s != end && walked <= end - begin; s = next(steps[s].to)) {
            ++walked;
            if (steps[s].to == steps[start].from) break;
        }
        if (walked != end - begin) fault("the triangles around vertex " + std::to_string(steps[begin].vertex) + " are not one fan");
    }
    for (size_t v = 0; v < positions.size(); ++v) {
        if (corners[v] == 0) fault("no triangle has vertex " + std::to_string(v));
        shape.components += parent[v] == v;
    }
    shape.euler = int64_t(positions.size()) - int64_t(halves.size() + shape.boundary_edges) / 2 + int64_t(triangles.size());
    return shape;
}

}  // namespace strata
