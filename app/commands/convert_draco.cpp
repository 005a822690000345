// What strata convert does for Draco: a file, or a folder of blocks.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "app/commands/convert_output.h"
#include "app/quantity_text.h"
#include "core/error.h"
#include "io/draco/draco_writer.h"

namespace strata {
namespace {

// The default promises the source's integers; Draco may have no room for them.
std::string coarser_note(const CloudInfo& info, double worst_error) {
    const double half = info.quantization.scale.minCoeff() / 2.0;
    char note[256];
    std::snprintf(note, sizeof note,
                  "coordinates move by up to %.3g: Draco has no room for half a quantum of the source, %.3g, over this extent; are there points far from the others? --max-error %.3g refuses instead",
                  worst_error, half, half);
    return note;
}

class DracoOutput : public ConvertOutput {
public:
    DracoOutput(const ConvertRequest& request, const Options& options) {
        for (const char* flag : {"--encoding", "--quality", "--normals", "--viewpoint", "--density"})
            if (options.given(flag)) throw Error(ErrorKind::usage, std::string(flag) + " is for levels of detail, the output is drc");
        settings_.overwrite = request.overwrite;
        settings_.durability = request.durability;
        settings_.threads = request.threads;
        settings_.memory_bytes = request.memory_bytes;
        if (options.given("--max-error")) settings_.max_error = options.number("--max-error");
        if (options.given("--max-error") && settings_.max_error <= 0.0) throw Error(ErrorKind::usage, "--max-error: a positive number expected");
        // The points come with the writing, and with them the progress line.
        settings_.on_progress = [this](uint64_t done, uint64_t total) {
            if (progress_) progress_->update("encoding", done, total);
        };
        writer_ = make_draco_writer(request.output, settings_);
    }

    ConvertReport write(const PointSource& source, ProgressLine& progress, nlohmann::ordered_json& json) override {
        progress_ = &progress;
        const DracoWriteReport report = writer_->write(source);
        json["blocks"] = report.blocks;
        json["exact"] = report.exact;
        char shape[96];
        std::snprintf(shape, sizeof shape, "in %s block%s, coordinates within %.3g%s", with_commas(report.blocks).c_str(), report.blocks == 1 ? "" : "s",
                      report.worst_error, report.exact ? " (exact in strata)" : "");
        std::vector<std::string> notes;
        if (settings_.max_error == 0.0 && !report.exact) notes.push_back(coarser_note(source.info(), report.worst_error));
        return {.points_read = report.points,
                .points_written = report.points,
                .output_bytes = report.output_bytes,
                .worst_rounding = source.info().worst_rounding + report.worst_error,
                .notes = std::move(notes),
                .shape = shape};
    }

private:
    DracoWriteSettings settings_;
    ProgressLine* progress_ = nullptr;
    std::unique_ptr<DracoWriter> writer_;
};

}  // namespace

std::unique_ptr<ConvertOutput> make_draco_output(const ConvertRequest& request, const Options& options) {
    return std::make_unique<DracoOutput>(request, options);
}

}  // namespace strata
