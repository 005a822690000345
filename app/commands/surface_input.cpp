// What strata surface makes surfaces of: volumes, grids, voxels, and what voxels can be made of.
#include "app/commands/surface_input.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string_view>

#include "app/commands/isovalues.h"
#include "app/commands/voxel_input.h"
#include "app/quantity_text.h"
#include "core/cloud/cloud_statistics.h"
#include "core/error.h"
#include "core/surface/coverage_field.h"
#include "core/surface/cube_surface.h"
#include "core/surface/point_balls.h"
#include "core/voxel/voxel_bounds.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/format.h"
#include "io/svo/svo_file.h"
#include "io/vdb/vdb_field.h"
#include "render/isosurface_model.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

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
        for (const auto& [given, flag] : {std::pair(request.quads, "--quads"), std::pair(!request.transparent.empty(), "--transparent")})
            if (given) throw Error(ErrorKind::usage, std::string(flag) + " is for --method cubes");
        settings_ = {.isovalues = request.isovalues, .inside = request.inside.value_or(inside), .close = request.close, .normals = request.normals, .threads = request.threads, .memory_bytes = request.memory_bytes};
    }

    // Of what has samples of its own.
    static void refuse_flags_of_voxels(const SurfaceRequest& request) {
        if (request.method == SurfaceMethod::cubes) throw Error(ErrorKind::usage, "--method cubes is for voxels, and what voxelize makes voxels of; of values on a grid marching-cubes makes a surface");
        for (const auto& [given, flag] : {std::pair(request.voxel_size.has_value(), "--voxel-size"), std::pair(request.error.has_value(), "--error")})
            if (given) throw Error(ErrorKind::usage, std::string(flag) + " is for voxels; here the grid says where samples lie");
    }
    // After the isovalues are known: those that render shows them in.
    void set_colors() {
        if (settings_.isovalues.size() < 2) return;
        for (size_t i = 0; i < settings_.isovalues.size(); ++i) {
            const Rgba8 color = isosurface_color(i);
            settings_.colors.push_back({red_of(color), green_of(color), blue_of(color), alpha_of(color)});
        }
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
        for (const double isovalue : settings_.isovalues) isovalues += (isovalues.empty() ? "" : ", ") + value_text(isovalue);
        notes.push_back("no surface at isovalue " + isovalues + ": values are from " + values_text(least, greatest) + ", and the mesh is empty");
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
        refuse_flags_of_voxels(request);
        if (!request.grid.empty()) throw Error(ErrorKind::usage, "--grid: " + path + " is no .vdb file");
        notes = volume_->header().notes;
        if (settings_.isovalues.empty()) {
            const VolumeRange range = volume_->measure();
            throw isovalue_expected(path, range.values > 0 ? range.min : 1.0, range.values > 0 ? range.max : 0.0);
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
        : ContourInput(request, ContourInside::above), field_(open_vdb_field(path, {.grid = request.grid, .memory_bytes = request.memory_bytes / 2, .scratch = request.scratch})) {
        settings_.memory_bytes = request.memory_bytes / 2;
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
    }

    Box3d bounds() const override { return field_->bounds(); }
    double edge() const override { return field_->grid().voxel_size->cwiseAbs().minCoeff(); }
    void extract(SurfaceSink& out, ProgressLine&) override { say_what_was_found(contour_bricks(*field_, settings_, out), field_->least(), field_->greatest()); }

private:
    std::unique_ptr<VdbField> field_;
};

/// Voxels to make a surface of, and the depth whose cells are taken.
struct SurfaceVoxels {
    VoxelTree tree;
    int depth = 1;
    std::vector<std::string> notes;

    // A step between two cells of a depth, world units.
    double cell_size(int of_depth) const { return tree.frame.side() * tree.frame.voxel_size * std::ldexp(1.0, -of_depth); }
    double cell_size() const { return cell_size(depth); }
    bool has_colors() const {
        return std::any_of(tree.attributes.begin(), tree.attributes.end(), [](const CellAttributes& cells) { return !cells.colors.empty(); });
    }
};

// A size that was computed, or typed with a few digits, is as large as another all the same.
bool is_larger(double size, double other) { return size > other * (1.0 + 1e-9); }

// method  that of cubes needs no finer cells than it takes, the other counts voxels in them
SurfaceVoxels load_voxels(const std::string& path, SurfaceMethod method, const SurfaceRequest& request) {
    if (!request.grid.empty()) throw Error(ErrorKind::usage, "--grid: " + path + " is no .vdb file");
    if (request.voxel_size && request.error) throw Error(ErrorKind::usage, "--voxel-size and --error: one of them is expected");
    SurfaceVoxels voxels;
    const SvoFile file = open_svo(path);
    const VoxelFrame& frame = file.frame();
    const auto size_of_level = [&](int levels) { return frame.voxel_size * std::ldexp(1.0, 2 * (frame.levels - levels)); };
    const uint64_t room = request.memory_bytes / 2;
    int levels = frame.levels;
    while (method == SurfaceMethod::cubes && request.voxel_size && levels > 1 && !is_larger(size_of_level(levels - 1), *request.voxel_size)) --levels;
    if (file.memory_bytes(levels, true) > room) {
        levels = file.levels_within(room, true);
        voxels.notes.push_back("--memory has room for cells of " + value_text(size_of_level(levels)) + ", coarser than asked for");
    }
    voxels.tree = file.load(levels, true, request.threads);
    voxels.depth = std::max(voxels.tree.depth(), 1);
    if (request.voxel_size)
        while (voxels.depth > 1 && !is_larger(voxels.cell_size(voxels.depth - 1), *request.voxel_size)) --voxels.depth;
    if (request.error && !voxels.tree.empty()) voxels.depth = depth_of_error(voxels.tree, *request.error);
    return voxels;
}

SurfaceVoxels make_voxels(std::span<const std::string> words, bool is_grid, const SurfaceRequest& request) {
    if (request.error) throw Error(ErrorKind::usage, "--error is for .svo files; --voxel-size is expected here");
    if (!is_grid && !request.voxel_size) throw Error(ErrorKind::usage, "--voxel-size S is expected, to make voxels of " + words[0]);
    VoxelRequest voxel_request = {.voxel_size = request.voxel_size.value_or(1.0), .grid = request.grid, .scratch_folder = request.scratch_folder, .threads = request.threads, .memory_bytes = request.memory_bytes / 2};
    if (request.voxel_size) voxel_request.not_for_grids = "--voxel-size";
    if (!request.grid.empty()) voxel_request.for_grids = "--grid";
    const std::unique_ptr<VoxelInput> input = open_voxel_input(words, voxel_request);
    ProgressLine progress(true);
    for (bool again = false;; again = true) {
        const VoxelAttributes attributes = {.color = input->attributes().color};
        VoxelTreeInMemory memory(input->frame(), attributes, request.memory_bytes / 2);
        VoxelTreeBuilder builder(input->frame(), attributes, memory);
        const bool done = input->voxelize([&](const VoxelBatch& batch) { builder.add(batch); }, progress);
        builder.finish();
        if (!done && again) throw Error(ErrorKind::malformed, words[0] + ": points lie outside of their own bounds");
        if (!done) continue;
        SurfaceVoxels voxels{.tree = memory.take(), .notes = input->notes};
        voxels.depth = std::max(voxels.tree.depth(), 1);
        return voxels;
    }
}

/// Faces of voxels.
class CubesInput : public SurfaceInput {
public:
    CubesInput(SurfaceVoxels voxels, const SurfaceRequest& request) : voxels_(std::move(voxels)) {
        for (const auto& [given, flag] : {std::pair(!request.isovalues.empty(), "--iso"), std::pair(request.inside.has_value(), "--inside")})
            if (given) throw Error(ErrorKind::usage, std::string(flag) + " is for --method marching-cubes");
        notes = voxels_.notes;
        settings_ = {.depth = voxels_.depth,
                     .joints = request.quads ? CubeSurfaceSettings::Joints::separate : CubeSurfaceSettings::Joints::closed,
                     .normals = request.normals,
                     .colors = voxels_.has_colors(),
                     .transparent = request.transparent,
                     .threads = request.threads,
                     .memory_bytes = request.memory_bytes / 2};
    }

    SurfaceMethod method() const override { return SurfaceMethod::cubes; }
    Box3d bounds() const override { return occupied_bounds(voxels_.tree); }
    double edge() const override { return voxels_.cell_size(); }
    bool has_normals() const override { return settings_.normals; }
    bool has_colors() const override { return settings_.colors; }
    void extract(SurfaceSink& out, ProgressLine&) override {
        counts_ = mesh_cubes(voxels_.tree, settings_, out);
        if (counts_.solid_voxels == 0) notes.emplace_back("there are no voxels: the mesh is empty");
    }
    void add_to(ordered_json& report) const override {
        report.update({{"cell_size", edge()}, {"solid_voxels", counts_.solid_voxels}, {"faces_uncut", counts_.faces_uncut}, {"faces_culled", counts_.faces_culled}, {"rectangles", counts_.rectangles}});
    }

private:
    SurfaceVoxels voxels_;
    CubeSurfaceSettings settings_;
    CubeSurfaceCounts counts_;
};

/// How much of cells is occupied, as values on a grid.
class CoverageInput : public ContourInput {
public:
    CoverageInput(SurfaceVoxels voxels, const SurfaceRequest& request) : ContourInput(request, ContourInside::above), voxels_(std::move(voxels)) {
        if (settings_.isovalues.empty()) settings_.isovalues = {0.5};
        const bool below = settings_.inside == ContourInside::below;
        for (const double isovalue : settings_.isovalues)
            if (below || isovalue <= 0.0) throw Error(ErrorKind::usage, below ? "--inside below is not for voxels: nothing is outside" : "--iso: of voxels it is a share above 0, got " + value_text(isovalue));
        set_colors();
        notes = voxels_.notes;
    }

    Box3d bounds() const override { return occupied_bounds(voxels_.tree); }
    double edge() const override { return voxels_.cell_size(); }
    void extract(SurfaceSink& out, ProgressLine&) override {
        if (voxels_.tree.empty()) {
            notes.emplace_back("there are no voxels: the mesh is empty");
            return;
        }
        CoverageField field(voxels_.tree, voxels_.depth, settings_.threads, settings_.memory_bytes / 2);
        say_what_was_found(contour_bricks(field, settings_, out), 0.0, 1.0);
    }

private:
    SurfaceVoxels voxels_;
};

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

// What is stored sparsely ends before its grid does, and cubes are closed.
void refuse_close(const SurfaceRequest& request) {
    if (request.close) throw Error(ErrorKind::usage, "--close is for volumes; this surface meets no boundary");
}

std::unique_ptr<SurfaceInput> surface_of_voxels(SurfaceVoxels voxels, SurfaceMethod method, const SurfaceRequest& request) {
    if (method == SurfaceMethod::cubes) return std::make_unique<CubesInput>(std::move(voxels), request);
    return std::make_unique<CoverageInput>(std::move(voxels), request);
}

std::unique_ptr<SurfaceInput> surface_of_file(const std::string& path, SurfaceMethod method, const SurfaceRequest& request) {
    return surface_of_voxels(load_voxels(path, method, request), method, request);
}

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
        const char* const without_points = kind == FormatKind::mesh ? "meshes" : kind == FormatKind::voxels ? "voxels" : kind == FormatKind::volume || kind == FormatKind::grids ? "values on a grid" : nullptr;
        if (request.radius && without_points != nullptr) throw Error(ErrorKind::usage, word + ": --radius is not for " + without_points + "; it is for points");
        if (kind == FormatKind::volume) return std::make_unique<VolumeInput>(word, request);
        refuse_close(request);
        if (kind == FormatKind::voxels) return surface_of_file(word, request.method.value_or(SurfaceMethod::cubes), request);
        if (kind == FormatKind::grids && !cubes) return std::make_unique<GridInput>(word, request);
    }
    refuse_close(request);  // folders of points
    if (request.radius) {
        if (cubes) throw Error(ErrorKind::usage, "--radius makes a surface of balls, --method cubes one of voxels");
        return std::make_unique<BallsInput>(words, request);
    }
    if (!request.method) throw Error(ErrorKind::usage, path + ": of points and meshes --method cubes or marching-cubes with --voxel-size makes a surface, of points also --radius");
    return surface_of_voxels(make_voxels(words, one && identify_format(path).kind == FormatKind::grids, request), *request.method, request);
}

}  // namespace strata
