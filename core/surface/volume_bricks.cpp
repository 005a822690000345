#include "core/surface/volume_bricks.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace strata {
namespace {

constexpr int kSide = kCubeBrickSide;
constexpr size_t kColumns = size_t(kSide) * kSide, kCells = kColumns * kSide;
constexpr uint64_t kFull = ~uint64_t{0};

// Of a column (x, y) and of a cell, within a brick.
constexpr size_t column_at(int x, int y) { return size_t(y * kSide + x); }
constexpr size_t cell_at(int x, int y, int z) { return column_at(x, y) * kSide + size_t(z); }

}  // namespace

struct VolumeBricks::Brick {
    std::array<uint32_t, 3> place;
    bool is_full = false;   // all cells are occupied: there are no bits
    uint32_t number = 0;    // of the label that all have, where there are no numbers
    uint8_t number_bytes = 0;  // of each cell's number; 0: there are none
    std::unique_ptr<std::byte[]> bytes;  // bits, then numbers; null: at `offset` of the scratch store
    uint64_t offset = 0;

    size_t size_bytes() const { return (is_full ? 0 : kColumns * sizeof(uint64_t)) + kCells * number_bytes; }
};

// A brick's bytes, here or read back.
struct VolumeBricks::Data {
    const Brick* brick = nullptr;
    std::unique_ptr<std::byte[]> read;
    const std::byte* bytes = nullptr;

    uint64_t column(int x, int y) const {
        if (brick->is_full) return kFull;
        uint64_t bits;
        std::memcpy(&bits, bytes + column_at(x, y) * sizeof bits, sizeof bits);
        return bits;
    }
    uint32_t number(int x, int y, int z) const {
        if (brick->number_bytes == 0) return brick->number;
        const std::byte* const numbers = bytes + (brick->is_full ? 0 : kColumns * sizeof(uint64_t));
        if (brick->number_bytes == 1) return uint32_t(numbers[cell_at(x, y, z)]);
        uint32_t number;
        std::memcpy(&number, numbers + cell_at(x, y, z) * sizeof number, sizeof number);
        return number;
    }
};

// Bricks of 64 slices while these come.
struct VolumeBricks::Layer {
    std::vector<uint64_t> bits;     // [bricks][columns]
    std::vector<uint32_t> numbers;  // [bricks][cells], with labels
};

VolumeBricks::~VolumeBricks() = default;

VolumeBricks::VolumeBricks(SliceSource& source, const VolumeBricksSettings& settings) : settings_(settings), placement_(source.placement()), size_(source.size()) {
    placement_.origin = placement_.world_from_index(Vec3d::Constant(-0.5));
    for (size_t axis = 0; axis < 3; ++axis) bricks_an_axis_[axis] = uint32_t((uint64_t{size_[axis]} + kSide - 1) / kSide);
    const uint64_t slice = uint64_t{size_[0]} * size_[1], layer_bricks = uint64_t{bricks_an_axis_[0]} * bricks_an_axis_[1];
    if (slice == 0 || size_[2] == 0) return;
    constexpr uint64_t kMostInSlice = uint64_t{1} << 40, kMostBricks = 0xFFFFFFFF;
    if (slice > kMostInSlice || layer_bricks > kMostBricks / bricks_an_axis_[2])
        fail(ErrorKind::limit, std::to_string(size_[0]) + " x " + std::to_string(size_[1]) + " x " + std::to_string(size_[2]) +
                                   " samples: cubes are made of at most 2^40 a slice, and of 2^32 - 1 bricks of 64^3");
    const uint64_t bricks = layer_bricks * bricks_an_axis_[2];
    hold(bricks * sizeof(uint32_t) + slice * sizeof(float) + layer_bricks * (kColumns * sizeof(uint64_t) + (settings.color_of ? kCells * sizeof(uint32_t) : 0)));
    index_.resize(size_t(bricks));
    std::vector<float> values(static_cast<size_t>(slice));
    Layer layer;
    layer.bits.resize(size_t(layer_bricks * kColumns));
    if (settings.color_of) layer.numbers.resize(size_t(layer_bricks * kCells));
    for (uint32_t k = 0; k < size_[2]; ++k) {
        source.read(1, settings.color_of ? 0.0 : settings.isovalue, values);
        if (settings.color_of) read_labels(values, k, layer);
        else read_slice(values, k, layer);
        if (k % kSide == kSide - 1 || k + 1 == size_[2]) finish_layer(layer, k / kSide);
    }
    held_bytes_ -= slice * sizeof(float) + layer.bits.size() * sizeof(uint64_t) + layer.numbers.size() * sizeof(uint32_t);
}

void VolumeBricks::hold(uint64_t bytes) {
    held_bytes_ += bytes;
    if (held_bytes_ > settings_.memory_bytes)
        fail(ErrorKind::limit, "cells of the volume need " + std::to_string(held_bytes_ * settings_.memory_parts) + " bytes of memory or more, " + std::to_string(settings_.memory_bytes * settings_.memory_parts) + " are allowed; " + std::string(advice()));
}

