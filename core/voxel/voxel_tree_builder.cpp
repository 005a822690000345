#include "core/voxel/voxel_tree_builder.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace strata {
namespace {

constexpr size_t kKinds = 6;
constexpr size_t kPlaces = 2 * kMostVoxelLevels + 1;
constexpr size_t kBufferBytes = 3 << 14;  // whole elements of 1, 3, 4 and 8 bytes

VoxelColor mean_color(const std::array<uint64_t, 3>& sums, uint64_t weight) {
    VoxelColor color = {};
    for (size_t c = 0; c < 3 && weight > 0; ++c) color[c] = uint8_t((sums[c] + weight / 2) / weight);
    return color;
}

VoxelNormal mean_normal(const std::array<int64_t, 3>& sums) {
    const Vec3d sum = {double(sums[0]), double(sums[1]), double(sums[2])};
    const double length = sum.norm();
    VoxelNormal normal = {};
    for (size_t c = 0; c < 3 && length > 0.0; ++c) normal[c] = int8_t(std::lround(sum[int(c)] * (127.0 / length)));
    return normal;
}

}  // namespace

size_t element_size(VoxelStream::Kind kind) {
    using enum VoxelStream::Kind;
    switch (kind) {
        case mask:
        case full: return sizeof(uint64_t);
        case count: return sizeof(uint32_t);
        case color: return sizeof(VoxelColor);
        case normal: return sizeof(VoxelNormal);
        case opacity: return 3;
    }
    return 0;
}

VoxelTreeBuilder::VoxelTreeBuilder(const VoxelFrame& frame, const VoxelAttributes& attributes, VoxelTreeSink& out)
    : frame_(frame), attributes_(attributes), out_(out), open_(size_t(frame.levels)), full_begun_(size_t(frame.levels)),
      buffers_(kKinds * kPlaces) {
    counts_.nodes.resize(size_t(frame.levels));
    counts_.cells.resize(size_t(frame.depth()) + 1);
}

template <typename T>
void VoxelTreeBuilder::append(VoxelStream::Kind kind, size_t place, const T& element) {
    std::vector<std::byte>& buffer = buffers_[size_t(kind) * kPlaces + place];
    const auto* const bytes = reinterpret_cast<const std::byte*>(&element);
    buffer.insert(buffer.end(), bytes, bytes + sizeof element);
    if (buffer.size() < kBufferBytes) return;
    out_.append({kind, uint8_t(place)}, buffer);
    buffer.clear();
}

void VoxelTreeBuilder::append_node(size_t level, uint64_t mask, uint64_t full) {
    append(VoxelStream::Kind::mask, level, mask);
    uint64_t& nodes = counts_.nodes[level];
    if (full != 0 && !full_begun_[level]) {
        // Most trees have no full cells: their masks begin with the first.
        full_begun_[level] = true;
        for (uint64_t before = 0; before < nodes; ++before) append(VoxelStream::Kind::full, level, uint64_t{0});
    }
    if (full_begun_[level]) append(VoxelStream::Kind::full, level, full);
    ++nodes;
    counts_.cells[2 * level + 2] += uint64_t(std::popcount(mask));
    counts_.cells[2 * level + 1] += uint64_t(std::popcount(bytes_present(mask)));
}

void VoxelTreeBuilder::append_cell(size_t depth, const Sums& cell) {
    if (attributes_.count) append(VoxelStream::Kind::count, depth, uint32_t(std::min<uint64_t>(cell.count, std::numeric_limits<uint32_t>::max())));
    if (attributes_.color) append(VoxelStream::Kind::color, depth, mean_color(cell.color, cell.weight));
    if (attributes_.normal) append(VoxelStream::Kind::normal, depth, mean_normal(cell.normal));
    if (!attributes_.opacity) return;
    std::array<uint8_t, 3> opacity;
    for (size_t axis = 0; axis < 3; ++axis) opacity[axis] = uint8_t(std::lround(255.0 * cell.opacity[axis]));
    append(VoxelStream::Kind::opacity, depth, opacity);
}

VoxelTreeBuilder::Sums VoxelTreeBuilder::parent_of(const Sums* children, uint32_t present, bool voxels) const {
    Sums parent;
    if (attributes_.any_of_voxels())
        for (uint32_t left = present; left != 0; left &= left - 1) {
            const Sums& child = children[std::countr_zero(left)];
            parent.weight += child.weight;
            parent.count += child.count;
            for (size_t c = 0; c < 3; ++c) parent.color[c] += child.color[c];
            for (size_t c = 0; c < 3; ++c) parent.normal[c] += child.normal[c];
        }
    if (!attributes_.opacity) return parent;
    for (size_t axis = 0; axis < 3; ++axis) {
        const uint32_t step = 4u >> axis;  // octant digits are 4 x + 2 y + z
        for (uint32_t near = 0; near < 8; ++near) {
            if ((near & step) != 0) continue;
            const auto opacity = [&](uint32_t octant) {
                if ((present >> octant & 1) == 0) return 0.0;
                return voxels ? 1.0 : children[octant].opacity[axis];
            };
            parent.opacity[axis] += 0.25 * (1.0 - (1.0 - opacity(near)) * (1.0 - opacity(near | step)));
        }
    }
    return parent;
}

