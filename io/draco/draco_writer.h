#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/cloud/point_source.h"
#include "io/output_file.h"

namespace strata {

struct DracoWriteSettings {
    double max_error = 0.0;  // world units, an axis; 0: half a quantum of the source, see drc::block_frame
    bool overwrite = false;
    Durability durability = Durability::synced;
    int threads = 1;                        // of a folder; a file is encoded by one
    uint64_t memory_bytes = uint64_t{1} << 30;
    std::function<void(uint64_t done, uint64_t total)> on_progress;  // points; one thread at a time
};

struct DracoWriteReport {
    uint64_t points = 0, blocks = 0, output_bytes = 0;
    double worst_error = 0.0;  // world units, an axis, measured by decoding what was written
    bool exact = false;        // strata reads the source's own integers back
};

/// A Draco file, or a folder of them: whole or absent.
class DracoWriter {
public:
    virtual ~DracoWriter() = default;

    /// Writes every point with all attributes, in the order of the source. Once.
    /// throws  Error{limit}: a file would need more memory than the cap, or than its reader takes; Error{unsupported}: there are
    ///         no points; Error{io}
    virtual DracoWriteReport write(const PointSource& source) = 0;
};

/// A path that ends in ".drc" is a file, any other a folder of blocks: runs of at most 2^18 points, each a file, encoded in
/// parallel, so that memory does not grow with the cloud. The bytes do not depend on the number of threads.
/// throws  Error{io}: the output exists and is not to be replaced, or cannot be made
std::unique_ptr<DracoWriter> make_draco_writer(const std::string& path, const DracoWriteSettings& settings);

}  // namespace strata
