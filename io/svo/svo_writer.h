#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/voxel/voxel_dag.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/output_file.h"
#include "io/svo/svo_layout.h"

namespace strata {

/// What a voxel file says of itself beside its voxels.
struct SvoLabels {
    std::string kind;  // how its voxels were made: "solid", "conservative", "thin", "points", "level-set", "grid"
    std::string crs;   // as CloudInfo has it; empty: unknown
};

/// Writes a `.svo` file (docs/svo.md) as its tree is built: streams grow side by side in blocks of 64 KiB, each with its checksum, and
/// a directory at the end says where they are. Needs a block a stream of memory, and the directory: 12 bytes a block.
class SvoWriter : public VoxelTreeSink {
public:
    /// throws  as OutputFile
    SvoWriter(const std::string& path, bool overwrite, const VoxelFrame& frame, SvoLabels labels, svo::Layout layout = svo::Layout::tree);

    void append(VoxelStream stream, std::span<const std::byte> bytes) override;

    /// Writes what is left and gives the file its name. Once.
    /// returns  bytes of the file
    uint64_t commit(uint64_t voxels, Durability durability = Durability::synced);

private:
    struct Block {
        uint64_t offset;
        uint32_t checksum;
    };
    struct Stream {
        VoxelStream name;
        uint64_t elements = 0;
        std::vector<std::byte> pending;  // of the block at hand
        std::vector<Block> blocks;
    };

    Stream& stream_of(VoxelStream name);
    void write_block(Stream& stream);

    OutputFile file_;
    VoxelFrame frame_;
    SvoLabels labels_;
    svo::Layout layout_;
    std::vector<Stream> streams_;
};

/// Hands the arrays of a DAG to a writer of layout `dag`.
void write_svo_dag(const VoxelDag& dag, VoxelTreeSink& out);

}  // namespace strata
