#pragma once

#include <memory>
#include <string>

#include "core/octree/layered_cloud.h"
#include "io/byte_source.h"

namespace strata {

/// Opens a Potree 2.x data set, ours or PotreeConverter's, DEFAULT or BROTLI. Reads metadata.json and the first chunk
/// of the hierarchy; the rest comes by load_children and read_node. A node whose children are pending is itself whole.
/// path    the folder, or its metadata.json
/// throws  Error{not_found, malformed, unsupported, limit, io}, naming the file and the node or key
std::unique_ptr<LayeredCloud> open_potree(const std::string& path);

/// The same from any three sources of bytes.
std::unique_ptr<LayeredCloud> open_potree(std::unique_ptr<ByteSource> metadata, std::unique_ptr<ByteSource> hierarchy,
                                          std::unique_ptr<ByteSource> octree);

}  // namespace strata
