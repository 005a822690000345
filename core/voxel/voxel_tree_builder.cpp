#include "core/voxel/voxel_tree_builder.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "core/error.h"

namespace strata {
namespace {

constexpr size_t kKinds = 6;
constexpr size_t kPlaces = 2 * kMostVoxelLevels + 1;
constexpr size_t kBufferBytes = size_t{1} << 14;

VoxelColor mean_color(const std::array<uint64_t, 3>& sums, uint64_t weight) {
    VoxelColor color = {};
    if (weight == 0) return color;
    if (weight < (uint64_t{1} << 24))  // short divisions are many times faster
        for (size_t c = 0; c < 3; ++c) color[c] = uint8_t((uint32_t(sums[c]) + uint32_t(weight) / 2) / uint32_t(weight));
    else
        for (size_t c = 0; c < 3; ++c) color[c] = uint8_t((sums[c] + weight / 2) / weight);
    return color;
}

VoxelNormal mean_normal(const std::array<int64_t, 3>& sums) {
    const Vec3d sum = {double(sums[0]), double(sums[1]), double(sums[2])};
    const double length = sum.norm();
    VoxelNormal normal = {};
    for (size_t c = 0; c < 3 && length > 0.0; ++c) normal[c] = int8_t(std::lround(sum[int(c)] * (127.0 / length)));
    return normal;
}

// Along each axis, of 8 cells of which some are present: the mean over the four columns of two.
std::array<double, 3> opacity_of(const std::array<std::array<double, 3>, 8>& cells, uint32_t present) {
    std::array<double, 3> mean = {};
    for (size_t axis = 0; axis < 3; ++axis) {
        const uint32_t step = 4u >> axis;  // octant digits are 4 x + 2 y + z
        for (uint32_t near = 0; near < 8; ++near) {
            if ((near & step) != 0) continue;
            const double a = (present >> near & 1) != 0 ? cells[near][axis] : 0.0, b = (present >> (near | step) & 1) != 0 ? cells[near | step][axis] : 0.0;
            mean[axis] += 0.25 * (1.0 - (1.0 - a) * (1.0 - b));
        }
    }
    return mean;
}

constexpr std::array<double, 3> kOpaqueCell = {1.0, 1.0, 1.0};
constexpr std::array<std::array<double, 3>, 8> kOpaque = {kOpaqueCell, kOpaqueCell, kOpaqueCell, kOpaqueCell, kOpaqueCell, kOpaqueCell, kOpaqueCell, kOpaqueCell};

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
        case pointer:
        case packed_mask: return 1;
    }
    return 0;
}

VoxelTreeBuilder::VoxelTreeBuilder(const VoxelFrame& frame, const VoxelAttributes& attributes, VoxelTreeSink& out)
    : frame_(frame), attributes_(attributes), out_(out), open_(size_t(frame.levels)), full_begun_(size_t(frame.levels)),
      buffers_(kKinds * kPlaces) {
    counts_.nodes.resize(size_t(frame.levels));
    counts_.cells.resize(size_t(frame.depth()) + 1);
}

void VoxelTreeBuilder::append_bytes(VoxelStream stream, std::span<const std::byte> bytes) {
    Buffer& buffer = buffers_[size_t(stream.kind) * kPlaces + stream.place];
    if (buffer.used + bytes.size() > kBufferBytes && buffer.used > 0) {
        out_.append(stream, std::span(buffer.bytes.get(), buffer.used));
        buffer.used = 0;
    }
    if (bytes.size() > kBufferBytes) return out_.append(stream, bytes);
    if (buffer.bytes == nullptr) buffer.bytes = std::make_unique<std::byte[]>(kBufferBytes);
    std::memcpy(buffer.bytes.get() + buffer.used, bytes.data(), bytes.size());
    buffer.used += bytes.size();
}

