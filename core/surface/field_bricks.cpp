#include "core/surface/field_bricks.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/parallel.h"

namespace strata {
namespace {

Box3d box_of_samples(const GridPlacement& placement, const Vec3d& least, const Vec3d& greatest) {
    Box3d box;
    for (int corner = 0; corner < 8; ++corner)
        box.extend(placement.world_from_index(
            {(corner & 1 ? greatest : least).x(), (corner & 2 ? greatest : least).y(), (corner & 4 ? greatest : least).z()}));
    return box;
}

}  // namespace

void FieldBricks::allow(uint64_t bricks, uint64_t stored, uint64_t memory_bytes) const {
    const uint64_t needed = bricks * (sizeof(uint32_t) + sizeof(float) + sizeof(FieldRange)) +
                            stored * (kFieldBrickSamples * sizeof(float) + 8 * sizeof(FieldRange));
    if (needed > memory_bytes)
        throw Error(ErrorKind::limit,
                    "the field needs " + std::to_string(needed) + " bytes of memory, " + std::to_string(memory_bytes) + " are allowed");
}

uint64_t FieldBricks::size_bytes() const {
    return numbers_.size() * sizeof(uint32_t) + (values_.size() + absent_.size()) * sizeof(float) +
           (octant_ranges_.size() + ranges_.size() + wide_ranges_.size()) * sizeof(FieldRange);
}

std::array<float, 8> FieldBricks::corners(const std::array<int32_t, 3>& cell) const {
    const auto [i, j, k] = cell;
    if ((i & 7) < 7 && (j & 7) < 7 && (k & 7) < 7) {
        const uint32_t number = numbers_[brick_index(i >> 3, j >> 3, k >> 3)];
        if (number != kNone) {
            const float* const at = values_.data() + size_t{number} * kFieldBrickSamples + ((k & 7) << 6 | (j & 7) << 3 | (i & 7));
            return {at[0], at[1], at[8], at[9], at[64], at[65], at[72], at[73]};
        }
    }
    std::array<float, 8> values;
    for (int corner = 0; corner < 8; ++corner) values[size_t(corner)] = sample(i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2));
    return values;
}

// The samples of a brick's cells: its own and the first of the bricks above.
void FieldBricks::copy_with_rim(int32_t bi, int32_t bj, int32_t bk, std::span<float, 729> out) const {
    const float* const own = values_.data() + size_t{numbers_[brick_index(bi, bj, bk)]} * kFieldBrickSamples;
    float* to = out.data();
    for (int z = 0; z < 9; ++z)
        for (int y = 0; y < 9; ++y, to += 9) {
            const int copied = z < 8 && y < 8 ? 8 : 0;
            if (copied > 0) std::copy_n(own + (z << 6 | y << 3), 8, to);
            for (int x = copied; x < 9; ++x) to[x] = sample(8 * bi + x, 8 * bj + y, 8 * bk + z);
        }
}

void FieldBricks::find_ranges(int threads) {
    ranges_.assign(numbers_.size(), {});
    octant_ranges_.assign(values_.size() / kFieldBrickSamples * 8, {});
    const auto find_range = [&](int32_t i, int32_t j, int32_t k) {
        FieldRange& range = ranges_[brick_index(i, j, k)];
        const uint32_t number = numbers_[brick_index(i, j, k)];
        if (number == kNone) {
            // Its own value, and the first samples of the bricks above.
            range.add(sample(8 * i, 8 * j, 8 * k));
            for (int z = 0; z < 9; ++z)
                for (int y = 0; y < 9; ++y)
                    for (int x = z == 8 || y == 8 ? 0 : 8; x < 9; ++x) range.add(sample(8 * i + x, 8 * j + y, 8 * k + z));
            return;
        }
        std::array<float, 729> samples;
        copy_with_rim(i, j, k, samples);
        for (int octant = 0; octant < 8; ++octant) {
            FieldRange& of_octant = octant_ranges_[8 * size_t{number} + size_t(octant)];
            const float* const first = samples.data() + 4 * (octant & 1) + 36 * (octant >> 1 & 1) + 324 * (octant >> 2);
            for (int z = 0; z < 5; ++z)
                for (int y = 0; y < 5; ++y)
                    for (int x = 0; x < 5; ++x) of_octant.add(first[81 * z + 9 * y + x]);
            range.add(of_octant);
        }
    };
    parallel_blocks(threads, size_t(bricks_[1]) * size_t(bricks_[2]), 1, [&](size_t begin, size_t end) {
        for (size_t row = begin; row < end; ++row)
            for (int32_t i = 0; i < bricks_[0]; ++i) find_range(i, int32_t(row % size_t(bricks_[1])), int32_t(row / size_t(bricks_[1])));
    });
    wide_ranges_.assign(size_t(wide(0)) * size_t(wide(1)) * size_t(wide(2)), {});
    for (int32_t k = 0; k < bricks_[2]; ++k)
        for (int32_t j = 0; j < bricks_[1]; ++j)
            for (int32_t i = 0; i < bricks_[0]; ++i) {
                const FieldRange& range = ranges_[brick_index(i, j, k)];
                wide_ranges_[(size_t(k / 8) * size_t(wide(1)) + size_t(j / 8)) * size_t(wide(0)) + size_t(i / 8)].add(range);
                range_.add(range);
            }
}