void VolumeBricks::fail(ErrorKind kind, const std::string& message) const {
    const Error error(kind, message);
    throw settings_.place.empty() ? error : error.within(settings_.place);
}

void VolumeBricks::read_slice(std::span<const float> values, uint32_t k, Layer& layer) {
    const float* at = values.data();
    const float sign = settings_.inside == ContourInside::above ? 1.0f : -1.0f;
    const int z = int(k % kSide);
    for (uint32_t j = 0; j < size_[1]; ++j)
        for (uint32_t i = 0; i < size_[0]; i += kSide) {
            const size_t brick = size_t{j / kSide} * bricks_an_axis_[0] + i / kSide;
            uint64_t* const columns = layer.bits.data() + brick * kColumns + column_at(0, int(j % kSide));
            const uint32_t count = std::min<uint32_t>(kSide, size_[0] - i);
            for (uint32_t x = 0; x < count; ++x, ++at) {
                columns[x] |= uint64_t{sign * *at >= 0.0f} << z;
                nan_samples_ += *at != *at;
            }
        }
}

void VolumeBricks::read_labels(std::span<const float> values, uint32_t k, Layer& layer) {
    const float* at = values.data();
    const int z = int(k % kSide);
    for (uint32_t j = 0; j < size_[1]; ++j)
        for (uint32_t i = 0; i < size_[0]; ++i, ++at) {
            if (*at == 0.0f) continue;
            if (*at != *at) {
                ++nan_samples_;
                continue;
            }
            const size_t brick = size_t{j / kSide} * bricks_an_axis_[0] + i / kSide;
            const int x = int(i % kSide), y = int(j % kSide);
            const uint32_t number = label_number(*at, i, j, k);
            layer.bits[brick * kColumns + column_at(x, y)] |= uint64_t{1} << z;
            layer.numbers[brick * kCells + cell_at(x, y, z)] = number;
            ++labels_[number].cells;
        }
}

uint32_t VolumeBricks::label_number(float value, uint32_t i, uint32_t j, uint32_t k) {
    if (value == last_value_) return last_number_;
    if (!(std::abs(value) < 0x1p24f) || value != std::floor(value)) {
        char number[32];
        std::snprintf(number, sizeof number, "%.9g", double(value));
        fail(ErrorKind::malformed, "sample (" + std::to_string(i) + ", " + std::to_string(j) + ", " + std::to_string(k) + "): a label is expected, a whole number of less than 2^24, it is " + number);
    }
    const auto [found, is_new] = label_numbers_.try_emplace(int32_t(value), uint32_t(labels_.size()));
    if (is_new) {
        if (labels_.size() == kMostLabels)
            fail(ErrorKind::limit, "sample (" + std::to_string(i) + ", " + std::to_string(j) + ", " + std::to_string(k) + "): one more label than the " + std::to_string(kMostLabels) + " that there may be");
        hold(2 * sizeof(VolumeLabel) + 48 + settings_.label_bytes);  // half of the vector may be empty; a node of the map
        labels_.push_back({.value = int32_t(value), .color = settings_.color_of(int32_t(value))});
    }
    last_value_ = value;
    return last_number_ = found->second;
}

void VolumeBricks::finish_layer(Layer& layer, uint32_t place) {
    for (uint32_t j = 0; j < bricks_an_axis_[1]; ++j)
        for (uint32_t i = 0; i < bricks_an_axis_[0]; ++i) {
            const size_t number = size_t{j} * bricks_an_axis_[0] + i;
            const std::span<uint64_t> bits = std::span(layer.bits).subspan(number * kColumns, kColumns);
            uint64_t count = 0;
            for (const uint64_t column : bits) count += uint64_t(std::popcount(column));
            if (count == 0) continue;
            cells_ += count;
            std::span<uint32_t> numbers;
            if (!layer.numbers.empty()) numbers = std::span(layer.numbers).subspan(number * kCells, kCells);
            Brick brick = {.place = {i, j, place}, .is_full = count == kCells};
            keep(brick, bits, numbers);
            bricks_.push_back(std::move(brick));
            index_[size_t{place} * bricks_an_axis_[0] * bricks_an_axis_[1] + number] = uint32_t(bricks_.size());
            std::fill(bits.begin(), bits.end(), 0);
        }
}

void VolumeBricks::keep(Brick& brick, std::span<const uint64_t> bits, std::span<const uint32_t> numbers) {
    if (!numbers.empty()) {
        uint32_t least = std::numeric_limits<uint32_t>::max(), greatest = 0;
        for (size_t column = 0; column < kColumns; ++column)
            for (uint64_t left = bits[column]; left != 0; left &= left - 1) {
                const uint32_t number = numbers[column * kSide + size_t(std::countr_zero(left))];
                least = std::min(least, number);
                greatest = std::max(greatest, number);
            }
        brick.number = least;
        if (least != greatest) brick.number_bytes = greatest < 256 ? 1 : 4;
    }
    const size_t size = brick.size_bytes();
    hold(sizeof brick);
    if (size == 0) return;
    auto bytes = std::make_unique<std::byte[]>(size);
    const size_t bit_bytes = brick.is_full ? 0 : bits.size_bytes();
    std::memcpy(bytes.get(), bits.data(), bit_bytes);
    if (brick.number_bytes == 4) std::memcpy(bytes.get() + bit_bytes, numbers.data(), numbers.size_bytes());
    if (brick.number_bytes == 1)
        for (size_t cell = 0; cell < kCells; ++cell) bytes[bit_bytes + cell] = std::byte(numbers[cell]);  // of cells that are not occupied it does not matter
    if (settings_.scratch && held_bytes_ + size > settings_.memory_bytes) {
        settings_.scratch->write(scratch_bytes_, {bytes.get(), size});
        brick.offset = scratch_bytes_;
        scratch_bytes_ += size;
        return;
    }
    hold(size);
    brick.bytes = std::move(bytes);
}