template <typename T>
void VoxelTreeBuilder::append(VoxelStream::Kind kind, size_t place, const T& element) {
    append_bytes({kind, uint8_t(place)}, std::as_bytes(std::span(&element, 1)));
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

void VoxelTreeBuilder::add_sums(const Sums& child, Sums& parent) const {
    if (!attributes_.any_of_voxels()) return;
    parent.weight += child.weight;
    parent.count += child.count;
    if (attributes_.color)
        for (size_t c = 0; c < 3; ++c) parent.color[c] += child.color[c];
    if (attributes_.normal)
        for (size_t c = 0; c < 3; ++c) parent.normal[c] += child.normal[c];
}

// Stores what is known of the cells of a node above the voxels, and gives what is known of all of them.
VoxelTreeBuilder::Sums VoxelTreeBuilder::finish_cells(size_t level, uint64_t mask, const std::array<Sums, 64>& cells) {
    Sums node;
    std::array<std::array<double, 3>, 8> octant_opacities;
    for (uint32_t left = bytes_present(mask); left != 0; left &= left - 1) {
        const size_t octant = size_t(std::countr_zero(left));
        const uint32_t present = uint32_t(mask >> 8 * octant & 0xff);
        Sums sums;
        std::array<std::array<double, 3>, 8> opacities;
        for (uint32_t cell = present; cell != 0; cell &= cell - 1) {
            const size_t bit = size_t(std::countr_zero(cell));
            add_sums(cells[8 * octant + bit], sums);
            opacities[bit] = cells[8 * octant + bit].opacity;
        }
        if (attributes_.opacity) octant_opacities[octant] = sums.opacity = opacity_of(opacities, present);
        append_cell(2 * level + 1, sums);
        add_sums(sums, node);
    }
    for (uint64_t left = mask; left != 0; left &= left - 1) append_cell(2 * level + 2, cells[size_t(std::countr_zero(left))]);
    if (attributes_.opacity) node.opacity = opacity_of(octant_opacities, bytes_present(mask));
    return node;
}

// The same of voxels, which are there one behind the other and opaque.
VoxelTreeBuilder::Sums VoxelTreeBuilder::finish_voxels(size_t level, uint64_t mask, const VoxelBatch& batch, size_t first_voxel) {
    Sums node;
    std::array<std::array<double, 3>, 8> octant_opacities;
    size_t voxel = first_voxel;
    for (uint32_t left = bytes_present(mask); left != 0; left &= left - 1) {
        const size_t octant = size_t(std::countr_zero(left));
        const uint32_t present = uint32_t(mask >> 8 * octant & 0xff);
        Sums sums;
        for (int voxels = attributes_.any_of_voxels() ? std::popcount(present) : 0; voxels > 0; --voxels, ++voxel) {
            const uint32_t count = batch.counts.empty() ? 1 : batch.counts[voxel];
            sums.weight += count;
            sums.count += count;
            if (attributes_.color)
                for (size_t c = 0; c < 3; ++c) sums.color[c] += uint64_t{count} * batch.colors[voxel][c];
            if (attributes_.normal)
                for (size_t c = 0; c < 3; ++c) sums.normal[c] += int64_t{count} * batch.normals[voxel][c];
        }
        if (attributes_.opacity) octant_opacities[octant] = sums.opacity = opacity_of(kOpaque, present);
        append_cell(2 * level + 1, sums);
        add_sums(sums, node);
    }
    if (attributes_.opacity) node.opacity = opacity_of(octant_opacities, bytes_present(mask));
    return node;
}

// The open node of a level that has this code; those of this level and of the levels below that lie before it are finished.
VoxelTreeBuilder::OpenNode& VoxelTreeBuilder::open(size_t level, uint64_t code) {
    OpenNode& node = open_[level];
    if (node.active && node.code == code) return node;  // and so are its ancestors
    if (level > 0) open(level - 1, code >> 6);
    if (node.active) close(level);
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
    Sums sums;
    if (whole) {
        sums.opacity = {1.0, 1.0, 1.0};
    } else {
        append_node(level, mask, full);
        if (attributes_.any_of_voxels() || attributes_.opacity) sums = finish_cells(level, mask, node.cells);
    }
    if (level > 0) finish_node(level, node.code, whole, sums);
}

// Tells the parent, which is open, of a node that is finished.
void VoxelTreeBuilder::finish_node(size_t level, uint64_t code, bool whole, const Sums& sums) {
    OpenNode& parent = open_[level - 1];
    const int bit = int(code & 63);
    parent.mask |= uint64_t{1} << bit;
    if (whole) parent.full |= uint64_t{1} << bit;
    parent.cells[size_t(bit)] = sums;
}

void VoxelTreeBuilder::add(const VoxelBatch& batch) {
    const size_t deepest = open_.size();
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
        OpenNode& node = open(deepest - 1 - size_t(block.height), block.code);
        node.mask |= block.mask;
        node.full |= block.mask;
        if (attributes_.opacity)
            for (uint64_t left = block.mask; left != 0; left &= left - 1) node.cells[size_t(std::countr_zero(left))].opacity = {1.0, 1.0, 1.0};
    }
}

void VoxelTreeBuilder::add_leaf(const VoxelBlock& block, const VoxelBatch& batch, size_t first_voxel) {
    const size_t level = open_.size() - 1;
    if (level > 0) open(level - 1, block.code >> 6);
    const bool whole = block.mask == kFullMask && level > 0 && !attributes_.any_of_voxels();
    Sums sums;
    if (whole) {
        sums.opacity = {1.0, 1.0, 1.0};
    } else {
        append_node(level, block.mask, 0);
        // Block by block, so that the order in which streams grow does not tell where batches ended.
        const size_t voxels = size_t(std::popcount(block.mask));
        const auto append_part = [&](VoxelStream::Kind kind, const auto& column) {
            append_bytes({kind, uint8_t(2 * level + 2)}, std::as_bytes(std::span(column).subspan(first_voxel, voxels)));
        };
        if (attributes_.count) append_part(VoxelStream::Kind::count, batch.counts);
        if (attributes_.color) append_part(VoxelStream::Kind::color, batch.colors);
        if (attributes_.normal) append_part(VoxelStream::Kind::normal, batch.normals);
        if (attributes_.any_of_voxels() || attributes_.opacity) sums = finish_voxels(level, block.mask, batch, first_voxel);
    }
    if (level > 0) finish_node(level, block.code, whole, sums);
}

VoxelTreeCounts VoxelTreeBuilder::finish() {
    close(0);
    for (size_t kind = 0; kind < kKinds; ++kind)
        for (size_t place = 0; place < kPlaces; ++place)
            if (const Buffer& buffer = buffers_[kind * kPlaces + place]; buffer.used > 0)
                out_.append({VoxelStream::Kind(kind), uint8_t(place)}, std::span(buffer.bytes.get(), buffer.used));
    return counts_;
}

VoxelTreeInMemory::VoxelTreeInMemory(const VoxelFrame& frame, const VoxelAttributes& attributes, uint64_t most_bytes) : most_bytes_(most_bytes) {
    tree_.frame = frame;
    tree_.levels.resize(size_t(frame.levels));
    if (attributes.any_of_voxels() || attributes.opacity) tree_.attributes.resize(size_t(frame.depth()) + 1);
}

void VoxelTreeInMemory::append(VoxelStream stream, std::span<const std::byte> bytes) {
    // Arrays that grow are copied to others of twice the size.
    bytes_ += 3 * bytes.size();
    if (bytes_ > most_bytes_)
        throw Error(ErrorKind::limit, "the tree takes more than the " + std::to_string(most_bytes_) + " bytes of memory that it may take");
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
