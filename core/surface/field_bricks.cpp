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
    const uint64_t needed = bricks * (sizeof(uint32_t) + sizeof(float) + sizeof(FieldRange)) + stored * kFieldBrickSamples * sizeof(float);
    if (needed > memory_bytes)
        throw Error(ErrorKind::limit,
                    "the field needs " + std::to_string(needed) + " bytes of memory, " + std::to_string(memory_bytes) + " are allowed");
}

uint64_t FieldBricks::size_bytes() const {
    return numbers_.size() * sizeof(uint32_t) + (values_.size() + absent_.size()) * sizeof(float) +
           ranges_.size() * sizeof(FieldRange);
}

void FieldBricks::copy_with_rim(const std::array<int32_t, 3>& brick, size_t row, std::span<float> out) const {
    std::array<BrickSamples, 8> bricks;  // 1 for the upper i, 2 for j, 4 for k
    for (int32_t n = 0; n < 8; ++n) bricks[size_t(n)] = brick_at(brick[0] + (n & 1), brick[1] + (n >> 1 & 1), brick[2] + (n >> 2));
    float* to = out.data();
    for (size_t z = 0; z < 9; ++z)
        for (size_t y = 0; y < 9; ++y, to += row) {
            const size_t place = (z & 7) << 6 | (y & 7) << 3;
            const BrickSamples &own = bricks[z >> 3 << 2 | y >> 3 << 1], &next = bricks[z >> 3 << 2 | y >> 3 << 1 | 1];
            if (own.stored != nullptr) std::copy_n(own.stored + place, 8, to);
            else std::fill_n(to, 8, own.value);
            to[8] = next.stored != nullptr ? next.stored[place] : next.value;
        }
}

void FieldBricks::find_ranges(int threads) {
    ranges_.assign(numbers_.size(), {});
    const auto find_range = [&](const std::array<int32_t, 3>& brick) {
        FieldRange& range = ranges_[brick_index(brick[0], brick[1], brick[2])];
        bool stored = false;
        for (int32_t n = 0; n < 8; ++n) {
            const BrickSamples part = brick_at(brick[0] + (n & 1), brick[1] + (n >> 1 & 1), brick[2] + (n >> 2));
            stored |= part.stored != nullptr;
            if (part.stored == nullptr) range.add(part.value);
        }
        if (!stored) return;
        range = {};
        std::array<float, 729> samples;
        copy_with_rim(brick, 9, samples);
        // Nine side by side.
        std::array<float, 9> least, greatest;
        least.fill(range.least);
        greatest.fill(range.greatest);
        for (const float* row = samples.data(); row < samples.data() + samples.size(); row += 9)
            for (size_t x = 0; x < 9; ++x) {
                least[x] = row[x] < least[x] ? row[x] : least[x];
                greatest[x] = row[x] > greatest[x] ? row[x] : greatest[x];
            }
        for (size_t x = 0; x < 9; ++x) range.add(FieldRange{least[x], greatest[x]});
    };
    parallel_blocks(threads, size_t(bricks_[1]) * size_t(bricks_[2]), 1, [&](size_t begin, size_t end) {
        for (size_t row = begin; row < end; ++row)
            for (int32_t i = 0; i < bricks_[0]; ++i) find_range({i, int32_t(row % size_t(bricks_[1])), int32_t(row / size_t(bricks_[1]))});
    });
    for (const FieldRange& range : ranges_) range_.add(range);
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
