// Surfaces of points: a smooth one near them, and balls around them.
#include "app/commands/surface_inputs.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>

#include "app/commands/contour_input.h"
#include "app/quantity_text.h"
#include "core/cloud/cloud_statistics.h"
#include "core/cloud/point_spacing.h"
#include "core/cloud/rgb_depth.h"
#include "core/error.h"
#include "core/surface/point_balls.h"
#include "core/surface/point_paint.h"
#include "core/surface/point_surface.h"
#include "io/format.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

// Numbers that stand for something; what lies between two of them stands for nothing.
bool is_class(std::string_view name) {
    using namespace attribute_name;
    const std::string_view classes[] = {kClassification, kClassificationFlags, kReturnNumber, kNumberOfReturns, kUserData, kPointSourceId};
    return std::find(std::begin(classes), std::end(classes), name) != std::end(classes);
}

/// What surfaces of points have in common: colors and attributes of the points go to the vertices.
class PointsInput : public ContourInput {
public:
    Box3d bounds() const override {
        Box3d box = points_box_;
        box.min -= Vec3d::Constant(radius_);
        box.max += Vec3d::Constant(radius_);
        return box;
    }
    double edge() const override { return step_; }
    bool has_colors() const override { return form_.colors; }
    std::vector<std::string> scalar_names() const override {
        std::vector<std::string> names;
        for (const PointForm::Scalar& scalar : form_.scalars) names.push_back(scalar.name);
        return names;
    }

protected:
    PointsInput(std::span<const std::string> words, const SurfaceRequest& request, const char* what)
        : ContourInput(request, ContourInside::below), request_(request), source_(open_points(point_files(words))) {
        for (const auto& [given, flag] : {std::pair(!request.isovalues.empty(), "--iso"), std::pair(request.inside.has_value(), "--inside"), std::pair(request.error.has_value(), "--error")})
            if (given) throw Error(ErrorKind::usage, std::string(flag) + " is not for " + what);
        settings_.isovalues = {0.0};
        settings_.memory_bytes = request.memory_bytes / 2;
        settings_.memory_parts = request.memory_parts * 2;
        const CloudInfo& info = source_->info();
        notes = info.notes;
        if (info.points == 0) throw Error(ErrorKind::malformed, words[0] + ": no points to make a surface of");
        points_box_ = info.bounds.empty() || !info.bounds.min.allFinite() || !info.bounds.max.allFinite() ? measured() : info.bounds;
        color_bits_ = rgb_depth(*source_, request.threads);
        form_.colors = color_bits_ > 0;
        for (const std::string& word : request.attributes) {
            const AttributeComponent found = find_component(info.attributes, word, "");
            const Attribute& attribute = info.attributes[size_t(found.attribute)];
            const std::string name = attribute.components > 1 ? attribute.name + "[" + std::to_string(found.component) + "]" : attribute.name;
            form_.scalars.push_back({.name = name, .attribute = found.attribute, .component = found.component, .is_class = is_class(attribute.name)});
        }
    }

    /// What the settings of fields have in common: bounds are those of the header, unless they leave points out.
    template <typename Settings>
    Settings settings_of_field(ProgressLine& progress) {
        Settings settings = {.spacing = step_, .radius = radius_, .threads = request_.threads, .memory_bytes = request_.memory_bytes / 2, .scratch = request_.scratch};
        settings.form = form_;
        settings.keep_points = is_painted();
        const auto done = std::make_shared<std::pair<std::mutex, uint64_t>>();
        settings.on_points = [this, &progress, done](uint64_t points) {
            const std::lock_guard lock(done->first);
            progress.update("surface", done->second += points, source_->info().points);
        };
        settings.bounds_of_all = [this, done](uint64_t outside) {
            notes.push_back("the header's bounds leave " + with_commas(outside) + " points out; those of the points are taken");
            done->second = 0;
            return measured();
        };
        return settings;
    }

    template <typename Field>
    void contour(Field& field, double paint_radius, SurfaceSink& out) {
        PointPaint paint({.grid = field.grid(), .form = form_, .color_bits = color_bits_, .radius = paint_radius, .threads = request_.threads}, field.window(), out);
        const ContourReport found = contour_bricks(field, settings_, is_painted() ? static_cast<SurfaceSink&>(paint) : out);
        if (paint.unknown() > 0) notes.push_back(with_commas(paint.unknown()) + " vertices have no point near them, and no color or attribute");
        say_what_was_found(found, found.least, found.greatest);
    }

    bool is_painted() const { return form_.colors || !form_.scalars.empty(); }
    Box3d measured() const { return measure_cloud(*source_, request_.threads).bounds; }

    SurfaceRequest request_;
    std::unique_ptr<PointSource> source_;
    PointForm form_;
    int color_bits_ = 0;
    double step_ = 0.0, radius_ = 0.0;
    Box3d points_box_;
};

/// Balls around points.
class BallsInput : public PointsInput {
public:
    BallsInput(std::span<const std::string> words, const SurfaceRequest& request) : PointsInput(words, request, "balls around points") {
        radius_ = *request.radius;
        step_ = request.voxel_size.value_or(radius_ / 2.0);
    }

