// Surfaces of points: balls around them.
#include "app/commands/surface_inputs.h"

#include <cmath>
#include <mutex>

#include "app/commands/contour_input.h"
#include "app/quantity_text.h"
#include "core/cloud/cloud_statistics.h"
#include "core/error.h"
#include "core/surface/point_balls.h"
#include "io/format.h"

namespace strata {
namespace {

/// Balls around points.
class BallsInput : public ContourInput {
public:
    BallsInput(std::span<const std::string> words, const SurfaceRequest& request)
        : ContourInput(request, ContourInside::below), request_(request), source_(open_points(point_files(words))), step_(request.voxel_size.value_or(*request.radius / 2.0)) {
        for (const auto& [given, flag] : {std::pair(!request.isovalues.empty(), "--iso"), std::pair(request.inside.has_value(), "--inside"), std::pair(request.error.has_value(), "--error")})
            if (given) throw Error(ErrorKind::usage, std::string(flag) + " is not for balls around points");
        settings_.isovalues = {0.0};
        settings_.memory_bytes = request.memory_bytes / 2;
        const CloudInfo& info = source_->info();
        notes = info.notes;
        if (info.points == 0) throw Error(ErrorKind::malformed, words[0] + ": no points to make a surface of");
        points_box_ = info.bounds.empty() || !info.bounds.min.allFinite() || !info.bounds.max.allFinite() ? measured() : info.bounds;
    }

    Box3d bounds() const override {
        Box3d box = points_box_;
        box.min -= Vec3d::Constant(*request_.radius);
        box.max += Vec3d::Constant(*request_.radius);
        return box;
    }
    double edge() const override { return step_; }
    void extract(SurfaceSink& out, ProgressLine& progress) override {
        std::mutex mutex;
        uint64_t done = 0;
        PointBallsSettings settings = {.spacing = step_, .radius = *request_.radius, .threads = request_.threads, .memory_bytes = request_.memory_bytes / 2, .scratch = request_.scratch};
        settings.on_points = [&](uint64_t points) {
            const std::lock_guard lock(mutex);
            progress.update("surface", done += points, source_->info().points);
        };
        auto field = std::make_unique<PointBalls>(*source_, points_box_, settings);
        if (field->outside() > 0) {
            notes.push_back("the header's bounds leave " + with_commas(field->outside()) + " points out; those of the points are taken");
            field.reset();
            done = 0;
            field = std::make_unique<PointBalls>(*source_, measured(), settings);
        }
        const ContourReport found = contour_bricks(*field, settings_, out);
        say_what_was_found(found, found.least, found.greatest);
    }

private:
    Box3d measured() const { return measure_cloud(*source_, request_.threads).bounds; }

    SurfaceRequest request_;
    std::unique_ptr<PointSource> source_;
    double step_;
    Box3d points_box_;
};

}  // namespace

std::unique_ptr<SurfaceInput> surface_of_balls(std::span<const std::string> words, const SurfaceRequest& request) {
    return std::make_unique<BallsInput>(words, request);
}

}  // namespace strata
