#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/math/box.h"
#include "core/surface/scalar_field.h"

namespace strata {

/// The least and the greatest of some values, and whether some are missing; of none: least > greatest.
struct FieldRange {
    float least = std::numeric_limits<float>::infinity(), greatest = -std::numeric_limits<float>::infinity();
    bool has_missing = false;  // NaN

    void add(float value) {
        if (value < least) least = value;
        if (value > greatest) greatest = value;
        has_missing |= value != value;
    }
    void add(const FieldRange& other) {
        if (other.least < least) least = other.least;
        if (other.greatest > greatest) greatest = other.greatest;
        has_missing |= other.has_missing;
    }
};

/// A scalar field in memory, made for looking at any of its isosurfaces: bricks of 8^3 samples, and which values lie in cubes of 4^3,
/// 8^3 and 64^3 cells. A cell is the cube between 8 samples, known by the least; its coordinates here count from 0.
class FieldBricks {
public:
    /// throws  Error{limit}: more memory than allowed is needed; what the source throws
    /// cost    4 bytes a sample, 96 a brick that is stored and 20 a brick
    static FieldBricks of_slices(SliceSource& source, uint64_t memory_bytes, int threads);
    /// Empty where there are no bricks.
    static FieldBricks of_bricks(FieldBrickSource& source, uint64_t memory_bytes, int threads);

    bool empty() const { return values_.empty(); }
    const GridPlacement& placement() const { return placement_; }     // of sample (0, 0, 0) as counted here
    const std::array<int32_t, 3>& bricks() const { return bricks_; }  // an axis
    /// Cells an axis, those of the last bricks too.
    std::array<int32_t, 3> cells() const { return {8 * bricks_[0], 8 * bricks_[1], 8 * bricks_[2]}; }
    /// Of all samples; world. Of a sparse field those of its bricks.
    const Box3d& bounds() const { return bounds_; }
    const FieldRange& range() const { return range_; }
    uint64_t size_bytes() const;

    /// A sample; NaN beyond the field, and in a sparse one away from its bricks, where no surface can be.
    float sample(int32_t i, int32_t j, int32_t k) const {
        if ((uint32_t(i) >> 3) >= uint32_t(bricks_[0]) || (uint32_t(j) >> 3) >= uint32_t(bricks_[1]) ||
            (uint32_t(k) >> 3) >= uint32_t(bricks_[2]))
            return std::numeric_limits<float>::quiet_NaN();
        const size_t index = brick_index(i >> 3, j >> 3, k >> 3);
        const uint32_t number = numbers_[index];
        return number == kNone ? absent_[index]
                               : values_[size_t{number} * kFieldBrickSamples + size_t((k & 7) << 6 | (j & 7) << 3 | (i & 7))];
    }
    /// The corners of a cell, i fastest, then j.
    std::array<float, 8> corners(const std::array<int32_t, 3>& cell) const;

    /// Values of the samples of the cells in a brick.
    const FieldRange& range_of(int32_t bi, int32_t bj, int32_t bk) const { return ranges_[brick_index(bi, bj, bk)]; }
    /// Likewise of 4^3 cells of a brick, by the octant: 1 for the upper i, 2 for j, 4 for k.
    const FieldRange& octant_range_of(int32_t bi, int32_t bj, int32_t bk, int octant) const {
        const size_t index = brick_index(bi, bj, bk);
        return numbers_[index] == kNone ? ranges_[index] : octant_ranges_[8 * size_t{numbers_[index]} + size_t(octant)];
    }
    /// Likewise of 8^3 bricks.
    const FieldRange& wide_range_of(int32_t wi, int32_t wj, int32_t wk) const {
        return wide_ranges_[(size_t(wk) * size_t(wide(1)) + size_t(wj)) * size_t(wide(0)) + size_t(wi)];
    }

private:
    static constexpr uint32_t kNone = ~uint32_t{0};

    size_t brick_index(int32_t bi, int32_t bj, int32_t bk) const {
        return (size_t(bk) * size_t(bricks_[1]) + size_t(bj)) * size_t(bricks_[0]) + size_t(bi);
    }
    int32_t wide(size_t axis) const { return (bricks_[axis] + 7) / 8; }
    void copy_with_rim(int32_t bi, int32_t bj, int32_t bk, std::span<float, 729> out) const;
    void find_ranges(int threads);
    void allow(uint64_t bricks, uint64_t stored, uint64_t memory_bytes) const;

    GridPlacement placement_;
    std::array<int32_t, 3> bricks_ = {0, 0, 0};
    std::vector<uint32_t> numbers_;          // [bricks] of the stored brick there
    std::vector<float> values_;              // [stored bricks * 512] i fastest, then j
    std::vector<float> absent_;              // [bricks] of a sparse field: the value of those that are not stored
    std::vector<FieldRange> octant_ranges_;  // [stored bricks * 8]
    std::vector<FieldRange> ranges_, wide_ranges_;
    FieldRange range_;
    Box3d bounds_;
};

}  // namespace strata
