#pragma once

#include "app/commands/surface_attributes.h"
#include "app/commands/surface_input.h"
#include "core/surface/contour.h"

namespace strata {

/// Bricks of a field on their way to the surface, with a line of progress that goes by layers.
class BricksWithProgress : public FieldBrickSource {
public:
    /// least_k, end_k  where layers begin and end
    /// samples         of the field, about
    BricksWithProgress(FieldBrickSource& source, int64_t least_k, int64_t end_k, uint64_t samples, ProgressLine& progress)
        : source_(source), least_k_(least_k), layers_(end_k - least_k), samples_(samples), progress_(progress) {}
    const GridPlacement& placement() const override { return source_.placement(); }
    float background() const override { return source_.background(); }
    float absent_value(const std::array<int32_t, 3>& corner) const override { return source_.absent_value(corner); }
    bool next_layer(FieldBrickLayer& out) override;

private:
    FieldBrickSource& source_;
    int64_t least_k_, layers_;
    uint64_t samples_;
    ProgressLine& progress_;
};

/// A surface by isovalues.
class ContourInput : public SurfaceInput {
public:
    SurfaceMethod method() const override { return SurfaceMethod::marching_cubes; }
    bool has_normals() const override { return settings_.normals; }
    bool has_colors() const override { return !settings_.colors.empty() || attributes_.has_colors(); }
    std::vector<std::string> scalar_names() const override { return attributes_.names(); }
    void add_to(nlohmann::ordered_json& report) const override;

protected:
    ContourInput(const SurfaceRequest& request, ContourInside inside);

    /// Of what has samples of its own.
    static void refuse_flags_of_voxels(const SurfaceRequest& request);
    /// After the isovalues are known: those that render shows them in.
    void set_colors();
    /// least, greatest  of all values
    void say_what_was_found(const ContourReport& found, double least, double greatest);

    ContourSettings settings_;
    SurfaceAttributes attributes_;

private:
    ContourReport found_;
    double least_ = 0.0, greatest_ = 0.0;
};

}  // namespace strata
