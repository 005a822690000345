#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/math/vec.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// All rays from a point within an angle of a direction, in voxels of the tree's frame.
struct VoxelCone {
    Vec3d origin = Vec3d::Zero();
    Vec3d direction = Vec3d::UnitX();                                 // of any length but 0
    double tangent = 0.1;                                             // of half the opening angle
    double from = 0.0, to = std::numeric_limits<double>::infinity();  // the part that counts: distances from the origin, in voxels
};

struct ConeSettings {
    enum class Sampling : uint8_t { nearest, linear };

    Sampling sampling = Sampling::linear;
    double step = 1.0;  // at most 1: in sides of the finer cells looked at
    int cones = 1;      // narrower ones, of the same area together, that are walked one by one: more time, less error
};

/// How much of a cone is hidden, estimated by a walk along its axis over cells of the tree that are as wide as the cone. Where the
/// width lies between those of two depths, both are looked at; where it is less than a voxel, a ray. Rests on the opacities of cells along
/// axes, which make a wall opaque from the front and thin from the side; voxels are opaque unless the tree says something else of them, as
/// a medium's may. Keeps the way down the tree from one sample to the next; one per thread. Things one behind the other hide as much as if
/// they lay at random: two that each hide half of the cone leave a quarter of it, where the truth is anything from nothing to a half. So
/// the cells along one surface seen aslant hide too much, and the rims of things are wide. This error is the method's own; docs/accuracy.md
/// says how large it is, and what more cones gain.
/// source  C. Crassin et al., "Interactive Indirect Illumination Using Voxel Cone Tracing", Pacific Graphics 2011
class ConeQuery {
public:
    /// throws  Error{usage}: the tree has no opacities
    explicit ConeQuery(const VoxelTree& tree, const ConeSettings& settings = {});

    /// 0: nothing of the cone is hidden, 1: all. More than 1 - 2^-10 counts as all.
    double opacity(const VoxelCone& cone);

private:
    using CellOpacity = std::array<uint8_t, 3>;  // along x, y, z

    // Where a level's node was last found.
    struct Step {
        uint64_t node = 0;  // its coordinates in units of its own side, in one word
        uint32_t index = 0;
        enum class Kind : uint8_t { unknown, inside, empty, full } kind = Kind::unknown;
    };

    CellOpacity cell(int depth, const std::array<int64_t, 3>& at);
    const Step& find_node(int level, int depth, const std::array<uint32_t, 3>& at);
    // A line through cells.
    struct Axis {
        Vec3d origin, direction;  // of length 1
        Vec3d weights;            // of opacities along x, y, z
        int along = 0;            // the axis that it is nearest to
        Vec3d at(double t) const { return origin + t * direction; }
    };

    double opacity_of_one(const VoxelCone& cone, const Vec3d& direction);
    double optical_depth(int depth, const Axis& axis, const Vec3d& p);
    // Those of `depth`, and in part those of the next coarser one.
    struct Cells {
        int depth = 0;
        double side = 1.0, part_coarser = 0.0;
    };

    Cells cells_of(double width) const;
    double depth_of_step(const Axis& axis, const Vec3d& p, const Cells& cells, double step);
    double end_of_nothing(const Axis& axis, double t, double tangent) const;

    const VoxelTree& tree_;
    ConeSettings settings_;
    std::vector<Step> way_;  // [levels]
    bool opaque_voxels_;     // nothing is said of the finest cells
};

}  // namespace strata
