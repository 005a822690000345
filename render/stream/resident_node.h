#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"
#include "core/octree/layered_cloud.h"
#include "render/image.h"

namespace strata {

/// A direction along world axes, either side; zero: none.
using PackedNormal = std::array<int8_t, 3>;

/// What a point stands for: a piece of surface of some size and tilt.
struct PointShape {
    float spacing = 0.0f;                // world units: the radius of a splat that leaves no gap to its neighbors; 0: unknown
    PackedNormal normal = {};            // of length 127; zero: the points around it lie in no plane

    bool flat() const { return normal != PackedNormal{}; }
    bool operator==(const PointShape&) const = default;
};

/// Point shapes within a node, in 8 x 8 x 8 cells of a box that holds its points.
struct ShapeGrid {
    static constexpr int kSide = 8;

    static size_t index(int x, int y, int z) { return size_t((x * kSide + y) * kSide + z); }
    const PointShape& at(int32_t x, int32_t y, int32_t z) const { return cells[index(cell(x, 0), cell(y, 1), cell(z, 2))]; }
    // The difference is one of integers: a grid may be small and far from the quanta's zero.
    int cell(int32_t quanta, int axis) const {
        const int64_t above = std::max<int64_t>(int64_t{quanta} - origin[size_t(axis)], 0);
        return int(std::min(float(above) * cells_per_quantum[size_t(axis)], float(kSide - 1)));
    }

    std::array<int32_t, 3> origin = {};  // lowest quanta of the points
    std::array<float, 3> cells_per_quantum = {};
    std::vector<PointShape> cells;  // [8 * 8 * 8]; empty where all points coincide
};

/// The points of one node, ready to draw or to be cut. 24 bytes a point, one more with a filter, three with normals.
struct ResidentNode {
    std::vector<int32_t> x, y, z;  // quanta of the cloud
    std::vector<Rgba8> colors;
    Vec3i min_quanta = Vec3i::Zero(), max_quanta = Vec3i::Zero();  // of the points
    std::vector<uint8_t> passes;   // the filter; empty: all pass
    std::vector<PackedNormal> normals;  // the points' own, the largest number 127, good to a quarter of a degree; empty unless asked for

    uint64_t serial = 0;  // of the read that brought it, in its cache; 0: none, so that it is not known again
    ShapeGrid local_shape;  // measured once, among the node's points and those above it
    bool shape_measured = false;
    /// By the finest node drawn at each point's place, for the last set of drawn nodes: shapes_from, in ascending order.
    std::vector<PointShape> shapes;
    std::vector<NodeId> shapes_from;
    uint64_t shapes_version = 1;  // raised when they change

    size_t size() const { return x.size(); }
};

/// What a resident node takes in memory at most, without a filter, with its entry in the cache and its measured shapes.
inline constexpr uint64_t kResidentNodeBytes = 5 * 1024, kResidentPointBytes = 24;
inline constexpr uint64_t kResidentFilterBytes = 1, kResidentNormalBytes = sizeof(PackedNormal);  // more a point

}  // namespace strata
