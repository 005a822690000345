#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/octree/octree_frame.h"

namespace strata {

/// Picks the points that inner nodes keep: a maximal subset in which no two points are closer than the node's spacing,
/// chosen in a random but fixed order, so that it looks like blue noise. Points of neighbouring nodes that were chosen
/// before can be planted as seeds; they keep their distance too, so that borders do not show.
/// Holds 9 MB that it reuses; one per thread.
/// source  dart throwing on a grid, after R. Bridson, "Fast Poisson Disk Sampling in Arbitrary Dimensions", SIGGRAPH
///         2007 sketches; the candidates are the real points
class NodeSampler {
public:
    explicit NodeSampler(const OctreeFrame& frame);

    /// Forgets the last node; the following calls concern this one.
    void start(const NodeKey& node);

    /// A point (stored quanta) that a neighbour keeps. Ignored when it is farther from the node than the spacing.
    void add_seed(const Vec3i& p_quanta);

    /// positions  stored quanta, in an order that depends on the points alone; all inside the node
    /// kept       receives ascending indices
    /// cost       O(n) expected
    void sample(std::span<const Vec3i> positions, std::vector<uint32_t>& kept);

    /// Whether the point, inside the node's cube, is so near to its faces that a neighbour must know of it.
    bool near_faces(const Vec3i& p_quanta) const;

private:
    struct Kept {
        Vec3f p;        // in spacings from the node's lowest corner
        uint32_t next;  // 1 + index of the next in the same cell; 0: none
    };
    // Cells of one spacing; two more on each side so that seeds and neighbour cells stay inside.
    static constexpr int kMargin = 2;
    static constexpr int kCells = int(kSpacingsPerSide) + 2 * kMargin;

    Vec3f in_spacings(const Vec3i& p_quanta) const;
    static size_t cell_of(const Vec3f& p);
    bool any_within_spacing(const Vec3f& p, uint32_t first) const;
    bool has_close_neighbour(const Vec3f& p) const;
    void insert(const Vec3f& p);

    OctreeFrame frame_;
    Vec3d spacings_per_quantum_ = Vec3d::Zero();
    Vec3d corner_ = Vec3d::Zero();  // of the node, in spacings from the root's corner
    std::vector<uint32_t> first_in_cell_;  // [kCells^3] 1 + index into kept_, 0: empty
    std::vector<Kept> kept_;
    std::vector<Vec3f> candidates_;
};

}  // namespace strata
