#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math/vec.h"

namespace strata {

/// Tells which points of a box may lie within reach of some of many places: a coarse grid over what they reach.
class ReachGrid {
public:
    struct Place {
        Vec3i center;
        Vec3d reach;  // quanta, an axis
    };
    /// min, max  of the box, quanta; what lies outside is not asked for
    ReachGrid(const std::vector<Place>& places, const Vec3i& min, const Vec3i& max);

    /// True for every point of the box within reach of a place, on each axis; for others near them too.
    bool contains(const Vec3i& p) const {
        if ((p.array() < min_.array()).any() || (p.array() > max_.array()).any()) return false;
        return marked_[index(cell(p, 0), cell(p, 1), cell(p, 2))];
    }

private:
    static constexpr uint32_t kCells = 32;  // an axis: 32 KB stay in the fastest cache

    uint32_t cell(const Vec3i& p, int axis) const { return uint32_t(int64_t{p[axis]} - min_[axis]) >> shift_[size_t(axis)]; }
    static size_t index(uint32_t x, uint32_t y, uint32_t z) { return (size_t(x) * kCells + y) * kCells + z; }

    Vec3i min_ = Vec3i::Constant(INT32_MAX), max_ = Vec3i::Constant(INT32_MIN);  // of what is reached
    std::array<int, 3> shift_ = {0, 0, 0};
    std::vector<uint8_t> marked_;
};

}  // namespace strata
