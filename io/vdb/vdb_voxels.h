#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "core/voxel/brick_voxels.h"
#include "core/voxel/voxel_frame.h"
#include "io/vdb/vdb_file.h"
#include "io/vdb/vdb_tree.h"

namespace strata {

/// Which points of a grid are occupied voxels: of a level set those whose value is at most the isovalue, inside and in the narrow band; of a fog
/// volume or a grid without a class the active ones whose value is above it; of truth values the active ones.
struct VdbVoxelSettings {
    std::string grid;                // its name; empty: the first that can be read
    std::optional<double> isovalue;  // none: 0
    uint64_t memory_bytes = std::numeric_limits<uint64_t>::max();
};

/// The occupied points of a grid. Each is the center of its voxel.
struct VdbVoxels {
    VdbGrid grid;
    VoxelFrame frame;
    BrickVoxels voxels;  // finished: emit() puts them out in Morton order
};

/// The grid of a name, or the first that can be read where that is empty.
/// throws  Error{unsupported}: there is none; Error{usage}: none of that name
const VdbGrid& choose_vdb_grid(const VdbFile& file, const std::string& name, const std::string& place);

/// Gathers the occupied points of a tree, as it is visited.
/// grid   and `out` must live as long as the visitor
/// place  for messages
/// throws  while it visits: Error{usage}: the background is occupied; Error{limit}
VdbVisitor gather_occupied(const VdbGrid& grid, const VdbVoxelSettings& settings, std::string place, BrickVoxels& out);

/// throws  Error{not_found, io, malformed}
///         Error{unsupported}: no grid that can be read, or one whose voxels are no cubes along the axes
///         Error{usage}: no grid of that name; Error{limit}: more memory or voxels an axis than allowed
VdbVoxels read_vdb_voxels(const std::string& path, const VdbVoxelSettings& settings = {});
VdbVoxels read_vdb_voxels(const ByteSource& source, const VdbVoxelSettings& settings);

/// The grids of a file, for `info`. Where a grid's counts are missing in the file and it can be read, it is read for them,
/// once for all grids that share a tree.
VdbFile read_vdb_info(const std::string& path);
VdbFile read_vdb_info(const ByteSource& source);

}  // namespace strata
