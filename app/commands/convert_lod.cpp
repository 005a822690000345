// What strata convert does for level-of-detail data sets: one build of the hierarchy, whatever format takes its nodes.
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/commands/convert_output.h"
#include "app/quantity_text.h"
#include "core/error.h"
#include "core/octree/octree_builder.h"
#include "io/copc/copc_writer.h"
#include "io/potree/potree_writer.h"
#include "io/scratch_file.h"

namespace strata {
namespace {

namespace fs = std::filesystem;

// The disk must hold what a build writes beside what is there already.
void check_disk(const std::string& output, const BuildEstimate& estimate) {
    const fs::path parent = fs::absolute(output).parent_path();
    const uint64_t needed = estimate.record_bytes + estimate.temporary_bytes;
    const uint64_t free = free_disk_bytes(parent.string());
    if (needed > free)
        throw Error(ErrorKind::io, output + ": about " + std::to_string(needed >> 20) + " MiB of disk are needed, " +
                                       std::to_string(free >> 20) + " MiB are free");
}

PotreeWriteSettings potree_settings(const ConvertRequest& request, const Options& options) {
    PotreeWriteSettings settings;
    const std::string encoding = options.text("--encoding");
    if (encoding != "default" && encoding != "brotli")
        throw Error(ErrorKind::usage, "--encoding: expected default or brotli, got '" + encoding + "'");
    settings.encoding = encoding == "brotli" ? PotreeEncoding::brotli : PotreeEncoding::plain;
    settings.brotli_quality = int(options.integer("--quality", 0, 11));
    if (options.given("--quality") && encoding != "brotli") throw Error(ErrorKind::usage, "--quality needs --encoding brotli");
    settings.overwrite = request.overwrite;
    settings.durability = request.durability;
    return settings;
}

std::optional<SurfaceSettings> surface_settings(const Options& options) {
    SurfaceSettings settings;
    settings.neighbors = uint32_t(options.integer("--normals", kLeastNeighbors, kMostNeighbors));
    settings.normals = options.given("--normals");
    settings.density = options.given("--density");
    if (options.given("--viewpoint")) {
        if (!settings.normals) throw Error(ErrorKind::usage, "--viewpoint needs --normals");
        const std::vector<double> place = options.numbers("--viewpoint", 3);
        settings.viewpoint = Vec3d(place[0], place[1], place[2]);
    }
    if (!settings.normals && !settings.density) return std::nullopt;
    return settings;
}

std::unique_ptr<NodeWriter> make_writer(const ConvertRequest& request, const Options& options) {
    if (request.format == "potree") return make_potree_writer(request.output, potree_settings(request, options));
    for (const char* const flag : {"--encoding", "--quality"})
        if (options.given(flag)) throw Error(ErrorKind::usage, std::string(flag) + " is for potree, the output is " + request.format);
    return make_copc_writer(request.output, {.overwrite = request.overwrite, .durability = request.durability});
}

class LodOutput : public ConvertOutput {
public:
    LodOutput(const ConvertRequest& request, const Options& options) : request_(request) {
        settings_.threads = request.threads;
        settings_.memory_bytes = request.memory_bytes;
        settings_.surface = surface_settings(options);
        writer_ = make_writer(request, options);
    }

    ConvertReport write(const PointSource& source, ProgressLine& progress, nlohmann::ordered_json& json) override {
        const BuildEstimate estimate = estimate_build(source.info(), settings_);
        check_disk(request_.output, estimate);
        if (!request_.quiet && estimate.memory_bytes <= settings_.memory_bytes)
            std::fprintf(stderr, "%s points: at most %s memory, %s temporary, %s output\n", with_commas(source.info().points).c_str(),
                         size_text(estimate.memory_bytes).c_str(), size_text(estimate.temporary_bytes).c_str(),
                         size_text(estimate.record_bytes).c_str());
        settings_.on_progress = [&](const BuildProgress& p) { progress.update(p.stage, p.done, p.total); };
        const auto scratch = make_scratch_file(fs::absolute(request_.output).parent_path().string());
        const BuildReport report = build_octree(source, settings_, scratch.get(), *writer_);
        json["nodes"] = report.nodes;
        json["levels"] = report.levels;
        return {.points_read = report.points_read,
                .points_written = report.points_written,
                .temporary_bytes = report.temporary_bytes,
                .output_bytes = writer_->output_bytes(),
                .worst_rounding = report.worst_rounding,
                .notes = writer_->notes(),
                .shape = "in " + with_commas(report.nodes) + " nodes on " + std::to_string(report.levels) + " levels"};
    }

private:
    ConvertRequest request_;
    BuildSettings settings_;
    std::unique_ptr<NodeWriter> writer_;
};

}  // namespace

std::unique_ptr<ConvertOutput> make_lod_output(const ConvertRequest& request, const Options& options) {
    return std::make_unique<LodOutput>(request, options);
}

}  // namespace strata
