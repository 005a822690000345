#pragma once

#include "app/commands/surface_attributes.h"
#include "app/commands/surface_input.h"
#include "core/surface/contour.h"

namespace strata {

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
