#pragma once

#include <algorithm>
#include <cmath>

#include "core/math/quantization.h"
#include "core/math/vec.h"
#include "core/octree/node_key.h"

namespace strata {

/// Levels below the root that cells can have: at level 31 a cell index takes 31 bits an axis.
inline constexpr uint32_t kMaxLevel = 31;
/// Spacing of a node: its cube's side over this.
inline constexpr double kSpacingsPerSide = 128.0;

/// Where an octree lies: its root cube, and how a point's quanta become cells of it.
/// The builder stores quanta from the cloud's lowest corner: stored = source - min_quanta, never negative, below 2^31.
/// A cloud wider than that is coarsened by powers of two until it fits.
struct OctreeFrame {
    Vec3i min_quanta = Vec3i::Zero();    // source quanta of the lowest corner
    Vec3i max_quanta = Vec3i::Zero();    // source quanta, tight
    int coarsening_bits = 0;             // 0 unless the extent takes more than 31 bits
    Vec3d scale = Vec3d::Ones();         // world units per stored quantum
    double side = 1.0;                   // of the root cube, world units
    Vec3d cells_per_quantum = Vec3d::Ones();  // cells of level 31 per stored quantum

    double node_side(uint32_t level) const { return std::ldexp(side, -int(level)); }
    double spacing(uint32_t level) const { return node_side(level) / kSpacingsPerSide; }

    int32_t stored(int axis, int32_t source) const {
        const int64_t from_corner = int64_t(source) - min_quanta[axis];
        if (coarsening_bits == 0) return int32_t(from_corner);
        return int32_t((from_corner + (int64_t{1} << (coarsening_bits - 1))) >> coarsening_bits);
    }
    /// Index of the level-31 cell. One multiplication, one rounding: monotone, and the same on every machine.
    uint32_t cell(int axis, int32_t stored_quanta) const {
        return uint32_t(int32_t(std::min(double(stored_quanta) * cells_per_quantum[axis], 0x1p31 - 1.0)));
    }
};

/// The smallest cube at the cloud's lowest corner that holds every point strictly inside on the upper faces.
OctreeFrame make_octree_frame(const Quantization& quantization, const Vec3i& min_quanta, const Vec3i& max_quanta);

}  // namespace strata
