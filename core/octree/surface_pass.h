#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/cloud/surface_estimate.h"
#include "core/octree/chunk_store.h"
#include "core/octree/octree_frame.h"
#include "core/octree/partition.h"
#include "core/octree/point_distribution.h"
#include "core/octree/record_layout.h"

namespace strata {

/// What is found out about each point's surface while a cloud is built.
struct SurfaceSettings {
    uint32_t neighbors = 16;  // nearest ones that are looked at, the point itself among them
    bool normals = true;
    bool density = false;
    std::optional<Vec3d> viewpoint;  // world; see estimate_surface
};
inline constexpr uint32_t kLeastNeighbors = 3, kMostNeighbors = 256;

/// The attributes that records get for it, in order: NormalX, NormalY, NormalZ, as viewers know them, and density.
std::vector<Attribute> surface_attributes(const SurfaceSettings& settings);

/// Fills in the surface attributes, which are the last of `layout`, in all records of the store. Neighbors are exact
/// whichever chunks they are in: a point whose neighbors may lie beyond its chunk asks the chunks within reach, loaded
/// one after the other, for those that are nearer. So neither chunks nor threads show.
/// quantization  of the stored quanta
/// returns  the ranges of the surface attributes
/// cost     reads each chunk once for itself and once for each neighbor; surface_memory_needed for each thread
AttributeRanges estimate_surfaces(const Partition& partition, const OctreeFrame& frame, const Quantization& quantization,
                                  const RecordLayout& layout, const SurfaceSettings& settings, int threads, ChunkStore& store,
                                  const OnPoints& on_points);

/// Bytes that a thread takes at most with chunks of that many points.
uint64_t surface_memory_needed(uint64_t points);

}  // namespace strata
