#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/math/box.h"
#include "core/surface/scalar_field.h"

namespace strata {

/// The least and the greatest of some values that are not missing; of none: least > greatest.
struct FieldRange {
    float least = std::numeric_limits<float>::infinity(), greatest = -std::numeric_limits<float>::infinity();

    void add(float value) {
        if (value < least) least = value;
        if (value > greatest) greatest = value;
    }
    void add(const FieldRange& other) {
        if (other.least < least) least = other.least;
        if (other.greatest > greatest) greatest = other.greatest;
    }
};

/// A scalar field in memory, made for looking at any of its isosurfaces: bricks of 8^3 samples, and which values lie in each. A cell is the
/// cube between 8 samples, known by the least; its coordinates here count from 0.
class FieldBricks {
public:
    /// throws  Error{limit}: more memory than allowed is needed; what the source throws
    /// cost    4 bytes a sample and 16 a brick
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
    uint64_t stored_bricks() const { return values_.size() / kFieldBrickSamples; }
    uint64_t size_bytes() const;

    /// A sample; NaN beyond the field, and in a sparse one away from its bricks, where no surface can be.
    float sample(int32_t i, int32_t j, int32_t k) const {
        const BrickSamples brick = brick_at(i >> 3, j >> 3, k >> 3);
        return brick.stored == nullptr ? brick.value : brick.stored[place_in_brick(i, j, k)];
    }
    /// The corners of a cell, i fastest, then j. The cell must not be the last of an axis: above that nothing is.
    std::array<float, 8> corners(const std::array<int32_t, 3>& cell) const {
        const auto [i, j, k] = cell;
        const size_t index = brick_index(i >> 3, j >> 3, k >> 3);
        if ((i & 7) < 7 && (j & 7) < 7 && (k & 7) < 7 && numbers_[index] != kNone) {
            const float* const at = values_.data() + size_t{numbers_[index]} * kFieldBrickSamples + place_in_brick(i, j, k);
            return {at[0], at[1], at[8], at[9], at[64], at[65], at[72], at[73]};
        }
        const size_t next[3] = {size_t(i & 7) / 7, size_t(j & 7) / 7 * size_t(bricks_[0]), size_t(k & 7) / 7 * size_t(bricks_[0]) * size_t(bricks_[1])};
        std::array<float, 8> values;
        for (int n = 0; n < 8; ++n) {
            const size_t brick = index + (n & 1 ? next[0] : 0) + (n & 2 ? next[1] : 0) + (n & 4 ? next[2] : 0);
            const uint32_t number = numbers_[brick];
            values[size_t(n)] = number == kNone ? absent_[brick]
                                                : values_[size_t{number} * kFieldBrickSamples + place_in_brick(i + (n & 1), j + (n >> 1 & 1), k + (n >> 2))];
        }
        return values;
    }
    /// side^3 samples from one on, i fastest, then j. NaN as sample() has it.
    template <int side>
    std::array<float, size_t(side) * side * side> cube(const std::array<int32_t, 3>& first) const;

    /// The samples of a brick's cells, 9^3: its own and the first of the bricks above.
    /// row  floats from one row along i to the next; planes are 9 of them
    void copy_with_rim(const std::array<int32_t, 3>& brick, size_t row, std::span<float> out) const;

    /// Values of the samples of the cells in a brick.
    const FieldRange& range_of(int32_t bi, int32_t bj, int32_t bk) const { return ranges_[brick_index(bi, bj, bk)]; }

private:
    static constexpr uint32_t kNone = ~uint32_t{0};

    size_t brick_index(int32_t bi, int32_t bj, int32_t bk) const {
        return (size_t(bk) * size_t(bricks_[1]) + size_t(bj)) * size_t(bricks_[0]) + size_t(bi);
    }
    static size_t place_in_brick(int32_t i, int32_t j, int32_t k) { return size_t((k & 7) << 6 | (j & 7) << 3 | (i & 7)); }
    // Of all of a brick.
    struct BrickSamples {
        const float* stored;  // null: they are all one value
        float value;
    };
    BrickSamples brick_at(int32_t bi, int32_t bj, int32_t bk) const {
        if (uint32_t(bi) >= uint32_t(bricks_[0]) || uint32_t(bj) >= uint32_t(bricks_[1]) || uint32_t(bk) >= uint32_t(bricks_[2]))
            return {nullptr, std::numeric_limits<float>::quiet_NaN()};
        const size_t index = brick_index(bi, bj, bk);
        const uint32_t number = numbers_[index];
        if (number == kNone) return {nullptr, absent_[index]};
        return {values_.data() + size_t{number} * kFieldBrickSamples, 0.0f};
    }
    void find_ranges(int threads);
    void allow(uint64_t bricks, uint64_t stored, uint64_t memory_bytes) const;

    GridPlacement placement_;
    std::array<int32_t, 3> bricks_ = {0, 0, 0};
    std::vector<uint32_t> numbers_;          // [bricks] of the stored brick there
    std::vector<float> values_;              // [stored bricks * 512] i fastest, then j
    std::vector<float> absent_;              // [bricks] of a sparse field: the value of those that are not stored
    std::vector<FieldRange> ranges_;         // [bricks]
    FieldRange range_;
    Box3d bounds_;
};

template <int side>
std::array<float, size_t(side) * side * side> FieldBricks::cube(const std::array<int32_t, 3>& first) const {
    static_assert(side <= 8);
    // At most two bricks an axis.
    std::array<BrickSamples, 8> bricks;
    std::array<int32_t, 3> least, crossed;  // of the bricks; whether there are two
    for (size_t axis = 0; axis < 3; ++axis) {
        least[axis] = first[axis] >> 3;
        crossed[axis] = ((first[axis] + side - 1) >> 3) - least[axis];
    }
    for (int32_t z = 0; z <= crossed[2]; ++z)
        for (int32_t y = 0; y <= crossed[1]; ++y)
            for (int32_t x = 0; x <= crossed[0]; ++x) bricks[size_t(z << 2 | y << 1 | x)] = brick_at(least[0] + x, least[1] + y, least[2] + z);
    std::array<float, size_t(side) * side * side> out;
    float* to = out.data();
    for (int32_t k = first[2]; k < first[2] + side; ++k)
        for (int32_t j = first[1]; j < first[1] + side; ++j) {
            const size_t row = size_t(((k >> 3) - least[2]) << 2 | ((j >> 3) - least[1]) << 1);
            for (int32_t i = first[0]; i < first[0] + side; ++i) {
                const BrickSamples& brick = bricks[row | size_t((i >> 3) - least[0])];
                *to++ = brick.stored == nullptr ? brick.value : brick.stored[place_in_brick(i, j, k)];
            }
        }
    return out;
}

}  // namespace strata
