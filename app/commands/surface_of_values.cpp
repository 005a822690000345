// Surfaces of values on a grid: volumes and .vdb grids.
#include "app/commands/surface_inputs.h"

#include "app/commands/contour_input.h"
#include "app/commands/isovalues.h"
#include "app/commands/slices_with_progress.h"
#include "core/error.h"
#include "io/vdb/vdb_field.h"

namespace strata {
namespace {

class VolumeInput : public ContourInput {
public:
    VolumeInput(const std::string& path, const SurfaceRequest& request)
        : ContourInput(request, ContourInside::above), volume_(request.raw ? open_raw_volume(open_file(path), *request.raw) : open_volume(path)) {
        refuse_flags_of_voxels(request);
        if (!request.grid.empty()) throw Error(ErrorKind::usage, "--grid: " + path + " is no .vdb file");
        notes = volume_->header().notes;
        if (settings_.isovalues.empty()) {
            const VolumeRange range = volume_->measure();
            throw isovalue_expected(path, range.values > 0 ? range.min : 1.0, range.values > 0 ? range.max : 0.0);
        }
        set_colors();
        attributes_ = SurfaceAttributes::of_volumes(*volume_, request, request.memory_bytes / 2);
        settings_.memory_beside = attributes_.memory_bytes();
        settings_.memory_bytes -= settings_.memory_beside;
        notes.insert(notes.end(), attributes_.notes().begin(), attributes_.notes().end());
    }

    Box3d bounds() const override { return volume_->header().box_around(1.0); }
    double edge() const override { return volume_->placement().axes.colwise().norm().minCoeff(); }

    void extract(SurfaceSink& out, ProgressLine& progress) override {
        SlicesWithProgress slices(*volume_, progress);
        const ContourReport found = attributes_.extract_with(out, [&](SurfaceSink& sink) { return contour_slices(slices, settings_, sink); });
        say_what_was_found(found, found.least, found.greatest);
    }

private:
    std::unique_ptr<VolumeSource> volume_;
};

class GridInput : public ContourInput {
public:
    GridInput(const std::string& path, const SurfaceRequest& request)
        : ContourInput(request, ContourInside::above), field_(open_vdb_field(path, {.grid = request.grid, .memory_bytes = request.memory_bytes / parts_for(request), .memory_parts = request.memory_parts * parts_for(request), .scratch = request.scratch})) {
        settings_.memory_bytes = request.memory_bytes / 2;
        settings_.memory_parts = request.memory_parts * 2;
        refuse_flags_of_voxels(request);
        const bool is_level_set = field_->grid().grid_class == "level set";
        if (is_level_set && !request.inside) settings_.inside = ContourInside::below;
        if (is_level_set && settings_.isovalues.empty()) settings_.isovalues = {0.0};
        if (settings_.isovalues.empty())
            throw isovalue_expected(path + ", grid " + field_->grid().name + ",", field_->least(), field_->greatest());
        for (const double isovalue : settings_.isovalues) {
            const bool below = settings_.inside == ContourInside::below;
            if (below ? field_->background() <= isovalue : field_->background() >= isovalue)
                throw Error(ErrorKind::usage, path + ": what lies far outside has the value " + value_text(field_->background()) + ", which the isovalue " + value_text(isovalue) + " takes for inside");
        }
        set_colors();
        attributes_ = SurfaceAttributes::of_grids(path, request, request.memory_bytes / 4);
    }

    Box3d bounds() const override { return field_->bounds(); }
    double edge() const override { return field_->grid().voxel_size->cwiseAbs().minCoeff(); }
    void extract(SurfaceSink& out, ProgressLine& progress) override {
        BricksWithProgress bricks(*field_, field_->least_index().z(), int64_t{field_->greatest_index().z()} + 1, field_->bricks() * kFieldBrickSamples, progress);
        const ContourReport found = attributes_.extract_with(out, [&](SurfaceSink& sink) { return contour_bricks(bricks, settings_, sink); });
        say_what_was_found(found, field_->least(), field_->greatest());
    }

private:
    // The field has one of so many parts of the memory; attributes have as much.
    static uint64_t parts_for(const SurfaceRequest& request) { return request.attributes.empty() ? 2 : 4; }

    std::unique_ptr<VdbField> field_;
};

}  // namespace

std::unique_ptr<SurfaceInput> surface_of_volume(const std::string& path, const SurfaceRequest& request) {
    return std::make_unique<VolumeInput>(path, request);
}

std::unique_ptr<SurfaceInput> surface_of_grid(const std::string& path, const SurfaceRequest& request) {
    return std::make_unique<GridInput>(path, request);
}

}  // namespace strata
