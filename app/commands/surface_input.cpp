// What strata surface makes surfaces of: volumes, grids, voxels, and what voxels can be made of.
#include "app/commands/surface_input.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>

#include "app/commands/voxel_input.h"
#include "core/error.h"
#include "core/surface/cube_surface.h"
#include "core/voxel/voxel_bounds.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/format.h"
#include "io/svo/svo_file.h"
#include "io/vdb/vdb_slices.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

std::string number_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.9g", value);
    return text;
}
std::string range_text(double least, double greatest) { return number_text(least) + " to " + number_text(greatest); }

// Surfaces of several isovalues are told apart by these, over and over.
constexpr std::array<std::array<uint8_t, 4>, 6> kIsoColors = {{{230, 200, 170, 255}, {120, 170, 220, 255}, {150, 200, 120, 255}, {220, 130, 110, 255}, {190, 150, 210, 255}, {210, 210, 110, 255}}};

/// A surface by isovalues.
class ContourInput : public SurfaceInput {
public:
    SurfaceMethod method() const override { return SurfaceMethod::marching_cubes; }
    bool has_normals() const override { return settings_.normals; }
    bool has_colors() const override { return !settings_.colors.empty(); }
    void add_to(ordered_json& report) const override {
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

protected:
    ContourInput(const SurfaceRequest& request, ContourInside inside) {
        if (request.method == SurfaceMethod::cubes) throw Error(ErrorKind::usage, "--method cubes is for voxels, and what voxelize makes voxels of; of values on a grid marching-cubes makes a surface");
        for (const auto& [given, flag] : {std::pair(request.voxel_size.has_value(), "--voxel-size"), std::pair(request.error.has_value(), "--error")})
            if (given) throw Error(ErrorKind::usage, std::string(flag) + " is for --method cubes; here the grid says where samples lie");
        settings_ = {.isovalues = request.isovalues, .inside = request.inside.value_or(inside), .close = request.close, .normals = request.normals, .threads = request.threads, .memory_bytes = request.memory_bytes};
    }

    // After the isovalues are known.
    void set_colors() {
        if (settings_.isovalues.size() < 2) return;
        for (size_t i = 0; i < settings_.isovalues.size(); ++i) settings_.colors.push_back(kIsoColors[i % kIsoColors.size()]);
    }
    // least, greatest  of all values
    void say_what_was_found(const ContourReport& found, double least, double greatest) {
        found_ = found;
        least_ = least;
        greatest_ = greatest;
        if (found.nan_samples > 0) notes.push_back(std::to_string(found.nan_samples) + " samples are not a number, and taken for outside");
        if (found.triangles > 0) return;
        if (!(found.least <= found.greatest)) {
            notes.emplace_back("no sample has a value: the surface is empty");
            return;
        }
        std::string isovalues;
        for (const double isovalue : settings_.isovalues) isovalues += (isovalues.empty() ? "" : ", ") + number_text(isovalue);
        notes.push_back("no surface at isovalue " + isovalues + ": values are from " + range_text(least, greatest) + ", and the mesh is empty");
    }

    ContourSettings settings_;

private:
    ContourReport found_;
    double least_ = 0.0, greatest_ = 0.0;
};

/// Slices of a volume on their way to the surface, with a line of progress.
class SlicesWithProgress : public SliceSource {
public:
    SlicesWithProgress(SliceSource& source, ProgressLine& progress) : source_(source), progress_(progress) {}
    const GridPlacement& placement() const override { return source_.placement(); }
    std::array<uint32_t, 3> size() const override { return source_.size(); }
    void read(uint32_t count, double reference, std::span<float> out) override {
        source_.read(count, reference, out);
        progress_.update("surface", done_ += out.size(), uint64_t{size()[0]} * size()[1] * size()[2]);
    }

private:
    SliceSource& source_;
    ProgressLine& progress_;
    uint64_t done_ = 0;
};

class VolumeInput : public ContourInput {
public:
    VolumeInput(const std::string& path, const SurfaceRequest& request)
        : ContourInput(request, ContourInside::above), volume_(request.raw ? open_raw_volume(open_file(path), *request.raw) : open_volume(path)) {
        if (!request.grid.empty()) throw Error(ErrorKind::usage, "--grid: " + path + " is no .vdb file");
        notes = volume_->header().notes;
        if (settings_.isovalues.empty()) {
            const VolumeRange range = volume_->measure();
            throw Error(ErrorKind::usage, "--iso V is expected; the values of " + path + (range.values > 0 ? " are from " + range_text(range.min, range.max) : " are all not a number"));
        }
        set_colors();
    }

