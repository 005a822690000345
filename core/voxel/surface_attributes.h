#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/voxel/grid_mesh.h"
#include "core/voxel/voxel_block.h"

namespace strata {

/// Means over the triangles in each voxel of a brick: of normals, and of the colors that triangles have where they are nearest to its
/// center. A triangle weighs as much as its area, but no more than the area of a voxel's cross-section. Sums are whole numbers, so the
/// order in which triangles come does not matter. Keeps its buffers; one a thread.
class SurfaceAttributes {
public:
    SurfaceAttributes(const TriangleMesh& mesh, const GridMesh& grid, const VoxelAttributes& attributes)
        : mesh_(mesh), grid_(grid), attributes_(attributes) {}

    /// Which voxels of a brick there are.
    void start(std::span<const uint64_t> masks);

    /// The triangle of the calls of `add` that follow.
    void take_triangle(size_t i);
    /// place  of a voxel in Morton order within the brick
    /// voxel  its coordinates in the frame
    void add(uint32_t place, const std::array<int32_t, 3>& voxel);

    void append_columns(VoxelBatch& batch) const;

private:
    struct Sum {
        std::array<int64_t, 3> normal = {}, color = {};
        int64_t weight = 0;  // of colors
    };

    const TriangleMesh& mesh_;
    const GridMesh& grid_;
    VoxelAttributes attributes_;
    std::span<const uint64_t> masks_;
    std::vector<uint32_t> first_;  // [masks] voxel
    std::vector<Sum> sums_;        // [voxels]

    std::array<int64_t, 3> normal_ = {};  // of the triangle, times its weight
    int64_t weight_ = 0;
    std::array<Vec3d, 3> corners_voxel_ = {Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};
    std::array<Vec3d, 3> to_barycentric_ = {Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};  // p -> its share of the other two corners
    std::array<std::array<uint8_t, 4>, 3> colors_ = {};
};

}  // namespace strata
