#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/octree/node_sink.h"

namespace strata {

/// A level-of-detail data set on its way to the disk.
class NodeWriter : public NodeSink {
public:
    virtual uint64_t output_bytes() const = 0;  // of all its files, after finish()
    /// What it cannot hold as it was; a line each. After begin().
    virtual std::vector<std::string> notes() const { return {}; }
};

}  // namespace strata
