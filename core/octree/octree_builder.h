#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/cloud/point_source.h"
#include "core/octree/node_sink.h"
#include "core/octree/scratch_store.h"
#include "core/octree/surface_pass.h"

namespace strata {

struct BuildProgress {
    const char* stage = "";  // "counting", "sorting", "neighbors", "building", "writing"
    uint64_t done = 0;       // points
    uint64_t total = 0;      // points
};

struct BuildSettings {
    int threads = 1;
    uint64_t memory_bytes = uint64_t{2} << 30;  // cap; shows in speed only, never in the result
    /// Attributes that are left out when they are zero at every point.
    std::vector<std::string> optional_attributes = {std::string(attribute_name::kClassificationFlags)};
    std::optional<SurfaceSettings> surface;  // what to find out about surfaces; none: nothing
    std::function<void(const BuildProgress&)> on_progress;  // may be empty; called from any thread, one at a time
};

/// What a build did. The sum of node points is verified against points_read before this is returned.
struct BuildReport {
    uint64_t points_read = 0;
    uint64_t points_written = 0;
    uint64_t nodes = 0;
    int levels = 0;
    std::vector<uint64_t> points_per_level;
    uint64_t temporary_bytes = 0;
    double worst_rounding = 0.0;  // world units, an axis: of the source, and where the extent takes more than 31 bits of quanta
};

/// What a build will take, known from the number of points and their attributes alone.
struct BuildEstimate {
    bool in_memory = true;         // all records fit under the cap: no temporary file
    int threads = 1;               // that the cap allows
    uint64_t memory_bytes = 0;     // at most, with these threads
    uint64_t least_memory_bytes = 0;
    uint64_t temporary_bytes = 0;  // 0 in memory
    uint64_t record_bytes = 0;     // of all points, as DEFAULT encoding stores them
};
BuildEstimate estimate_build(const CloudInfo& info, const BuildSettings& settings);

/// Builds the layered hierarchy of a cloud and hands its nodes to `sink`.
/// Inner nodes hold a maximal subset of the points below them with least distance `spacing`; leaves hold the rest, at
/// most 10,000 points unless points coincide. The result depends on the points alone: neither threads, cap nor the
/// order in which work is done show in it.
/// scratch  takes the points sorted into chunks where they do not fit in the cap; nullptr: refuse where they do not fit
/// throws   Error{usage} when settings ask for an attribute that the points have already;
///          Error{limit} when the cap is below the least that this cloud needs (the message says how much);
///          whatever source, scratch and sink throw
/// cost     reads the source twice; O(n log n) time; memory below the cap
BuildReport build_octree(const PointSource& source, const BuildSettings& settings, ScratchStore* scratch, NodeSink& sink);

}  // namespace strata
