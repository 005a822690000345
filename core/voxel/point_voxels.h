#pragma once

#include <cstdint>
#include <functional>

#include "core/cloud/point_source.h"
#include "core/octree/scratch_store.h"
#include "core/voxel/voxel_block.h"
#include "core/voxel/voxel_frame.h"

namespace strata {

struct PointVoxelSettings {
    VoxelAttributes attributes;  // count, color, normal; only those asked for cost anything
    int threads = 1;
    uint64_t memory_bytes = uint64_t{1} << 30;       // to keep to, and some 8 MB a thread; where
                                                     // there is a scratch store
    ScratchStore* scratch = nullptr;                 // for what is beyond; nullptr: everything stays in memory
    std::function<void(uint64_t points)> on_points;  // points read since the last call; from any thread
};

struct PointVoxelReport {
    uint64_t points = 0;   // read
    uint64_t outside = 0;  // of these: not in the frame, left out
    uint64_t voxels = 0;
    uint64_t scratch_bytes = 0;  // written

    bool operator==(const PointVoxelReport&) const = default;
};

/// The voxels that hold points, with what the points say of them: how many (at most 2^32 - 1), the mean of their colors as stored
/// (attribute rgb, of 8 or 16 bits as rgb_depth tells; no_data is not treated apart), and the direction of the sum of their normals
/// (NormalX, NormalY, NormalZ; only directions count, and points without one do not).
/// A point lies in the voxel that VoxelFromQuanta says. All sums are of integers and are rounded once: threads, memory and the
/// order of points do not show.
/// throws  Error{usage}: color or normal is asked for, and the points have none; and what source, scratch store and sink throw
/// cost    two passes: points become records of 8 to 24 bytes, those of one voxel that are read together become one, and records are
///         put into buckets of neighboring voxels; then each bucket is sorted and put out. O(points), and the records' size of memory
///         or scratch room.
PointVoxelReport voxelize_points(const PointSource& source, const VoxelFrame& frame, const PointVoxelSettings& settings,
                                 const VoxelSink& sink);

}  // namespace strata
