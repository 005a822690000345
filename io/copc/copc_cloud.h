#pragma once

#include <memory>

#include "core/octree/layered_cloud.h"
#include "io/byte_source.h"

namespace strata {

/// Opens a COPC 1.0 file as its octree. Reads the header and the root's page of the hierarchy; other pages come by
/// load_children, and chunks of points by read_node, which decodes the wanted attributes only.
/// throws  Error{malformed, unsupported, limit, io}: file, place, expectation
std::unique_ptr<LayeredCloud> open_copc(std::unique_ptr<ByteSource> bytes);

}  // namespace strata