FieldBricks FieldBricks::of_slices(SliceSource& source, uint64_t memory_bytes, int threads) {
    FieldBricks field;
    field.placement_ = source.placement();
    const std::array<uint32_t, 3> size = source.size();
    if (size[0] == 0 || size[1] == 0 || size[2] == 0) return field;
    uint64_t bricks = 1;
    for (size_t axis = 0; axis < 3; ++axis) {
        if (size[axis] > 1u << 18) throw Error(ErrorKind::limit, "at most 2^18 samples an axis can be drawn");
        field.bricks_[axis] = int32_t((size[axis] + 7) / 8);
        bricks *= uint64_t(field.bricks_[axis]);
    }
    const uint64_t slab = uint64_t{size[0]} * size[1];
    field.allow(bricks, bricks + slab / 64 + 1, memory_bytes);  // and the slices that are read at a time
    field.numbers_.resize(bricks);
    for (size_t i = 0; i < bricks; ++i) field.numbers_[i] = uint32_t(i);
    field.values_.assign(bricks * kFieldBrickSamples, std::numeric_limits<float>::quiet_NaN());
    std::vector<float> slices;
    for (uint32_t k = 0; k < size[2]; k += 8) {
        const uint32_t count = std::min(8u, size[2] - k);
        slices.resize(slab * count);
        source.read(count, 0.0, slices);
        const float* row = slices.data();
        for (uint32_t z = 0; z < count; ++z)
            for (uint32_t j = 0; j < size[1]; ++j, row += size[0]) {
                const size_t first_brick = field.brick_index(0, int32_t(j / 8), int32_t(k / 8));
                for (uint32_t i = 0; i < size[0]; i += 8)
                    std::copy_n(row + i, std::min(8u, size[0] - i),
                                field.values_.data() + (first_brick + i / 8) * kFieldBrickSamples + (z << 6 | (j & 7) << 3));
            }
    }
    field.bounds_ = box_of_samples(field.placement_, Vec3d::Zero(), Vec3d(size[0] - 1.0, size[1] - 1.0, size[2] - 1.0));
    field.find_ranges(threads);
    return field;
}

FieldBricks FieldBricks::of_bricks(FieldBrickSource& source, uint64_t memory_bytes, int threads) {
    FieldBricks field;
    field.placement_ = source.placement();
    std::vector<std::array<int32_t, 3>> corners;
    std::array<int32_t, 3> least{}, greatest{};
    FieldBrickLayer layer;
    while (source.next_layer(layer)) {
        for (const auto& [i, j] : layer.corners) {
            const std::array<int32_t, 3> corner = {i, j, layer.k};
            for (const int32_t place : corner)
                if (std::abs(int64_t{place}) > 1 << 30)
                    throw Error(ErrorKind::limit, "bricks of the field lie more than 2^30 samples from its origin");
            for (size_t axis = 0; axis < 3; ++axis) {
                least[axis] = corners.empty() ? corner[axis] : std::min(least[axis], corner[axis]);
                greatest[axis] = corners.empty() ? corner[axis] : std::max(greatest[axis], corner[axis]);
            }
            corners.push_back(corner);
        }
        field.allow(0, 3 * corners.size(), memory_bytes);  // while they grow: what they were, and twice that
        field.values_.insert(field.values_.end(), layer.values.begin(), layer.values.end());
    }
    if (corners.empty()) return field;
    // A brick more on each side: cells between a brick and what is constant beside it.
    uint64_t bricks = 1;
    Vec3d first, last;
    for (size_t axis = 0; axis < 3; ++axis) {
        const int64_t count = (int64_t{greatest[axis]} - least[axis]) / 8 + 3;
        if (count > 1 << 15) throw Error(ErrorKind::limit, "at most 2^18 samples an axis can be drawn");
        field.bricks_[axis] = int32_t(count);
        bricks *= uint64_t(count);
        first[int(axis)] = double(least[axis]) - 8.0;
        last[int(axis)] = double(greatest[axis]) + 7.0;
    }
    field.allow(bricks, corners.size(), memory_bytes);
    field.bounds_ = box_of_samples(field.placement_, first + Vec3d::Constant(8.0), last);
    field.placement_.origin = field.placement_.world_from_index(first);
    field.numbers_.assign(bricks, kNone);
    field.absent_.assign(bricks, std::numeric_limits<float>::quiet_NaN());
    const auto place = [&](size_t number, size_t axis) { return (corners[number][axis] - least[axis]) / 8 + 1; };
    for (size_t number = 0; number < corners.size(); ++number)
        field.numbers_[field.brick_index(place(number, 0), place(number, 1), place(number, 2))] = uint32_t(number);
    for (size_t number = 0; number < corners.size(); ++number)
        for (int32_t n = 0; n < 27; ++n) {
            const std::array<int32_t, 3> away = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
            const size_t index = field.brick_index(place(number, 0) + away[0], place(number, 1) + away[1], place(number, 2) + away[2]);
            if (field.numbers_[index] != kNone || !std::isnan(field.absent_[index])) continue;
            field.absent_[index] =
                source.absent_value({corners[number][0] + 8 * away[0], corners[number][1] + 8 * away[1], corners[number][2] + 8 * away[2]});
        }
    field.find_ranges(threads);
    return field;
}

}  // namespace strata