    Box3d bounds() const override {
        Box3d box;
        for (int corner = 0; corner < 8; ++corner) {
            Vec3d index;
            for (int axis = 0; axis < 3; ++axis) index[axis] = corner >> axis & 1 ? volume_->size()[size_t(axis)] : -1.0;
            box.extend(volume_->placement().world_from_index(index));
        }
        return box;
    }
    double edge() const override { return volume_->placement().axes.colwise().norm().minCoeff(); }

    void extract(SurfaceSink& out, ProgressLine& progress) override {
        SlicesWithProgress slices(*volume_, progress);
        const ContourReport found = contour_slices(slices, settings_, out);
        say_what_was_found(found, found.least, found.greatest);
    }

private:
    std::unique_ptr<VolumeSource> volume_;
};

class GridInput : public ContourInput {
public:
    GridInput(const std::string& path, const SurfaceRequest& request)
        : ContourInput(request, ContourInside::above), field_(open_vdb_field(path, {.grid = request.grid, .memory_bytes = request.memory_bytes, .scratch = request.scratch})) {
        const bool is_level_set = field_->grid().grid_class == "level set";
        if (is_level_set && !request.inside) settings_.inside = ContourInside::below;
        if (is_level_set && settings_.isovalues.empty()) settings_.isovalues = {0.0};
        if (settings_.isovalues.empty())
            throw Error(ErrorKind::usage, "--iso V is expected for a grid that is no level set; the values of " + path + ", grid " + field_->grid().name + ", are from " + range_text(field_->least(), field_->greatest()));
        for (const double isovalue : settings_.isovalues) {
            const bool below = settings_.inside == ContourInside::below;
            if (below ? field_->background() <= isovalue : field_->background() >= isovalue)
                throw Error(ErrorKind::usage, path + ": what lies far outside has the value " + number_text(field_->background()) + ", which the isovalue " + number_text(isovalue) + " takes for inside");
        }
        set_colors();
    }

    Box3d bounds() const override { return field_->bounds(); }
    double edge() const override { return field_->grid().voxel_size->cwiseAbs().minCoeff(); }
    void extract(SurfaceSink& out, ProgressLine& progress) override {
        VdbSlices dense(*field_);
        SlicesWithProgress slices(dense, progress);
        say_what_was_found(contour_slices(slices, settings_, out), field_->least(), field_->greatest());
    }

private:
    std::unique_ptr<VdbField> field_;
};

/// Faces of voxels.
class CubesInput : public SurfaceInput {
public:
    SurfaceMethod method() const override { return SurfaceMethod::cubes; }
    Box3d bounds() const override { return occupied_bounds(tree_); }
    double edge() const override { return cell_size(settings_.depth); }
    bool has_normals() const override { return false; }
    bool has_colors() const override { return settings_.colors; }
    void extract(SurfaceSink& out, ProgressLine&) override {
        counts_ = mesh_cubes(tree_, settings_, out);
        if (counts_.solid_voxels == 0) notes.emplace_back("there are no voxels: the mesh is empty");
    }
    void add_to(ordered_json& report) const override {
        report.update({{"cell_size", edge()}, {"solid_voxels", counts_.solid_voxels}, {"faces_uncut", counts_.faces_uncut}, {"faces_culled", counts_.faces_culled}, {"rectangles", counts_.rectangles}});
    }

protected:
    explicit CubesInput(const SurfaceRequest& request) : settings_{.threads = request.threads} {
        if (request.method == SurfaceMethod::marching_cubes) throw Error(ErrorKind::usage, "--method marching-cubes is for volumes and .vdb files so far; here --method cubes makes a surface");
        for (const auto& [given, flag] : {std::pair(!request.isovalues.empty(), "--iso"), std::pair(request.inside.has_value(), "--inside"), std::pair(request.normals, "--normals")})
            if (given) throw Error(ErrorKind::usage, std::string(flag) + " is for --method marching-cubes");
    }

    // A step between two cells of a depth, world units.
    double cell_size(int depth) const { return tree_.frame.side() * tree_.frame.voxel_size * std::ldexp(1.0, -depth); }

    void take(VoxelTree tree) {
        tree_ = std::move(tree);
        settings_.depth = std::max(tree_.depth(), 1);
        settings_.colors = std::any_of(tree_.attributes.begin(), tree_.attributes.end(), [](const CellAttributes& cells) { return !cells.colors.empty(); });
    }

