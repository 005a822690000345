// Surfaces by isovalues: what all kinds of values have in common.
#include "app/commands/contour_input.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "app/commands/isovalues.h"
#include "core/error.h"
#include "render/isosurface_model.h"

namespace strata {

using nlohmann::ordered_json;

bool BricksWithProgress::next_layer(FieldBrickLayer& out) {
    if (!source_.next_layer(out)) return false;
    const double share = double(out.k + kFieldBrickSide - least_k_) / double(std::max<int64_t>(layers_, 1));
    progress_.update("surface", uint64_t(std::clamp(share, 0.0, 1.0) * double(samples_)), samples_);
    return true;
}

ContourInput::ContourInput(const SurfaceRequest& request, ContourInside inside) {
    for (const auto& [given, flag] : {std::pair(request.quads, "--quads"), std::pair(!request.transparent.empty(), "--transparent")})
        if (given) throw Error(ErrorKind::usage, std::string(flag) + " is for --method cubes");
    settings_ = {.isovalues = request.isovalues, .inside = request.inside.value_or(inside), .close = request.close, .normals = request.normals, .threads = request.threads, .memory_bytes = request.memory_bytes, .memory_parts = request.memory_parts};
}

void ContourInput::add_to(ordered_json& report) const {
    const bool has_values = found_.least <= found_.greatest;
    report.update({{"isovalues", settings_.isovalues},
                   {"inside", settings_.inside == ContourInside::above ? "above" : "below"},
                   {"range", {{"min", has_values ? ordered_json(least_) : ordered_json()}, {"max", has_values ? ordered_json(greatest_) : ordered_json()}}},
                   {"nan_samples", found_.nan_samples},
                   {"meets_boundary", found_.meets_boundary},
                   {"clamped_vertices", found_.clamped_vertices},
                   {"largest_shift_cells", found_.largest_shift_cells},
                   {"ambiguous_cells", found_.ambiguous_cells},
                   {"tunnel_cells", found_.tunnel_cells}});
}

void ContourInput::refuse_flags_of_voxels(const SurfaceRequest& request) {
    if (request.method == SurfaceMethod::cubes) throw Error(ErrorKind::usage, "--method cubes is for voxels, and what voxelize makes voxels of; of values on a grid marching-cubes makes a surface");
    for (const auto& [given, flag] : {std::pair(request.voxel_size.has_value(), "--voxel-size"), std::pair(request.error.has_value(), "--error")})
        if (given) throw Error(ErrorKind::usage, std::string(flag) + " is for voxels; here the grid says where samples lie");
}

void ContourInput::set_colors() {
    if (settings_.isovalues.size() < 2) return;
    for (size_t i = 0; i < settings_.isovalues.size(); ++i) {
        const Rgba8 color = isosurface_color(i);
        settings_.colors.push_back({red_of(color), green_of(color), blue_of(color), alpha_of(color)});
    }
}

void ContourInput::say_what_was_found(const ContourReport& found, double least, double greatest) {
    found_ = found;
    least_ = least;
    greatest_ = greatest;
    if (found.nan_samples > 0 && !settings_.open_at_nan) notes.push_back(std::to_string(found.nan_samples) + " samples are not a number, and taken for outside");
    if (!(found.least <= found.greatest)) {
        notes.emplace_back(found.nan_samples > 0 ? "no sample has a value: the surface is empty"
                                                 : "there are no cells between samples, which takes two along each axis: the surface is empty; --close makes one around a single slice");
        return;
    }
    std::string missed;
    for (const double isovalue : settings_.isovalues)
        if (found.triangles == 0 || isovalue < least || isovalue > greatest) missed += (missed.empty() ? "" : ", ") + value_text(isovalue);
    if (!missed.empty()) notes.push_back("no surface at isovalue " + missed + ": values are from " + values_text(least, greatest) + (found.triangles == 0 ? ", and the mesh is empty" : ""));
}

}  // namespace strata
