#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/surface/triangle_mesh.h"
#include "core/voxel/triangle_scan.h"
#include "core/voxel/voxel_frame.h"

namespace strata {

/// A mesh whose vertices are whole numbers of 2^-bits voxel from the frame's origin, near the frame.
class GridMesh {
public:
    /// throws  Error{malformed}, Error{limit}: as voxelize_mesh
    GridMesh(const TriangleMesh& mesh, const VoxelFrame& frame, int threads);

    int bits() const { return bits_; }
    const VoxelFrame& frame() const { return frame_; }

    /// Triangles that matter: those of the mesh, then parts of those that reach far out.
    size_t size() const { return triangles_->size() + added_.size(); }
    /// Whether triangle i is near the frame. Others count by their parts.
    bool is_near(size_t i) const {
        if (!any_far_ || i >= triangles_->size()) return true;
        for (const uint32_t v : (*triangles_)[i])
            if (vertices_[v][0] == kFar) return false;
        return true;
    }
    GridTriangle operator[](size_t i) const {
        if (i >= triangles_->size()) return added_[i - triangles_->size()];
        const std::array<uint32_t, 3>& t = (*triangles_)[i];
        return {{vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]}};
    }

    /// The triangle of the mesh that triangle i is, or a part of.
    size_t source(size_t i) const { return i < triangles_->size() ? i : sources_[i - triangles_->size()]; }

    using FarPoint = std::array<int64_t, 3>;
    /// The snapped place of a vertex that a triangle uses, wherever it is.
    FarPoint place(uint32_t vertex) const;
    static constexpr size_t kNoSource = ~size_t{0};
    /// Adds a triangle, in parts where it reaches far out, less what can be of no account.
    void add(const std::array<FarPoint, 3>& corners, size_t source = kNoSource);

private:
    static constexpr int32_t kFar = std::numeric_limits<int32_t>::min(), kRefused = 1;

    [[noreturn]] void refuse(uint32_t vertex) const;
    bool near(const FarPoint& p) const;

    const TriangleMesh& mesh_;
    VoxelFrame frame_;
    int bits_;
    int64_t side_, margin_;  // units
    const std::vector<std::array<uint32_t, 3>>* triangles_;
    std::vector<std::array<int32_t, 3>> vertices_;  // first coordinate kFar: too far out for 32 bits; second kRefused: for 64
    std::vector<GridTriangle> added_;
    std::vector<size_t> sources_;  // [added_]
    bool any_far_ = false;
};

}  // namespace strata