    CubeSurfaceSettings settings_;
    VoxelTree tree_;

private:
    CubeSurfaceCounts counts_;
};

/// Voxels of a file.
class VoxelFileInput : public CubesInput {
public:
    VoxelFileInput(const std::string& path, const SurfaceRequest& request) : CubesInput(request) {
        if (!request.grid.empty()) throw Error(ErrorKind::usage, "--grid: " + path + " is no .vdb file");
        const SvoFile file = open_svo(path);
        const uint64_t room = request.memory_bytes / 2;
        int levels = file.frame().levels;
        if (request.voxel_size) levels = std::min(levels, levels_of(file.frame(), *request.voxel_size));
        if (file.memory_bytes(levels, true) > room) {
            levels = file.levels_within(room, true);
            notes.push_back("--memory has room for cells of " + number_text(file.frame().voxel_size * std::ldexp(1.0, 2 * (file.frame().levels - levels))) + ", coarser than asked for");
        }
        take(file.load(levels, true, request.threads));
        if (request.voxel_size) settings_.depth = std::clamp(depth_of(*request.voxel_size), 1, settings_.depth);
        if (request.error && !tree_.empty()) settings_.depth = depth_of_error(tree_, *request.error);
    }

private:
    // The least depth whose cells are no larger.
    int depth_of(double size) const {
        int depth = 1;
        while (depth < tree_.depth() && cell_size(depth) > size * (1.0 + 1e-9)) ++depth;
        return depth;
    }
    static int levels_of(const VoxelFrame& frame, double size) {
        int levels = 1;
        while (levels < frame.levels && frame.voxel_size * std::ldexp(1.0, 2 * (frame.levels - levels)) > size * (1.0 + 1e-9)) ++levels;
        return levels;
    }
};

/// Voxels that are made for it.
class VoxelizedInput : public CubesInput {
public:
    VoxelizedInput(std::span<const std::string> words, bool is_grid, const SurfaceRequest& request) : CubesInput(request) {
        if (request.error) throw Error(ErrorKind::usage, "--error is for .svo files; --voxel-size is expected here");
        if (!is_grid && !request.voxel_size) throw Error(ErrorKind::usage, "--voxel-size S is expected, to make voxels of " + words[0]);
        VoxelRequest voxels = {.voxel_size = request.voxel_size.value_or(1.0), .grid = request.grid, .scratch_folder = request.scratch_folder, .threads = request.threads, .memory_bytes = request.memory_bytes / 2};
        if (request.voxel_size) voxels.not_for_grids = "--voxel-size";
        if (!request.grid.empty()) voxels.for_grids = "--grid";
        input_ = open_voxel_input(words, voxels);
        memory_ = request.memory_bytes / 2;
        voxelize();
    }

private:
    void voxelize() {
        ProgressLine progress(true);
        for (bool again = false;; again = true) {
            const VoxelAttributes attributes = {.color = input_->attributes().color};
            VoxelTreeInMemory tree(input_->frame(), attributes, memory_);
            VoxelTreeBuilder builder(input_->frame(), attributes, tree);
            const bool done = input_->voxelize([&](const VoxelBatch& batch) { builder.add(batch); }, progress);
            builder.finish();
            if (done) {
                take(tree.take());
                notes = input_->notes;
                input_.reset();
                return;
            }
            if (again) throw Error(ErrorKind::malformed, "points lie outside of their own bounds");
        }
    }

    std::unique_ptr<VoxelInput> input_;
    uint64_t memory_ = 0;
};

}  // namespace

std::unique_ptr<SurfaceInput> open_surface_input(std::span<const std::string> words, const SurfaceRequest& request) {
    const std::string& path = words[0];
    const bool one = words.size() == 1 && !std::filesystem::is_directory(path);
    if (request.raw) {
        if (!one) throw Error(ErrorKind::usage, "--dimensions: one file of samples is expected");
        return std::make_unique<VolumeInput>(path, request);
    }
    const bool cubes = request.method == SurfaceMethod::cubes;
    for (const std::string& word : words) {
        if (std::filesystem::is_directory(word)) continue;
        const FormatKind kind = identify_format(word).kind;
        if (words.size() > 1 && kind != FormatKind::points && kind != FormatKind::layered)
            throw Error(ErrorKind::usage, word + ": one volume, grid, mesh or voxel file at a time is expected; only points may come in several files");
        if (kind == FormatKind::volume) return std::make_unique<VolumeInput>(word, request);
        if (kind == FormatKind::voxels) return std::make_unique<VoxelFileInput>(word, request);
        if (kind == FormatKind::grids && !cubes) return std::make_unique<GridInput>(word, request);
    }
    if (!cubes) throw Error(ErrorKind::usage, path + ": a volume, a .vdb or a .svo file is expected; of meshes and points --method cubes with --voxel-size makes a surface");
    return std::make_unique<VoxelizedInput>(words, one && identify_format(path).kind == FormatKind::grids, request);
}

}  // namespace strata