// Stores what is known of a node's cells, and gives what is known of all of them.
VoxelTreeBuilder::Sums VoxelTreeBuilder::finish_cells(size_t level, uint64_t mask, const std::array<Sums, 64>& cells) {
    const bool voxels = level + 1 == open_.size();
    std::array<Sums, 8> octants;
    for (uint32_t left = bytes_present(mask); left != 0; left &= left - 1) {
        const int octant = std::countr_zero(left);
        octants[size_t(octant)] = parent_of(&cells[size_t(8 * octant)], uint32_t(mask >> 8 * octant & 0xff), voxels);
        append_cell(2 * level + 1, octants[size_t(octant)]);
    }
    for (uint64_t left = voxels ? 0 : mask; left != 0; left &= left - 1)
        append_cell(2 * level + 2, cells[size_t(std::countr_zero(left))]);
    return parent_of(octants.data(), bytes_present(mask), false);
}

// The open node of a level that has this code; those of this level and of the levels below that lie before it are finished.
VoxelTreeBuilder::OpenNode& VoxelTreeBuilder::open(size_t level, uint64_t code) {
    // Ancestors first: they finish what is below them.
    if (level > 0) open(level - 1, code >> 6);
    OpenNode& node = open_[level];
    if (node.active && node.code != code) close(level);
    node.active = true;
    node.code = code;
    return node;
}

void VoxelTreeBuilder::close(size_t level) {
    OpenNode& node = open_[level];
    if (!std::exchange(node.active, false)) return;
    if (level + 1 < open_.size()) close(level + 1);
    const uint64_t mask = std::exchange(node.mask, 0), full = std::exchange(node.full, 0);
    const bool whole = full == kFullMask && level > 0;
    if (!whole) append_node(level, mask, level + 1 < open_.size() ? full : 0);  // all voxels are full
    Sums sums;
    if (whole)
        sums.opacity = {1.0, 1.0, 1.0};
    else if (attributes_.any_of_voxels() || attributes_.opacity)
        sums = finish_cells(level, mask, node.cells);
    if (level == 0) return;
    OpenNode& parent = open_[level - 1];
    const int bit = int(node.code & 63);
    parent.mask |= uint64_t{1} << bit;
    if (whole) parent.full |= uint64_t{1} << bit;
    parent.cells[size_t(bit)] = sums;
}

void VoxelTreeBuilder::add(const VoxelBatch& batch) {
    size_t voxel = 0;
    for (const VoxelBlock& block : batch.blocks) {
        assert(block.mask != 0 && block.height >= 0 && block.height < frame_.levels);
        assert(block.height == 0 || !attributes_.any_of_voxels());
        assert(block.code << 6 * block.height >= next_code_);
        next_code_ = (block.code << 6 * block.height) + (block.height == 0 ? 1 : 0);
        counts_.voxels += uint64_t(std::popcount(block.mask)) << 6 * block.height;
        if (block.height == 0) {
            add_leaf(block, batch, voxel);
            voxel += size_t(std::popcount(block.mask));
            continue;
        }
        OpenNode& node = open(open_.size() - 1 - size_t(block.height), block.code);
        node.mask |= block.mask;
        node.full |= block.mask;
        if (attributes_.opacity)
            for (uint64_t left = block.mask; left != 0; left &= left - 1) node.cells[size_t(std::countr_zero(left))].opacity = {1.0, 1.0, 1.0};
    }
}

void VoxelTreeBuilder::add_leaf(const VoxelBlock& block, const VoxelBatch& batch, size_t first_voxel) {
    const size_t level = open_.size() - 1;
    OpenNode& node = open(level, block.code);
    node.mask = block.mask;
    if (!attributes_.any_of_voxels()) {
        node.full = block.mask;
        close(level);
        return;
    }
    size_t voxel = first_voxel;
    for (uint64_t left = block.mask; left != 0; left &= left - 1, ++voxel) {
        Sums& cell = node.cells[size_t(std::countr_zero(left))];
        cell.count = batch.counts.empty() ? 1 : batch.counts[voxel];
        cell.weight = cell.count;
        if (attributes_.count) append(VoxelStream::Kind::count, 2 * level + 2, batch.counts[voxel]);
        if (attributes_.color) {
            append(VoxelStream::Kind::color, 2 * level + 2, batch.colors[voxel]);
            for (size_t c = 0; c < 3; ++c) cell.color[c] = cell.weight * batch.colors[voxel][c];
        }
        if (attributes_.normal) {
            append(VoxelStream::Kind::normal, 2 * level + 2, batch.normals[voxel]);
            for (size_t c = 0; c < 3; ++c) cell.normal[c] = int64_t(cell.weight) * batch.normals[voxel][c];
        }
    }
    close(level);
}

VoxelTreeCounts VoxelTreeBuilder::finish() {
    close(0);
    for (size_t kind = 0; kind < kKinds; ++kind)
        for (size_t place = 0; place < kPlaces; ++place)
            if (const std::vector<std::byte>& buffer = buffers_[kind * kPlaces + place]; !buffer.empty())
                out_.append({VoxelStream::Kind(kind), uint8_t(place)}, buffer);
    return counts_;
}

VoxelTreeInMemory::VoxelTreeInMemory(const VoxelFrame& frame, const VoxelAttributes& attributes) {
    tree_.frame = frame;
    tree_.levels.resize(size_t(frame.levels));
    if (attributes.any_of_voxels() || attributes.opacity) tree_.attributes.resize(size_t(frame.depth()) + 1);
}

void VoxelTreeInMemory::append(VoxelStream stream, std::span<const std::byte> bytes) {
    visit_stream(tree_, stream, [&](auto& array) {
        const size_t before = array.size();
        array.resize(before + bytes.size() / sizeof array[0]);
        std::memcpy(array.data() + before, bytes.data(), bytes.size());
    });
}

VoxelTree VoxelTreeInMemory::take() {
    index_tree(tree_);
    return std::move(tree_);
}

}  // namespace strata
