#include "core/octree/reach_grid.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace strata {
namespace {

int32_t within(double quanta, int32_t low, int32_t high) { return int32_t(std::clamp(quanta, double(low), double(high))); }

}  // namespace

ReachGrid::ReachGrid(const std::vector<Place>& places, const Vec3i& min, const Vec3i& max) : marked_(kCells * kCells * kCells, 0) {
    struct Box {
        Vec3i low, high;
    };
    std::vector<Box> boxes;
    for (const Place& place : places) {
        const Vec3d low = (place.center.cast<double>() - place.reach).array().floor();
        const Vec3d high = (place.center.cast<double>() + place.reach).array().ceil();
        if ((low.array() > max.cast<double>().array()).any() || (high.array() < min.cast<double>().array()).any()) continue;
        Box box;
        for (int axis = 0; axis < 3; ++axis) {
            box.low[axis] = within(low[axis], min[axis], max[axis]);
            box.high[axis] = within(high[axis], min[axis], max[axis]);
        }
        min_ = min_.cwiseMin(box.low);
        max_ = max_.cwiseMax(box.high);
        boxes.push_back(box);
    }
    if (boxes.empty()) return;
    for (int axis = 0; axis < 3; ++axis) {
        const uint64_t extent = uint64_t(int64_t{max_[axis]} - min_[axis]);
        shift_[size_t(axis)] = std::max(int(std::bit_width(extent)) - int(std::bit_width(kCells - 1)), 0);
    }
    for (const Box& box : boxes)
        for (uint32_t x = cell(box.low, 0); x <= cell(box.high, 0); ++x)
            for (uint32_t y = cell(box.low, 1); y <= cell(box.high, 1); ++y)
                for (uint32_t z = cell(box.low, 2); z <= cell(box.high, 2); ++z) marked_[index(x, y, z)] = 1;
}

}  // namespace strata
