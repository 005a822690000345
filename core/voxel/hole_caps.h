#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/math/box.h"
#include "core/voxel/grid_mesh.h"

namespace strata {

struct PointColumns {
    std::vector<double> x, y, z;
};

/// Triangles that close a mesh, and how far the winding number of the mesh is from that of the closed one.
///
/// The boundary of a mesh, edges that it does not run through as often one way as the other, is a set of cycles. A cone over each of
/// its connected parts, to the mean of the part's points, closes it. The winding number w of the mesh is then that of the closed
/// one, a whole number n, less that of the caps, g: a sum of solid angles, which jumps where n does and is smooth elsewhere. Where
/// |g| < 1/2, which is all of space but the nearness of wide holes, w > 1/2 just where n >= 1.
/// Source of the generalized winding number: A. Jacobson et al., "Robust Inside-Outside Segmentation Using Generalized Winding Numbers",
/// 2013.
class HoleCaps {
public:
    using Point = GridMesh::FarPoint;  // grid units

    /// Finds the boundary by vertices, and if there is one, by their snapped places.
    HoleCaps(const TriangleMesh& mesh, const GridMesh& grid);
    /// Bytes of memory that finding it takes.
    static uint64_t memory_needed(const TriangleMesh& mesh);

    bool empty() const { return caps_.empty(); }
    const std::vector<std::array<Point, 3>>& caps() const { return caps_; }

private:
    friend class HolesNearby;

    struct Part {
        Box3d box;                  // grid units, as all here
        double area = 0.0;          // of its caps
        size_t begin = 0, end = 0;  // in caps_
        Vec3d apex;
    };
    int bits_;
    std::vector<std::array<Point, 3>> caps_;  // part after part; the first two corners are an edge of the boundary
    std::vector<Part> parts_;
    PointColumns from_, to_;  // [caps_] ends of these edges
};

/// The caps as seen from a cube of voxels: near ones one by one, the others by how little they can matter.
/// Keeps its buffers, and refers to the caps.
class HolesNearby {
public:
    explicit HolesNearby(const HoleCaps& caps) : caps_(caps) {}

    /// first, size  the cube's corner and side, voxels
    void look_from(const std::array<uint32_t, 3>& first, uint32_t size);

    /// The least n that lies inside, for all centers of voxels in a cube in that looked from; empty: not the same for all, as far as
    /// can be told.
    /// capped  whether a cap touches the cube
    std::optional<int> least_inside(const std::array<uint32_t, 3>& first, uint32_t size, bool capped);
    /// The same at one center.
    int least_inside(const std::array<uint32_t, 3>& voxel);

private:
    double winding(const HoleCaps::Point& p, const std::vector<uint32_t>& parts);
    double slope_bound(const Vec3d& center, double radius) const;

    const HoleCaps& caps_;
    std::vector<std::pair<double, uint32_t>> by_bound_;
    std::vector<uint32_t> near_, all_;  // parts
    double far_ = 0.0;                  // the most that the winding number of all others is
    std::vector<double> angle_sine_, angle_cosine_, scale_;
};

}  // namespace strata
