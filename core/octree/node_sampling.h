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
/// Holds 10 MB and kBytesPerCandidate, which it reuses; one per thread.
/// source  dart throwing on a grid, after R. Bridson, "Fast Poisson Disk Sampling in Arbitrary Dimensions", SIGGRAPH
///         2007 sketches; the candidates are the real points
class NodeSampler {
public:
    static constexpr size_t kBytesPerCandidate = 3 * 4 + 4 + 8 + 1;

    explicit NodeSampler(const OctreeFrame& frame);

    /// Forgets the last node; the following calls concern this one.
    void start(const NodeKey& node);

    /// A point (stored quanta) that another node keeps. Ignored when it is farther from the node than the spacing.
    /// kept_level  of the node that keeps it: to points of deeper levels it is enough to keep their smaller spacing
    void add_seed(const Vec3i& p_quanta, uint32_t kept_level);

    /// x, y, z  [n] stored quanta, in an order that depends on the points alone and keeps neighbours together; all
    ///          inside the node. Points that are seeds themselves may be among them: they are not kept again
    /// kept     receives ascending indices
    /// cost     O(n) expected
    void sample(std::span<const int32_t> x, std::span<const int32_t> y, std::span<const int32_t> z,
                std::vector<uint32_t>& kept);

    /// Whether the point, inside the node's cube, is so near to its faces that a neighbour must know of it.
    bool near_faces(const Vec3i& p_quanta) const {
        return (p_quanta.array() < inner_low_.array() || p_quanta.array() > inner_high_.array()).any();
    }

private:
    enum class Round { one_dart, rest };
    static constexpr uint32_t kNone = ~uint32_t{0};
    static constexpr uint32_t kBlock = 8;  // candidates that are tested together
    struct Kept {
        Vec3f p;                 // in spacings from the node's lowest corner
        float distance_squared;  // that candidates keep from it; 1 unless it is of a deeper level
        uint32_t next;           // index of the next in the same cell, or kNone
    };
    // Cells of one spacing, numbered in bricks of 2 x 2 x 2 along x; two more on each side so that seeds and neighbour
    // cells stay inside. A cell's number is its bit of occupied_ too.
    static constexpr int kMargin = 2;
    static constexpr uint32_t kCells = uint32_t(kSpacingsPerSide) + 2 * kMargin;
    static constexpr uint32_t kRow = (4 * kCells + 31) / 32 * 32;  // cells of two rows in y by two in z, rounded up
    static constexpr uint32_t kSlice = kCells / 2 * kRow;
    static uint32_t cell_index(uint32_t x, uint32_t y, uint32_t z) {
        return z / 2 * kSlice + y / 2 * kRow + 4 * x + 2 * (z & 1) + (y & 1);
    }

    /// Successive candidates in one brick of cells, at most kBlock.
    struct Block {
        uint32_t begin;
        uint32_t cells;  // see make_blocks
    };
    struct Neighborhood;
    class Tested;

    static uint32_t cell_index(const Vec3f& p);
    Vec3f in_spacings(const Vec3i& p_quanta) const;
    void convert(int axis, std::span<const int32_t> quanta);
    void make_blocks(size_t n);
    uint64_t occupied_around(uint32_t brick) const;
    void visit(uint32_t index, Round round);
    void insert(const Vec3f& p, float distance_squared);

    OctreeFrame frame_;
    uint32_t level_ = 0;
    Vec3d spacings_per_quantum_ = Vec3d::Zero();
    Vec3d corner_ = Vec3d::Zero();                                  // of the node, in spacings from the root's corner
    Vec3i inner_low_ = Vec3i::Zero(), inner_high_ = Vec3i::Zero();  // quanta at least a spacing from the node's faces
    std::vector<uint8_t> occupied_;                                 // a bit a cell: small enough to stay in cache
    std::vector<uint32_t> first_in_cell_;  // [cells] index into kept_; read only where the bit is set
    std::vector<Kept> kept_;
    std::array<std::vector<float>, 3> candidates_;  // [axis][n + kBlock] in spacings
    std::vector<uint32_t> cells_;                   // [n] x | y << 8 | z << 16
    std::vector<Block> blocks_;                     // block_count_ of them, then one that begins at n
    size_t block_count_ = 0;
    std::vector<uint32_t> open_blocks_;  // of a window, after one dart
    std::vector<uint8_t> picked_;        // [blocks] a bit a candidate
};

}  // namespace strata
