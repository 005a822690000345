#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/surface/cube_faces.h"

namespace strata {

/// A corner of cells of a brick, 0 to 64 along each axis.
struct BrickCorner {
    uint32_t place = 0;  // x, y and z at 7 bits each from the lowest

    static BrickCorner at(const std::array<int, 3>& c) { return {uint32_t(c[0]) | uint32_t(c[1]) << 7 | uint32_t(c[2]) << 14}; }
    int operator[](int axis) const { return int(place >> 7 * axis & 127); }
    /// On the outside of the brick, where other bricks have it, too.
    bool is_shared() const {
        for (int axis = 0; axis < 3; ++axis)
            if ((*this)[axis] == 0 || (*this)[axis] == kCubeBrickSide) return true;
        return false;
    }
    auto operator<=>(const BrickCorner&) const = default;
};

/// The four corners, counterclockwise seen from outside.
std::array<BrickCorner, 4> corners_of(const CubeRectangle& rectangle, CubeDirection direction);

/// Corners of rectangles on the outside of their brick, ascending, each once.
std::vector<BrickCorner> shared_corners(const CubeRectangles& rectangles);

struct CubeVertex {
    BrickCorner corner;
    uint32_t material = 0;
    uint8_t direction = 0;  // of its faces, a CubeDirection; 0 where all share it

    auto operator<=>(const CubeVertex&) const = default;
};

/// Rectangles of a brick that share vertices.
struct CubeMesh {
    std::vector<CubeVertex> vertices;                // each once
    std::vector<std::array<uint32_t, 3>> triangles;  // counterclockwise seen from outside, as are
    std::vector<std::array<uint32_t, 4>> quads;      // rectangles that no corner of another one lies on an edge of
};

/// Makes polygons of a brick's rectangles that meet their neighbors along whole edges: where corners of other rectangles lie on an edge,
/// the edge is cut there and the rectangle divided into triangles between the same points, two fewer than points, none without
/// area. So every edge is an edge on the other side, and nothing that rasterizes shared edges without gaps shows one. One per thread.
/// cost  some 50 nanoseconds a rectangle; 1.2 MB
class CubeMesher {
public:
    CubeMesher();

    /// Begins a brick with the corners of its rectangles.
    void begin(const CubeRectangles& rectangles);
    /// Corners of a neighbor's rectangles; those that do not lie on this brick do not count.
    /// step  to the neighbor, in bricks
    void add_corners(std::span<const BrickCorner> corners, const std::array<int, 3>& step);
    /// by_direction  faces that look different ways have vertices of their own
    /// out           replaced
    void finish(const CubeRectangles& rectangles, bool by_direction, CubeMesh& out);

private:
    static constexpr int kCorners = kCubeBrickSide + 1;

    void add_corner(const std::array<int, 3>& c);
    uint32_t vertex(const std::array<int, 3>& c, uint32_t material, uint8_t direction, CubeMesh& out);
    void add_polygon(const CubeRectangle& rectangle, CubeDirection direction, bool by_direction, CubeMesh& out);

    // By axis: corners of the line along it as bits, 64 left out, as it is never between two others.
    std::array<std::vector<uint64_t>, 3> lines_;
    std::vector<uint32_t> first_vertex_;  // by corner, 1 + its number; 0: none
    std::vector<uint32_t> next_vertex_;   // by vertex: another one at the same corner
};

}  // namespace strata
