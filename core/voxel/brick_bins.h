#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/voxel/grid_mesh.h"

namespace strata {

inline constexpr int kBrickBits = 6;  // a brick is a cube of 2^6 voxels an axis: its masks are 32 KiB
inline constexpr uint32_t kBrickSide = uint32_t{1} << kBrickBits;

/// The triangles that touch each brick.
class BrickBins {
public:
    struct Brick {
        uint64_t code;  // octant_code of its coordinates among bricks
        size_t begin, end;
    };

    /// throws  Error{limit}: they take more than memory_bytes
    BrickBins(const GridMesh& mesh, int threads, uint64_t memory_bytes);

    const std::vector<Brick>& bricks() const { return bricks_; }  // in ascending order
    std::span<const uint32_t> triangles(const Brick& brick) const { return {triangles_.data() + brick.begin, brick.end - brick.begin}; }

private:
    std::vector<Brick> bricks_;
    std::vector<uint32_t> triangles_;
};

}  // namespace strata