    void extract(SurfaceSink& out, ProgressLine& progress) override {
        PointBalls field(*source_, points_box_, settings_of_field<PointBallsSettings>(progress));
        contour(field, kPaint * radius_, out);
    }

private:
    static constexpr double kPaint = 1.25;  // radii: vertices lie at one from the nearest point, at most an eighth more for samples that far apart
};

/// A smooth surface near points with normals.
class SmoothInput : public PointsInput {
public:
    SmoothInput(std::span<const std::string> words, const SurfaceRequest& request) : PointsInput(words, request, "a smooth surface of points") {
        settings_.open_at_nan = true;
        choose_lengths(words[0]);
    }

    SurfaceMethod method() const override { return SurfaceMethod::smooth; }
    void extract(SurfaceSink& out, ProgressLine& progress) override {
        PointSurfaceSettings settings = settings_of_field<PointSurfaceSettings>(progress);
        settings.viewpoint = request_.viewpoint;
        PointSurface field(*source_, points_box_, settings);
        found_ = field.report();
        contour(field, radius_, out);
        say_what_points_are();
    }
    void add_to(ordered_json& report) const override {
        PointsInput::add_to(report);
        report.update({{"radius", radius_}, {"voxel_size", step_}, {"normals", found_.has_normals ? "of the points" : "fitted"}, {"sides_chosen", found_.oriented}, {"parts_of_points", found_.components},
                       {"merged_points", found_.merged}, {"points_without_normal", found_.without_normal}});
    }

private:
    // Three spacings of most points reach over the gaps between them, and samples as far apart as the points show what these do.
    static constexpr double kRadius = 3.0, kLeastRadius = PointSurfaceSettings::kLeastReach, kMostRadius = PointSurfaceSettings::kMostReach;  // spacings of samples
    static constexpr double kLeastQuanta = 2.0;  // steps of coordinates, nearer to each other than which points are steps of stairs
    static constexpr double kShare = 0.75;  // of points that lie no farther apart

    void choose_lengths(const std::string& path) {
        if (request_.radius && request_.voxel_size) {
            radius_ = *request_.radius;
            step_ = *request_.voxel_size;
            if (!(radius_ >= kLeastRadius * step_ && radius_ <= kMostRadius * step_))
                throw Error(ErrorKind::usage, "--radius: expected 2 to 7 times --voxel-size, for a smooth surface");
            return;
        }
        if (request_.radius) {
            radius_ = *request_.radius;
            step_ = radius_ / kRadius;
            return;
        }
        std::vector<double> spacings = measure_point_spacings(*source_, points_box_, request_.threads);
        if (spacings.empty()) spacings = measure_point_spacings(*source_, points_box_ = measured(), request_.threads);
        double apart = spacings.empty() ? 0.0 : spacings[size_t(kShare * double(spacings.size() - 1))];
        if (apart > 0.0) apart = std::max(apart, kLeastQuanta * source_->info().quantization.scale.maxCoeff());
        if (request_.voxel_size) {
            step_ = *request_.voxel_size;
            radius_ = std::clamp(kRadius * apart, kRadius * step_, kMostRadius * step_);
            if (kMostRadius * step_ < apart * kLeastRadius)
                notes.push_back("points lie about " + number_text(apart) + " apart, and the radius reaches " + number_text(radius_) + ", 7 times --voxel-size: where points are sparse there is no surface");
            return;
        }
        if (!(apart > 0.0)) throw Error(ErrorKind::usage, path + ": points are too few, or too many coincide, to tell how far apart they lie; --radius says how far a point reaches");
        step_ = apart;
        radius_ = kRadius * apart;
    }

    static std::string number_text(double value) {
        char text[32];
        std::snprintf(text, sizeof text, "%.3g", value);
        return text;
    }

    void say_what_points_are() {
        if (!request_.radius) notes.push_back("--radius " + number_text(radius_) + (request_.voxel_size ? "" : " and --voxel-size " + number_text(step_)) + ", as points lie");
        if (found_.without_normal > 0) notes.push_back("normals of " + with_commas(found_.without_normal) + " points cannot be told from their neighbors, and the points are left out");
        if (found_.oriented)
            notes.push_back(std::string(found_.has_normals ? "all normals of the points look up" : "the points have no normals: they are those of planes through neighbors") +
                            "; which side is outside was chosen, for " + with_commas(found_.components) + (found_.components == 1 ? " part" : " parts") + " one by one");
    }

    PointSurfaceReport found_;
};

}  // namespace

std::unique_ptr<SurfaceInput> surface_of_balls(std::span<const std::string> words, const SurfaceRequest& request) {
    return std::make_unique<BallsInput>(words, request);
}

std::unique_ptr<SurfaceInput> smooth_surface(std::span<const std::string> words, const SurfaceRequest& request) {
    return std::make_unique<SmoothInput>(words, request);
}

}  // namespace strata
