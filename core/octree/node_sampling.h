#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/octree/octree_frame.h"

namespace strata {

/// Picks the points that inner nodes keep: a maximal subset in which no two points are closer than the node's spacing,
/// chosen in a random but fixed order, so that it looks like blue noise. Points of neighbouring nodes that were chosen
/// before can be planted as seeds; they keep their distance too, so that borders do not show.
/// Holds 10 MB that it reuses; one per thread.
/// source  dart throwing on a grid, after R. Bridson, "Fast Poisson Disk Sampling in Arbitrary Dimensions", SIGGRAPH
///         2007 sketches; the candidates are the real points
class NodeSampler {
public:
    explicit NodeSampler(const OctreeFrame& frame);

    /// Forgets the last node; the following calls concern this one.
    void start(const NodeKey& node);

    /// A point (stored quanta) that another node keeps. Ignored when it is farther from the node than the spacing.
    /// kept_level  of the node that keeps it: to points of deeper levels it is enough to keep their smaller spacing
    void add_seed(const Vec3i& p_quanta, uint32_t kept_level);

    /// x, y, z  [n] stored quanta, in an order that depends on the points alone and keeps neighbours together; all
    ///          inside the node
    /// kept     receives ascending indices
    /// cost     O(n) expected
    void sample(std::span<const int32_t> x, std::span<const int32_t> y, std::span<const int32_t> z, std::vector<uint32_t>& kept);

    /// Whether the point, inside the node's cube, is so near to its faces that a neighbour must know of it.
    bool near_faces(const Vec3i& p_quanta) const;

private:
    enum class State : uint8_t { open, kept, refused };
    static constexpr uint32_t kNone = ~uint32_t{0};
    struct Kept {
        Vec3f p;         // in spacings from the node's lowest corner
        float distance_squared;  // that candidates keep from it; 1 unless it is of a deeper level
        uint32_t next;  // index of the next in the same cell, or kNone
    };
    // Cells of one spacing; two more on each side so that seeds and neighbour cells stay inside.
    static constexpr int kMargin = 2;
    static constexpr int kCells = int(kSpacingsPerSide) + 2 * kMargin;

    static constexpr size_t kRowBytes = (kCells + 7) / 8 + 1;  // a row of occupancy bits; 16 bits can be read at each

    struct Cell {
        int x, y, z;
        explicit Cell(const Vec3f& p) : x(int(p.x() + float(kMargin))), y(int(p.y() + float(kMargin))), z(int(p.z() + float(kMargin))) {}
        size_t row() const { return size_t(z) * kCells + size_t(y); }
        size_t index() const { return row() * kCells + size_t(x); }
    };

    Vec3f in_spacings(const Vec3i& p_quanta) const;
    static bool is_close(const Vec3f& p, const Kept& kept) { return (kept.p - p).squaredNorm() < kept.distance_squared; }
    void convert(int axis, std::span<const int32_t> quanta);
    size_t refuse_run(size_t begin, const Kept& kept);
    uint32_t find_close_in(const Vec3f& p, size_t cell) const;  // index into kept_, or kNone
    uint32_t find_close(const Vec3f& p) const;
    void insert(const Vec3f& p, float distance_squared);

    OctreeFrame frame_;
    uint32_t level_ = 0;
    Vec3d spacings_per_quantum_ = Vec3d::Zero();
    Vec3d corner_ = Vec3d::Zero();  // of the node, in spacings from the root's corner
    std::vector<uint8_t> occupied_;        // [kCells^2][kRowBytes] a bit a cell: small enough to stay in cache
    std::vector<uint32_t> first_in_cell_;  // [kCells^3] index into kept_; read only where the bit is set
    std::vector<Kept> kept_;
    std::array<std::vector<float>, 3> candidates_;  // [axis][n] in spacings
    std::vector<State> states_;                     // [n]
};

}  // namespace strata
