#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/math/vec.h"
#include "core/voxel/voxel_block.h"
#include "core/voxel/voxel_frame.h"

namespace strata {

/// Voxels around the points of an integer lattice, gathered in any order as bricks of 8^3 and as cubes, then put out in Morton
/// order. Needs some 90 bytes a brick.
class BrickVoxels {
public:
    /// origin  the least lattice point, multiples of 8
    /// masks   by octant code, of 4^3 points each. All may be 0
    /// Bricks and cubes must be disjoint.
    void add_brick(const Vec3i& origin, const std::array<uint64_t, 8>& masks);
    /// A cube of 2^log2_side points a side, all occupied.
    /// origin  multiples of its side; log2_side 3 to 20
    void add_cube(const Vec3i& origin, int log2_side);

    uint64_t voxels() const { return voxels_; }
    uint64_t memory_bytes() const { return bricks_.size() * (sizeof(Brick) + sizeof order_[0]) + cubes_.size() * (sizeof(Cube) + sizeof(VoxelBlock)); }

    /// Chooses the frame and sorts: the smallest whose least corner lies at multiples of the largest cube's side, and of 8; or, where
    /// `levels` is not 0 and all fits, the frame of so many levels that begins at lattice point 0. Once, after all was added.
    /// place_of_0  world: the lattice's point (0, 0, 0), which is the center of its voxel
    /// throws  Error{limit}: more than 2^20 voxels an axis
    VoxelFrame finish(const Vec3d& place_of_0, double voxel_size, int levels = 0);
    /// Puts all out in order, after finish().
    void emit(const VoxelSink& sink) const;

private:
    struct Brick {
        std::array<int32_t, 3> origin;
        std::array<uint64_t, 8> masks;
    };
    struct Cube {
        std::array<int32_t, 3> origin;
        int log2_side;
    };

    std::vector<Brick> bricks_;
    std::vector<Cube> cubes_;
    std::vector<std::pair<uint64_t, uint32_t>> order_;  // of bricks: code in units of bricks, and index
    std::vector<VoxelBlock> tall_;                      // of the cubes, sorted
    uint64_t voxels_ = 0;
};

}  // namespace strata
