#pragma once

#include <memory>
#include <string>

#include "io/node_writer.h"
#include "io/output_file.h"

namespace strata {

struct CopcWriteSettings {
    bool overwrite = false;
    Durability durability = Durability::synced;
};

/// Writes a COPC 1.0 file: a LAZ 1.4 file of point format 6, 7 or 8 whose chunks are the nodes, in the order in which they are built.
/// Positions are the source's own integers, with its scale and offset. Attributes without a field become extra bytes. The file gets
/// its name when finish() has put all on the disk; until then, and when anything fails, an earlier one stays as it was.
/// throws  Error{io}: the file exists and may not be replaced, or cannot be made
/// source  COPC Specification 1.0; LAS 1.4 R15
std::unique_ptr<NodeWriter> make_copc_writer(const std::string& path, const CopcWriteSettings& settings);

}  // namespace strata
