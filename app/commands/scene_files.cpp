#include "app/commands/scene_files.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <span>

#include "app/commands/isovalues.h"
#include "app/quantity_text.h"
#include "core/cloud/preview_source.h"
#include "core/error.h"
#include "core/octree/memory_cloud.h"
#include "core/voxel/voxel_tree_builder.h"
#include "io/format.h"
#include "io/mesh/mesh_reader.h"
#include "io/svo/svo_file.h"
#include "io/vdb/vdb_field.h"
#include "io/vdb/vdb_voxels.h"
#include "io/volume/volume_source.h"
#include "render/mesh_colors.h"
#include "render/mesh_model.h"
#include "render/pass/mesh_pass.h"
#include "render/voxel_model.h"

namespace strata {
namespace {

constexpr uint64_t kVoxelShare = 2;  // the part of the memory cap that voxels take at most, all files together

// Takes a few points of each file before they become one cloud, so that no more are read. An eighth of the memory is theirs:
// making their levels takes several times as much.
WrapSource preview_of(const Options& options, size_t files, uint64_t memory_bytes) {
    constexpr uint64_t kMostPoints = 2'000'000;
    const uint64_t points = std::max<uint64_t>(kMostPoints / files, 1), bytes = memory_bytes / 8 / files;
    return [points, bytes, threads = thread_count(options)](std::unique_ptr<PointSource> source) {
        uint64_t point_bytes = 3 * sizeof(int32_t);
        for (const Attribute& attribute : source->info().attributes) point_bytes += attribute.size_bytes();
        return std::make_unique<PreviewSource>(*source, std::clamp<uint64_t>(bytes / point_bytes, 1, points), threads);
    };
}

std::unique_ptr<LayeredCloud> open_cloud(const Options& options, std::span<const std::string> words, uint64_t memory_bytes) {
    const std::vector<std::string> paths = point_files(words);
    if (paths.size() == 1 && identify_format(paths[0]).kind == FormatKind::layered) return open_layered(paths[0]);
    const std::unique_ptr<PointSource> source = open_points(paths, {.wrap = options.given("--preview") ? preview_of(options, paths.size(), memory_bytes) : WrapSource()});
    for (const std::string& note : source->info().notes)
        if (paths.size() > 1 && !options.given("--quiet")) std::fprintf(stderr, "note: %s\n", note.c_str());
    BuildSettings settings;
    settings.threads = thread_count(options);
    settings.memory_bytes = memory_bytes;
    try {
        return build_memory_cloud(*source, settings);
    } catch (const Error& error) {
        if (error.kind != ErrorKind::limit) throw;
        throw Error(ErrorKind::limit, paths[0] + (paths.size() > 1 ? " and the others" : "") + ": " + with_commas(source->info().points) +
                                          " points and their levels of detail do not fit under --memory " + size_text(settings.memory_bytes) +
                                          "; `strata convert` takes any size");
    }
}

// Attributes are read where colors or normals may come from them.
bool wants_attributes(const Options& options) {
    constexpr std::string_view kWithout[] = {"plain", "elevation", "lod"};
    return options.text("--voxels") == "smooth" || std::find(std::begin(kWithout), std::end(kWithout), options.text("--color")) == std::end(kWithout);
}

OpenedVoxels open_grid(const std::string& path, uint64_t memory_bytes) {
    const VdbVoxels grid = read_vdb_voxels(path, {.memory_bytes = memory_bytes});
    VoxelTreeInMemory memory(grid.frame, {});
    VoxelTreeBuilder builder(grid.frame, {}, memory);
    grid.voxels.emit([&](const VoxelBatch& batch) { builder.add(batch); });
    builder.finish();
    return {path, {}, std::make_unique<VoxelTree>(memory.take())};
}

OpenedVoxels open_voxels(const Options& options, const std::string& path, uint64_t memory_bytes) {
    if (identify_format(path).kind == FormatKind::grids) return open_grid(path, memory_bytes);
    const SvoFile file = open_svo(path);
    const bool attributes = wants_attributes(options);
    const int levels = file.levels_within(memory_bytes, attributes);
    return {path, file.labels().crs, std::make_unique<VoxelTree>(file.load(levels, attributes, thread_count(options)))};
}

MeshShading mesh_shading(const Options& options) { return options.text("--mesh") == "flat" ? MeshShading::flat : MeshShading::smooth; }

OpenedMesh open_mesh(const Options& options, const std::string& path, uint64_t memory_bytes) {
    MeshReport report;
    const std::string color = options.text("--color");
    const bool may_be_attribute = !color.empty() && !MeshColors::is_rule(color);
    OpenedMesh opened = {path, std::make_unique<TriangleMesh>(read_mesh(path, {.most_bytes = memory_bytes, .triangles_needed = true, .scalars = may_be_attribute}, &report))};
    std::vector<MeshScalars>& scalars = opened.mesh->scalars;
    if (const size_t wanted = find_mesh_scalars(*opened.mesh, color); wanted < scalars.size()) scalars = {std::move(scalars[wanted])};  // the others are not drawn
    for (const std::string& note : report.notes)
        if (!options.given("--quiet")) std::fprintf(stderr, "note: %s: %s\n", path.c_str(), note.c_str());
    const MeshModelBytes bytes = mesh_model_bytes(*opened.mesh, mesh_shading(options));
    const uint64_t needed = std::max(bytes.most, bytes.kept + MeshPass::working_bytes(opened.mesh->positions.size(), 0));
    if (needed > memory_bytes)
        throw Error(ErrorKind::limit, path + ": drawing the mesh needs " + std::to_string(needed) + " bytes of memory, " + std::to_string(memory_bytes) +
                                          " are allowed; --memory gives more");
    return opened;
}

OpenedField open_field(const Options& options, const std::string& path, uint64_t memory_bytes) {
    const std::vector<double> isovalues = options.given("--iso") ? parse_isovalues(options.text("--iso")) : std::vector<double>();
    OpenedField opened = {path, nullptr, {}};
    ContourInside inside = ContourInside::above;
    const int threads = thread_count(options);
    try {
        if (identify_format(path).kind == FormatKind::grids) {
            const std::unique_ptr<VdbField> grid = open_vdb_field(path, {.grid = {}, .memory_bytes = memory_bytes / 2});
            if (grid->grid().grid_class == "level set") inside = ContourInside::below;
            opened.field = std::make_unique<FieldBricks>(FieldBricks::of_bricks(*grid, memory_bytes / 2, threads));
        } else {
            const std::unique_ptr<VolumeSource> volume = open_volume(path);
            if (isovalues.empty()) {
                const VolumeRange range = volume->measure();
                throw isovalue_expected(path, range.values > 0 ? range.min : 1.0, range.values > 0 ? range.max : 0.0);
            }
            opened.field = std::make_unique<FieldBricks>(FieldBricks::of_slices(*volume, memory_bytes, threads));
        }
        uint64_t left = memory_bytes - std::min(memory_bytes, opened.field->size_bytes());
        for (const double isovalue : isovalues) {
            opened.surfaces.emplace_back(*opened.field, IsoLevel{isovalue, inside}, threads, left);
            left -= std::min(left, size_bytes(opened.surfaces.back().cells));
        }
    } catch (const Error& error) {
        if (error.kind != ErrorKind::limit) throw;
        throw Error(ErrorKind::limit, path + ": " + error.what() + "; an isosurface is drawn from all of it in memory. --memory gives more, `strata surface` makes a mesh of any size");
    }
    for (const double isovalue : isovalues)
        if (!options.given("--quiet") && count_crossed_bricks(*opened.field, {isovalue, inside}) == 0)
            std::fprintf(stderr, "note: %s: no surface at isovalue %s; %s\n", path.c_str(), value_text(isovalue).c_str(),
                         opened.field->range().least <= opened.field->range().greatest ? ("values are from " + values_text(opened.field->range().least, opened.field->range().greatest)).c_str() : "no sample has a value");
    return opened;
}

}  // namespace

std::string SceneFiles::crs() const {
    if (cloud && !cloud->info().crs.empty()) return cloud->info().crs;
    for (const OpenedVoxels& model : voxels)
        if (!model.crs.empty()) return model.crs;
    return {};
}

SceneFiles open_scene_files(const Options& options) {
    std::vector<std::string> points, voxels, meshes, volumes;
    for (const std::string& word : options.positional) {
        const FormatKind kind = std::filesystem::is_directory(word) ? FormatKind::points : identify_format(word).kind;
        const bool field = kind == FormatKind::volume || (kind == FormatKind::grids && options.given("--iso"));
        (field ? volumes : kind == FormatKind::mesh ? meshes : kind == FormatKind::voxels || kind == FormatKind::grids ? voxels : points).push_back(word);
    }
    if (options.given("--iso") && volumes.empty()) throw Error(ErrorKind::usage, "--iso is for volumes and grids, and there are none");
    SceneFiles files;
    uint64_t left = memory_cap(options);
    for (const std::string& path : meshes) {
        files.meshes.push_back(open_mesh(options, path, left));
        left -= std::min(left, mesh_model_bytes(*files.meshes.back().mesh, mesh_shading(options)).kept);
    }
    for (const std::string& path : volumes) {
        files.fields.push_back(open_field(options, path, left));
        left -= std::min(left, files.fields.back().field->size_bytes());
        for (const FieldSurface& surface : files.fields.back().surfaces) left -= std::min(left, size_bytes(surface.cells));
    }
    for (const std::string& path : voxels) files.voxels.push_back(open_voxels(options, path, left / kVoxelShare / voxels.size()));
    for (const OpenedVoxels& model : files.voxels) left -= std::min(left, size_bytes(*model.tree));
    if (!points.empty()) files.cloud = open_cloud(options, points, left);
    return files;
}

}  // namespace strata
