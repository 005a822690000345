#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace strata {

/// Sides for the normals of a surface that were fitted, and may point either way. Cells of a grid that touch vote for the same side or for
/// opposite ones; in rounds, each part takes the side of the neighbor that it shares the plainest vote with, all edges between the two together. Parts
/// that do not touch, but lie up to three cells apart, come last. Of what hangs together, most looks up; or where neither side does, as around
/// an object, its top.
/// source  H. Hoppe et al., "Surface reconstruction from unorganized points", SIGGRAPH 1992, for sides that spread; M. Keuper et al., "Efficient
///         decomposition of image and mesh graphs by lifted multicuts", ICCV 2015, for sums of votes (a tree of single edges turns whole walls where
///         one of them is wrong); S. Koenig, S. Gumhold, "Consistent propagation of normal orientations in point clouds", VMV 2009, for mirroring
///         a normal from one place to another
class NormalOrientation {
public:
    struct Cell {
        std::array<int32_t, 3> at;  // i, j, k of the cell, each from 0 to below 2^20
        Vec3f place;                // of its points, on the mean, in cells from its least corner
        Vec3f normal;               // unit
    };

    /// Cells in ascending order of k, then j, then i.
    void add(const std::vector<Cell>& cells);
    /// memory_bytes  for all of this, what is taken already too
    /// throws  Error{limit}: that is too little
    /// cost    O(cells log cells), 72 bytes each, and 16 bytes an edge between neighbors: 4 to 5 a cell of a surface, up to 13 where they lie all about
    void solve(uint64_t memory_bytes);
    /// After solve(): whether the normals of a cell turn about. false where there is no such cell.
    bool is_turned(const std::array<int32_t, 3>& at) const;

    uint64_t cells() const { return keys_.size(); }
    uint64_t components() const { return components_; }
    /// Taken now.
    uint64_t memory_bytes() const;

private:
    static uint64_t key_of(const std::array<int32_t, 3>& at) { return uint64_t(at[2]) << 40 | uint64_t(at[1]) << 20 | uint64_t(at[0]); }
    uint32_t root_of(uint32_t cell, bool& turned);
    template <typename Use>
    void for_neighbors(int reach, const Use& use);
    void join(int reach, uint64_t memory_bytes);
    void check_room(uint64_t more, uint64_t memory_bytes) const;
    void unite(uint32_t a, uint32_t b, bool turned);

    std::vector<uint64_t> keys_;  // ascending
    std::vector<Vec3f> places_, normals_;
    std::vector<uint32_t> parents_;  // turned against the parent: bit 31
    std::vector<uint8_t> ranks_;
    std::vector<bool> turned_;
    uint64_t components_ = 0;
};

}  // namespace strata
