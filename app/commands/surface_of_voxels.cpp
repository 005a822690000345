// Surfaces of voxels, and of what voxels can be made of.
#include "app/commands/surface_inputs.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "app/commands/contour_input.h"
#include "app/commands/isovalues.h"
#include "app/commands/voxel_input.h"
#include "core/error.h"
#include "core/surface/cell_colors.h"
#include "core/surface/coverage_field.h"
#include "core/surface/cube_surface.h"
#include "core/voxel/voxel_bounds.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/svo/svo_file.h"
#include "render/named_view.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

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

int depth_of(const CellError& error, const VoxelTree& tree) {
    if (!error.in_pixels) return depth_of_error(tree, error.most);
    Camera camera;
    if (error.camera) {
        camera = *error.camera;
    } else {
        Scene scene;
        scene.voxels.emplace_back(tree, VoxelColors(tree, "plain", std::nullopt, ""));
        camera = named_view("iso", Projection::perspective, 0.25 * std::numbers::pi, sample_positions(scene), double(error.width_px) / error.height_px);
    }
    return depth_of_error_px(tree, camera, error.width_px, error.height_px, error.most);
}

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
    if (request.error && !voxels.tree.empty()) voxels.depth = depth_of(*request.error, voxels.tree);
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
                     .memory_bytes = request.memory_bytes / 2,
                     .memory_parts = request.memory_parts * 2};
    }

    SurfaceMethod method() const override { return SurfaceMethod::cubes; }
    Box3d bounds() const override { return occupied_bounds(voxels_.tree); }
    double edge() const override { return voxels_.cell_size(); }
    bool has_normals() const override { return settings_.normals; }
    bool has_colors() const override { return settings_.colors; }
    void extract(SurfaceSink& out, ProgressLine& progress) override {
        settings_.on_progress = [&](uint64_t done, uint64_t total) { progress.update("surface", done, total); };
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
        chosen_ = !settings_.isovalues.empty();
        if (!chosen_) settings_.isovalues = {0.5};
        const bool below = settings_.inside == ContourInside::below;
        for (const double isovalue : settings_.isovalues)
            if (below || isovalue <= 0.0) throw Error(ErrorKind::usage, below ? "--inside below is not for voxels: nothing is outside" : "--iso: of voxels it is a share above 0, got " + value_text(isovalue));
        set_colors();
        notes = voxels_.notes;
        // Several isovalues have colors of their own.
        if (settings_.colors.empty() && CellColorsAtVertices::has_colors(voxels_.tree, voxels_.depth))
            attributes_.set_colors(std::make_unique<CellColorsAtVertices>(voxels_.tree, voxels_.depth, request.threads));
    }

    Box3d bounds() const override { return occupied_bounds(voxels_.tree); }
    double edge() const override { return voxels_.cell_size(); }
    void extract(SurfaceSink& out, ProgressLine& progress) override {
        if (voxels_.tree.empty()) {
            notes.emplace_back("there are no voxels: the mesh is empty");
            return;
        }
        CoverageField field(voxels_.tree, voxels_.depth, settings_.threads, settings_.memory_bytes / 2, settings_.memory_parts * 2);
        const uint64_t cells = uint64_t{1} << voxels_.depth;
        BricksWithProgress bricks(field, 0, int64_t(cells), cells * cells * cells, progress);
        const ContourReport found = attributes_.extract_with(out, [&](SurfaceSink& sink) { return contour_bricks(bricks, settings_, sink); });
        if (voxels_.depth < voxels_.tree.depth() && !chosen_)
            notes.emplace_back("a cell is inside where half of its voxels are occupied, which few are that voxels of a surface lie in: --iso 0.1 takes more of them in");
        say_what_was_found(found, 0.0, found.greatest);
    }

private:
    SurfaceVoxels voxels_;
    bool chosen_ = false;  // the isovalue, by the user
};

std::unique_ptr<SurfaceInput> surface_of(SurfaceVoxels voxels, SurfaceMethod method, const SurfaceRequest& request) {
    if (method == SurfaceMethod::cubes) return std::make_unique<CubesInput>(std::move(voxels), request);
    return std::make_unique<CoverageInput>(std::move(voxels), request);
}

}  // namespace

std::unique_ptr<SurfaceInput> surface_of_voxels(const std::string& path, SurfaceMethod method, const SurfaceRequest& request) {
    return surface_of(load_voxels(path, method, request), method, request);
}

std::unique_ptr<SurfaceInput> surface_by_voxels(std::span<const std::string> words, bool is_grid, SurfaceMethod method, const SurfaceRequest& request) {
    return surface_of(make_voxels(words, is_grid, request), method, request);
}

}  // namespace strata
