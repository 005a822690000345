#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "app/progress.h"
#include "core/voxel/voxel_block.h"
#include "core/voxel/voxel_frame.h"
#include "io/output_file.h"

namespace strata {

/// What the words of `strata voxelize` say of any input.
struct VoxelRequest {
    std::string kind;                           // "solid", "conservative", "thin", "level-set", "points"; empty: what suits the input
    std::optional<uint32_t> resolution;         // voxels along the longest side; none: voxel_size
    double voxel_size = 0.0;                    // world units
    std::optional<VoxelAttributes> attributes;  // none: what suits the input
    std::string grid;                           // of a .vdb file; empty: the first
    std::optional<double> isovalue;
    std::string for_grids, not_for_grids;       // flags that were given and are for .vdb files only, or not for them; empty: none
    std::string scratch_folder;
    int threads = 1;
    uint64_t memory_bytes = 0;
};

/// Something that voxels can be made of. Each kind has a class of its own behind open_voxel_input.
class VoxelInput {
public:
    virtual ~VoxelInput() = default;

    virtual const std::string& kind() const = 0;
    virtual const VoxelFrame& frame() const = 0;
    virtual const VoxelAttributes& attributes() const = 0;
    virtual std::string crs() const { return {}; }
    /// Bytes of masks to expect in a file; 0: not known.
    virtual uint64_t estimated_bytes() const { return 0; }

    /// Hands all voxels out. A second time, with a frame that holds more, where it gives false: then the bounds of the file were wrong.
    virtual bool voxelize(const VoxelSink& sink, ProgressLine& progress) = 0;

    /// Whether it has a grid of its own, which loses nothing as a `.vdb` file.
    virtual bool has_own_grid() const { return false; }
    /// Writes that. returns  bytes
    virtual uint64_t write_own_grid(const std::string& /*path*/, bool /*overwrite*/, Durability) { return 0; }

    /// What was odd; a line each.
    std::vector<std::string> notes;
    uint64_t points_read = 0, scratch_bytes = 0;
};

/// Opens a mesh, a grid, or files of points.
/// throws  Error{usage}: what the request asks for is not for such an input; and what reading throws
std::unique_ptr<VoxelInput> open_voxel_input(std::span<const std::string> words, const VoxelRequest& request);

}  // namespace strata
