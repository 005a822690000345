#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/voxel/voxel_block.h"
#include "core/voxel/voxel_tree.h"

namespace strata {

/// One of the arrays that a tree is made of, each of which only grows at its end while the tree is built.
struct VoxelStream {
    enum class Kind : uint8_t { mask, full, count, color, normal, opacity, pointer, packed_mask };  // the last two of DAGs only

    Kind kind = Kind::mask;
    uint8_t place = 0;  // count, color, normal, opacity: depth; the others: level

    bool operator==(const VoxelStream&) const = default;
};

/// Bytes of an element: as in memory, so that a stream read back is a vector of VoxelLevel or CellAttributes.
size_t element_size(VoxelStream::Kind kind);

/// Keeps what a builder makes: a file in io, or VoxelTreeInMemory.
class VoxelTreeSink {
public:
    virtual ~VoxelTreeSink() = default;

    /// Adds whole elements to the end of a stream.
    virtual void append(VoxelStream stream, std::span<const std::byte> bytes) = 0;
};

struct VoxelTreeCounts {
    uint64_t voxels = 0;
    std::vector<uint64_t> nodes;  // [levels]
    std::vector<uint64_t> cells;  // [1 + depth] stored cells by depth; cells below full ones are not stored
};

/// Builds a sparse voxel octree from blocks in Morton order. Needs one node a level and 16 KiB a stream of memory: what is finished
/// goes to the sink, so trees of any size can be built.
/// Of coarser cells, count is the sum of their voxels'; color and normal are the means of their voxels', weighted by count where that is
/// known; opacity along an axis is the mean over the four columns of two cells of 1 - (1 - a)(1 - b), so that a wall stays
/// opaque from the front and becomes thin from the side.
/// cost  O(blocks), and with attributes O(voxels)
class VoxelTreeBuilder {
public:
    /// attributes  batches must have the columns that are asked for
    VoxelTreeBuilder(const VoxelFrame& frame, const VoxelAttributes& attributes, VoxelTreeSink& out);

    /// Batches ascend. Asserts that they do.
    void add(const VoxelBatch& batch);

    /// Ends the tree. Once. Without any block there are no nodes.
    VoxelTreeCounts finish();

private:
    // What is known of the voxels in a cell.
    struct Sums {
        uint64_t weight = 0, count = 0;
        std::array<uint64_t, 3> color = {};
        std::array<int64_t, 3> normal = {};
        std::array<double, 3> opacity = {};
    };
    // The node of a level that is not finished yet.
    struct OpenNode {
        bool active = false;
        uint64_t code = 0, mask = 0, full = 0;
        std::array<Sums, 64> cells;             // by bit; of those that are in the mask
    };

    struct Buffer {
        std::unique_ptr<std::byte[]> bytes;
        size_t used = 0;
    };

    OpenNode& open(size_t level, uint64_t code);
    void close(size_t level);
    void finish_node(size_t level, uint64_t code, bool whole, const Sums& sums);
    void add_leaf(const VoxelBlock& block, const VoxelBatch& batch, size_t first_voxel);
    Sums finish_cells(size_t level, uint64_t mask, const std::array<Sums, 64>& cells);
    Sums finish_voxels(size_t level, uint64_t mask, const VoxelBatch& batch, size_t first_voxel);
    void add_sums(const Sums& child, Sums& parent) const;
    void append_node(size_t level, uint64_t mask, uint64_t full);
    void append_cell(size_t depth, const Sums& cell);
    template <typename T>
    void append(VoxelStream::Kind kind, size_t place, const T& element);
    void append_bytes(VoxelStream stream, std::span<const std::byte> bytes);

    VoxelFrame frame_;
    VoxelAttributes attributes_;
    VoxelTreeSink& out_;
    std::vector<OpenNode> open_;                   // [levels]; the last level's are finished at once and never open
    std::vector<bool> full_begun_;                 // [levels]
    std::vector<Buffer> buffers_;                  // by kind and place
    VoxelTreeCounts counts_;
    uint64_t next_code_ = 0;  // of blocks of voxels: none comes below
};

/// A sink that keeps the tree.
class VoxelTreeInMemory : public VoxelTreeSink {
public:
    /// most_bytes  of memory, for the arrays and what take() adds to them
    VoxelTreeInMemory(const VoxelFrame& frame, const VoxelAttributes& attributes, uint64_t most_bytes = std::numeric_limits<uint64_t>::max());

    /// throws  Error{limit}: the tree takes more memory than allowed
    void append(VoxelStream stream, std::span<const std::byte> bytes) override;
    /// The tree that was built, indexed. Once.
    VoxelTree take();

private:
    VoxelTree tree_;
    uint64_t most_bytes_, bytes_ = 0;
};

/// The array of a tree that a stream fills: element_size(kind) bytes an element.
/// visit  called with a reference to the std::vector
template <typename Tree, typename Visit>
void visit_stream(Tree& tree, VoxelStream stream, const Visit& visit) {
    using enum VoxelStream::Kind;
    switch (stream.kind) {
        case mask: return visit(tree.levels[stream.place].masks);
        case full: return visit(tree.levels[stream.place].full);
        case count: return visit(tree.attributes[stream.place].counts);
        case color: return visit(tree.attributes[stream.place].colors);
        case normal: return visit(tree.attributes[stream.place].normals);
        case opacity: return visit(tree.attributes[stream.place].opacities);
        case pointer:
        case packed_mask: return;
    }
}

}  // namespace strata