VolumeBricks::Data VolumeBricks::load(size_t brick) const {
    Data data = {.brick = &bricks_[brick]};
    data.bytes = data.brick->bytes.get();
    const size_t size = data.brick->size_bytes();
    if (data.bytes || size == 0) return data;
    data.read = std::make_unique<std::byte[]>(size);
    settings_.scratch->read(data.brick->offset, {data.read.get(), size});
    data.bytes = data.read.get();
    return data;
}

size_t VolumeBricks::size() const { return bricks_.size(); }

std::array<uint32_t, 3> VolumeBricks::place(size_t brick) const { return bricks_[brick].place; }

size_t VolumeBricks::find(const std::array<int64_t, 3>& place) const {
    for (size_t axis = 0; axis < 3; ++axis)
        if (place[axis] < 0 || place[axis] >= int64_t{bricks_an_axis_[axis]}) return kNone;
    const uint32_t found = index_[(size_t(place[2]) * bricks_an_axis_[1] + size_t(place[1])) * bricks_an_axis_[0] + size_t(place[0])];
    return found == 0 ? kNone : found - 1;
}

bool VolumeBricks::gather(size_t brick, const CubeMaterials& materials, CubeBrick& out) const {
    const bool see_through = materials.by_color && !materials.transparent.empty();
    const std::array<uint32_t, 3> at = place(brick);
    std::array<size_t, 6> around;
    bool all_full = bricks_[brick].is_full && !see_through;
    for (size_t direction = 0; direction < 6; ++direction) {
        std::array<int64_t, 3> neighbor = {at[0], at[1], at[2]};
        neighbor[direction / 2] += direction % 2 == 0 ? 1 : -1;
        around[direction] = find(neighbor);
        all_full = all_full && around[direction] != kNone && bricks_[around[direction]].is_full;
    }
    if (all_full) return false;
    out.below.fill(0);
    out.above.fill(0);
    out.any_transparent = false;
    out.one_material = !materials.by_color;
    if (materials.by_color) out.allocate_materials();
    if (see_through) {
        out.transparent.fill(0);
        out.transparent_below.fill(0);
        out.transparent_above.fill(0);
    }
    const auto is_transparent = [&](const VoxelColor& color) { return std::find(materials.transparent.begin(), materials.transparent.end(), color) != materials.transparent.end(); };
    // An occupied cell of a brick, and where it lies from here.
    const auto add_material = [&](const Data& from, int x, int y, int z, int cx, int cy, int cz) {
        const VoxelColor& color = labels_[from.number(x, y, z)].color;
        out.materials[CubeBrick::cell(cx, cy, cz)] = material_of(color);
        if (!see_through || !is_transparent(color)) return;
        out.any_transparent = true;
        if (cz < 0) out.transparent_below[size_t(cx)] |= uint64_t{1} << cy;
        else if (cz == kSide) out.transparent_above[size_t(cx)] |= uint64_t{1} << cy;
        else out.transparent[CubeBrick::column(cx, cy)] |= uint64_t{1} << cz;
    };
    const auto add_column = [&](const Data& from, int x, int y, int cx, int cy, bool with_materials) {
        const uint64_t bits = from.column(x, y);
        out.occupied[CubeBrick::column(cx, cy)] = bits;
        if (!with_materials) return;
        for (uint64_t left = bits; left != 0; left &= left - 1) add_material(from, x, y, std::countr_zero(left), cx, cy, std::countr_zero(left));
    };
    out.occupied.fill(0);
    const Data own = load(brick);
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) add_column(own, x, y, x, y, materials.by_color);
    for (size_t direction = 0; direction < 6; ++direction) {
        if (around[direction] == kNone) continue;
        const Data from = load(around[direction]);
        const bool plus = direction % 2 == 0;
        const int beyond = plus ? kSide : -1, there = plus ? 0 : kSide - 1;
        for (int v = 0; v < kSide; ++v) {
            if (direction < 2) add_column(from, there, v, beyond, v, see_through);
            else if (direction < 4) add_column(from, v, there, v, beyond, see_through);
            else
                for (int x = 0; x < kSide; ++x) {
                    if ((from.column(x, v) >> there & 1) == 0) continue;
                    (plus ? out.above : out.below)[size_t(x)] |= uint64_t{1} << v;
                    if (see_through) add_material(from, x, v, there, x, v, beyond);
                }
        }
    }
    return true;
}

}  // namespace strata
