#include "core/surface/cube_mesh.h"

#include <algorithm>
#include <bit>

namespace strata {
namespace {

// A rectangle's least corner, and its sides such that first x second points outside.
struct Sides {
    std::array<int, 3> least;
    int first_axis, second_axis, first_length, second_length;
};

Sides sides_of(const CubeRectangle& r, CubeDirection direction) {
    const int axis = int(direction) / 2;
    const bool plus = int(direction) % 2 == 0;
    Sides sides{.least = {int(r.x()), int(r.y()), int(r.z())},
                .first_axis = axis == 0 ? 1 : 0,
                .second_axis = axis == 2 ? 1 : 2,
                .first_length = int(r.height()),
                .second_length = int(r.width())};
    if (plus) ++sides.least[size_t(axis)];
    // y x z = x and x x y = z, but x x z = -y.
    if (plus == (axis == 1)) {
        std::swap(sides.first_axis, sides.second_axis);
        std::swap(sides.first_length, sides.second_length);
    }
    return sides;
}

std::array<int, 3> corner_at(const Sides& sides, int first, int second) {
    std::array<int, 3> c = sides.least;
    c[size_t(sides.first_axis)] += first;
    c[size_t(sides.second_axis)] += second;
    return c;
}

}  // namespace

std::array<BrickCorner, 4> corners_of(const CubeRectangle& rectangle, CubeDirection direction) {
    const Sides sides = sides_of(rectangle, direction);
    const int first = sides.first_length, second = sides.second_length;
    return {BrickCorner::at(corner_at(sides, 0, 0)), BrickCorner::at(corner_at(sides, first, 0)),
            BrickCorner::at(corner_at(sides, first, second)), BrickCorner::at(corner_at(sides, 0, second))};
}

std::vector<BrickCorner> shared_corners(const CubeRectangles& rectangles) {
    std::vector<BrickCorner> shared;
    for (int direction = 0; direction < 6; ++direction)
        for (const CubeRectangle& rectangle : rectangles.of(CubeDirection(direction)))
            for (const BrickCorner& corner : corners_of(rectangle, CubeDirection(direction)))
                if (corner.is_shared()) shared.push_back(corner);
    std::sort(shared.begin(), shared.end());
    shared.erase(std::unique(shared.begin(), shared.end()), shared.end());
    shared.shrink_to_fit();
    return shared;
}

CubeMesher::CubeMesher() : first_vertex_(size_t(kCorners) * kCorners * kCorners) {
    for (auto& lines : lines_) lines.resize(size_t(kCorners) * kCorners);
}

void CubeMesher::add_corner(const std::array<int, 3>& c) {
    for (size_t axis = 0; axis < 3; ++axis)
        if (c[axis] < kCubeBrickSide) lines_[axis][size_t(c[(axis + 1) % 3] * kCorners + c[(axis + 2) % 3])] |= uint64_t{1} << c[axis];
}

void CubeMesher::begin(const CubeRectangles& rectangles) {
    for (auto& lines : lines_) std::fill(lines.begin(), lines.end(), 0);
    for (int direction = 0; direction < 6; ++direction)
        for (const CubeRectangle& rectangle : rectangles.of(CubeDirection(direction))) {
            const Sides sides = sides_of(rectangle, CubeDirection(direction));
            for (const int first : {0, sides.first_length})
                for (const int second : {0, sides.second_length}) add_corner(corner_at(sides, first, second));
        }
}

void CubeMesher::add_corners(std::span<const BrickCorner> corners, const std::array<int, 3>& step) {
    for (const BrickCorner& corner : corners) {
        std::array<int, 3> c;
        bool on_brick = true;
        for (int axis = 0; axis < 3; ++axis) {
            c[size_t(axis)] = corner[axis] + kCubeBrickSide * step[size_t(axis)];
            on_brick = on_brick && c[size_t(axis)] >= 0 && c[size_t(axis)] <= kCubeBrickSide;
        }
        if (on_brick) add_corner(c);
    }
}

uint32_t CubeMesher::vertex(const std::array<int, 3>& c, uint32_t material, uint8_t direction, CubeMesh& out) {
    uint32_t* entry = &first_vertex_[size_t((c[0] * kCorners + c[1]) * kCorners + c[2])];
    while (*entry != 0) {
        const uint32_t found = *entry - 1;
        if (out.vertices[found].material == material && out.vertices[found].direction == direction) return found;
        entry = &next_vertex_[found];
    }
    *entry = uint32_t(out.vertices.size()) + 1;
    out.vertices.push_back({BrickCorner::at(c), material, direction});
    next_vertex_.push_back(0);  // `entry` is of no use from here on
    return uint32_t(out.vertices.size()) - 1;
}

void CubeMesher::add_polygon(const CubeRectangle& rectangle, CubeDirection direction, bool by_direction, CubeMesh& out) {
    const Sides sides = sides_of(rectangle, direction);
    // Vertices of the four edges, each towards growing coordinates and with both its ends.
    struct Edge {
        std::array<uint32_t, kCorners> vertices;
        std::array<int, kCorners> places;
        int count = 0;
    };
    Edge bottom, top, left, right;
    const auto walk = [&](Edge& edge, bool along_first, int across) {
        const int axis = along_first ? sides.first_axis : sides.second_axis;
        const int length = along_first ? sides.first_length : sides.second_length;
        std::array<int, 3> c = along_first ? corner_at(sides, 0, across) : corner_at(sides, across, 0);
        const int begin = c[size_t(axis)];
        const uint64_t line = lines_[size_t(axis)][size_t(c[size_t(axis + 1) % 3] * kCorners + c[size_t(axis + 2) % 3])];
        const auto add = [&](int place) {
            c[size_t(axis)] = begin + place;
            edge.places[size_t(edge.count)] = place;
            edge.vertices[size_t(edge.count++)] = vertex(c, rectangle.material, by_direction ? uint8_t(direction) : uint8_t{0}, out);
        };
        add(0);
        if (length > 1) {
            const uint64_t between = line >> (begin + 1) & ~uint64_t{0} >> (kCubeBrickSide - (length - 1));
            for (uint64_t bits = between; bits != 0; bits &= bits - 1) add(1 + std::countr_zero(bits));
        }
        add(length);
    };
    walk(bottom, true, 0);
    walk(top, true, sides.second_length);
    walk(left, false, 0);
    walk(right, false, sides.first_length);
    if (bottom.count + top.count + left.count + right.count == 8) {
        out.quads.push_back({bottom.vertices[0], bottom.vertices[1], top.vertices[1], top.vertices[0]});
        return;
    }
    // What lies on the left edge is joined with the first point of the bottom behind the corner, what lies on the right one with the last
    // of the top before the corner. Between is a strip.
    int b = 0, t = 0, t_end = top.count - 1;
    if (left.count > 2) {
        b = 1;
        for (size_t i = 0; i + 1 < size_t(left.count); ++i)
            out.triangles.push_back({left.vertices[i], bottom.vertices[1], left.vertices[i + 1]});
    }
    if (right.count > 2) {
        --t_end;
        for (size_t i = 0; i + 1 < size_t(right.count); ++i)
            out.triangles.push_back({right.vertices[i], right.vertices[i + 1], top.vertices[size_t(t_end)]});
    }
    while (b + 1 < bottom.count || t < t_end) {
        const auto low = size_t(b), high = size_t(t);
        if (t == t_end || (b + 1 < bottom.count && bottom.places[low + 1] <= top.places[high + 1])) {
            out.triangles.push_back({bottom.vertices[low], bottom.vertices[low + 1], top.vertices[high]});
            ++b;
        } else {
            out.triangles.push_back({bottom.vertices[low], top.vertices[high + 1], top.vertices[high]});
            ++t;
        }
    }
}

void CubeMesher::finish(const CubeRectangles& rectangles, bool by_direction, CubeMesh& out) {
    out.vertices.clear();
    out.triangles.clear();
    out.quads.clear();
    next_vertex_.clear();
    for (int direction = 0; direction < 6; ++direction)
        for (const CubeRectangle& rectangle : rectangles.of(CubeDirection(direction)))
            add_polygon(rectangle, CubeDirection(direction), by_direction, out);
    for (const CubeVertex& v : out.vertices) first_vertex_[size_t((v.corner[0] * kCorners + v.corner[1]) * kCorners + v.corner[2])] = 0;
}

}  // namespace strata
