#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "app/options.h"
#include "app/progress.h"
#include "core/cloud/point_source.h"
#include "io/output_file.h"

namespace strata {

/// What the words of `strata convert` say of any output.
struct ConvertRequest {
    std::string output;
    std::string format;  // its name in the list of formats
    bool overwrite = false;
    Durability durability = Durability::synced;
    int threads = 1;
    uint64_t memory_bytes = 0;
    bool quiet = false;
};

/// What became of the points.
struct ConvertReport {
    uint64_t points_read = 0;
    uint64_t points_written = 0;
    uint64_t temporary_bytes = 0;
    uint64_t output_bytes = 0;
    double worst_rounding = 0.0;  // world units, an axis
    std::vector<std::string> notes;  // what the output cannot hold as it was; a line each
    std::string shape;            // what there is to say of the output besides points and bytes: "in 9 nodes on 2 levels"; or empty
};

/// An output of `strata convert` that has its place and its options, and waits for points. Each kind has a file of its own.
class ConvertOutput {
public:
    virtual ~ConvertOutput() = default;

    /// Writes every point of the source. Once.
    /// json  takes what this kind of output reports beyond ConvertReport
    virtual ConvertReport write(const PointSource& source, ProgressLine& progress, nlohmann::ordered_json& json) = 0;
};

// Each checks the options that are its own and refuses an output that is in the way, before any point is read.
// throws  Error{usage}: the options; Error{io}: the output
std::unique_ptr<ConvertOutput> make_lod_output(const ConvertRequest& request, const Options& options);
std::unique_ptr<ConvertOutput> make_draco_output(const ConvertRequest& request, const Options& options);
std::unique_ptr<ConvertOutput> make_las_output(const ConvertRequest& request, const Options& options);

}  // namespace strata
