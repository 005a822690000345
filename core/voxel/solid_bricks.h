#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/voxel/brick_bins.h"
#include "core/voxel/hole_caps.h"
#include "core/voxel/voxel_block.h"

namespace strata {

/// Winding numbers of a closed mesh at the first voxel center of each brick, from where lines up through these cross it.
/// All winding numbers are those of points that lie a little higher than the centers, as TriangleScanner has it.
class BrickWindings {
public:
    BrickWindings(const GridMesh& mesh, int threads);

    int at(const std::array<uint32_t, 3>& brick) const;

private:
    struct Crossing {
        uint64_t column;  // of bricks
        uint32_t first;   // brick above
        int32_t winding;  // below it: a mesh closed has none far above
    };
    static uint64_t column_of(uint32_t x, uint32_t y) { return uint64_t{x} << 32 | y; }

    std::vector<Crossing> crossings_;  // by column, then from below
};

/// A run of the solid in Morton order: whole cubes, and then one brick that the mesh passes through.
struct SolidJob {
    size_t first_cube = 0, last_cube = 0;  // of SolidPlan::cubes
    uint64_t code = 0;                     // of the brick
    std::span<const uint32_t> triangles;
    bool has_brick = false;
};

struct SolidPlan {
    std::vector<VoxelBlock> cubes;
    std::vector<SolidJob> jobs;
};

/// Divides the frame where triangles or wide holes make it needful.
SolidPlan plan_solid(const GridMesh& mesh, const BrickBins& bins, const BrickWindings& windings, const HoleCaps& holes);

/// Fills one brick after the other, keeping its buffers. One a thread.
class SolidBrick {
public:
    /// caps  the triangles of the mesh from this one on are caps of holes
    SolidBrick(const GridMesh& mesh, const HoleCaps& holes, size_t caps);

    /// Appends the blocks of a brick.
    /// winding  at its first center
    void fill(uint64_t code, std::span<const uint32_t> triangles, int winding, std::vector<VoxelBlock>& blocks);

private:
    static constexpr size_t kMasks = size_t{1} << 3 * (kBrickBits - 2);
    static constexpr uint32_t kTiles = kBrickSide / 4;
    static constexpr int32_t kEach = std::numeric_limits<int32_t>::max();  // least_: another one for each voxel

    struct Crossing {
        uint32_t place;  // mask among columns of masks, column in the mask, voxel in that: 12, 4, 2 bits
        int32_t sign;
    };

    void start_columns(const CellRange& voxels, std::span<const uint32_t> triangles, int winding);
    void cross_columns(const CellRange& voxels, std::span<const uint32_t> triangles);
    void find_least(const std::array<uint32_t, 3>& first, uint32_t size, const std::array<uint32_t, 3>& brick_first);
    void mark_capped(const CellRange& voxels, std::span<const uint32_t> triangles);
    void fill_masks(const CellRange& voxels);
    void append_blocks(uint64_t code, std::vector<VoxelBlock>& blocks) const;

    const GridMesh& mesh_;
    HolesNearby holes_;
    bool has_holes_;
    size_t caps_;
    TriangleScanner scanner_;
    std::vector<int32_t> start_;  // [x][y] winding at the first center of each column
    std::vector<Crossing> crossings_, sorted_;
    std::vector<uint32_t> places_;  // where each mask's crossings begin
    std::vector<int32_t> least_;    // [mask, in the order of columns] the least winding number that lies inside
    std::vector<uint8_t> capped_;   // [mask]
    std::vector<uint64_t> masks_;   // in Morton order
};

}  // namespace strata
