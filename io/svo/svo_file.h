#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/voxel/voxel_tree.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/byte_source.h"
#include "io/svo/svo_writer.h"

namespace strata {

/// A `.svo` file (docs/svo.md): opened by its header and directory alone; streams are read by ranges.
class SvoFile {
public:
    /// Takes `source`.
    /// throws  Error{malformed, unsupported, io}, naming the file and the place
    explicit SvoFile(std::unique_ptr<ByteSource> source);

    const VoxelFrame& frame() const { return frame_; }
    const SvoLabels& labels() const { return labels_; }
    /// The DAG of a file of that layout, which is read when the file is opened and takes at most 16 times its bytes. Null: a tree.
    const VoxelDag* dag() const { return dag_ ? &*dag_ : nullptr; }
    uint64_t voxels() const { return voxels_; }
    uint64_t size_bytes() const { return source_->size(); }
    /// What voxels have; opacity: what coarser cells have.
    VoxelAttributes attributes() const;
    /// Of the tree, also where a DAG is stored.
    uint64_t nodes(int level) const { return dag_ ? dag_counts_[size_t(level)].tree_nodes : elements({VoxelStream::Kind::mask, uint8_t(level)}); }
    /// Elements of a stream, 0 where there is none.
    uint64_t elements(VoxelStream stream) const;

    /// Reads elements of a stream; `out` holds whole ones. Touches only the blocks that have them.
    /// throws  Error{malformed}: beyond the end, or a block's checksum is wrong
    void read(VoxelStream stream, uint64_t first, std::span<std::byte> out) const;

    /// Reads every block.
    /// throws  Error{malformed}: a checksum is wrong
    void verify(int threads) const;

    /// Bytes that a tree of the first `levels` levels takes in memory.
    uint64_t memory_bytes(int levels, bool with_attributes) const;
    /// The most levels that fit in memory_bytes; at least 1.
    int levels_within(uint64_t memory_bytes, bool with_attributes) const;
    /// The first `levels` levels, checked; of a DAG the tree that it stands for.
    /// throws  Error{malformed}, naming the file and the level
    VoxelTree load(int levels, bool with_attributes, int threads) const;

private:
    struct Block {
        uint64_t offset;
        uint32_t checksum;
    };
    struct Stream {
        VoxelStream name;
        uint32_t block_elements = 1;
        uint64_t elements = 0;
        std::vector<Block> blocks;
    };

    void read_header();
    void read_directory(uint64_t offset, uint64_t size, uint32_t checksum);
    void read_dag();
    VoxelTree load_from_dag(size_t levels) const;
    const Stream* find(VoxelStream name) const;
    void read_block(const Stream& stream, uint64_t block, std::vector<std::byte>& out) const;
    template <typename T>
    void read_all(VoxelStream name, std::vector<T>& out, int threads) const;

    std::unique_ptr<ByteSource> source_;
    VoxelFrame frame_;
    SvoLabels labels_;
    uint64_t voxels_ = 0;
    std::vector<Stream> streams_;
    std::optional<VoxelDag> dag_;
    std::vector<DagLevelCounts> dag_counts_;
};

/// throws  as SvoFile; Error{not_found, io}
SvoFile open_svo(const std::string& path);

}  // namespace strata
