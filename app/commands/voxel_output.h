#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "app/options.h"
#include "core/voxel/voxel_block.h"
#include "core/voxel/voxel_frame.h"
#include "io/output_file.h"
#include "io/svo/svo_writer.h"

namespace strata {

/// Where the words of `strata voxelize` want voxels.
struct VoxelOutputRequest {
    std::string path;
    bool overwrite = false;
    bool dag = false;  // .svo: identical subtrees once
    Durability durability = Durability::synced;
    uint64_t memory_bytes = 0;
};

/// What became of them.
struct VoxelOutputReport {
    uint64_t voxels = 0, bytes = 0;
    uint64_t nodes = 0;       // of the octree
    uint64_t dag_nodes = 0;   // of these different ones, where a DAG was asked for
};

/// A file that voxels go to, by the ending of its name: .svo or .vdb.
class VoxelOutput {
public:
    virtual ~VoxelOutput() = default;

    virtual void add(const VoxelBatch& batch) = 0;
    /// Gives the file its name. Once.
    virtual VoxelOutputReport commit() = 0;
    /// Bytes of disk for voxels whose masks take so many.
    virtual uint64_t estimated_bytes(uint64_t mask_bytes) const { return mask_bytes; }
};

/// The request of the options --output, --dag, --overwrite, --no-sync and --memory.
/// throws  Error{usage}: no name, or one that says no format; a DAG is asked for in a format that has none
VoxelOutputRequest voxel_output_request(const Options& options);

/// throws  Error{io}: the output; Error{usage}: attributes that it cannot keep; Error{unsupported}
std::unique_ptr<VoxelOutput> make_voxel_output(const VoxelOutputRequest& request, const VoxelFrame& frame, const VoxelAttributes& attributes, const SvoLabels& labels);

}  // namespace strata
