#pragma once

#include <memory>

#include "core/octree/layered_cloud.h"
#include "core/octree/octree_builder.h"

namespace strata {

/// Builds the layered hierarchy of a plain cloud in memory, to look at it at once.
/// throws  Error{limit} when the cloud does not fit under settings.memory_bytes twice (records and nodes): convert it
/// cost    as build_octree; about 2 records a point while building, 1 afterwards
std::unique_ptr<LayeredCloud> build_memory_cloud(const PointSource& source, const BuildSettings& settings);

}  // namespace strata
