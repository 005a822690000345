// What strata voxelize makes voxels of: meshes, points and grids.
#include "app/commands/voxel_input.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <string_view>
#include <utility>

#include "app/quantity_text.h"
#include "core/cloud/cloud_statistics.h"
#include "core/error.h"
#include "core/voxel/mesh_voxels.h"
#include "core/voxel/point_voxels.h"
#include "io/format.h"
#include "io/mesh/mesh_reader.h"
#include "io/scratch_file.h"
#include "io/vdb/vdb_voxels.h"
#include "io/vdb/vdb_writer.h"

namespace strata {
namespace {

VoxelFrame frame_of(const Box3d& box, const VoxelRequest& request) {
    return request.resolution ? frame_of_resolution(box, *request.resolution) : frame_of_voxel_size(box, request.voxel_size);
}

Error wrong_kind(const VoxelRequest& request, const std::string& expected) {
    return {ErrorKind::usage, "--kind: expected " + expected + ", got '" + request.kind + "'"};
}

// What core refuses, with the file's name.
template <typename Act>
auto named(const std::string& path, const Act& act) {
    try {
        return act();
    } catch (const Error& error) {
        if (error.kind != ErrorKind::limit || std::string_view(error.what()).starts_with(path)) throw;
        throw error.within(path);
    }
}

struct ReadMesh {
    TriangleMesh mesh;
    Box3d box;  // of its triangles
    std::vector<std::string> notes;
};

ReadMesh read_triangles(const std::string& path, uint64_t memory_bytes) {
    ReadMesh read;
    MeshReport report;
    read.mesh = read_mesh(path, {.most_bytes = memory_bytes, .triangles_needed = true}, &report);
    read.notes = std::move(report.notes);
    for (const std::array<uint32_t, 3>& triangle : read.mesh.triangles)
        for (const uint32_t vertex : triangle) read.box.extend(read.mesh.positions[vertex]);
    return read;
}

class MeshInput : public VoxelInput {
public:
    MeshInput(const std::string& path, const VoxelRequest& request) : path_(path), kind_(request.kind.empty() ? "conservative" : request.kind) {
        constexpr std::array kKinds = {std::pair("conservative", VoxelKind::conservative), std::pair("thin", VoxelKind::thin), std::pair("solid", VoxelKind::solid)};
        const auto* const found = std::find_if(kKinds.begin(), kKinds.end(), [&](const auto& row) { return row.first == kind_; });
        if (found == kKinds.end()) throw wrong_kind(request, "conservative, thin, solid or level-set for a mesh");
        settings_.kind = found->second;
        if (request.attributes) attributes_ = *request.attributes;
        if (attributes_.count) throw Error(ErrorKind::usage, "--attributes: count is of points");
        if (attributes_.any_of_voxels() && settings_.kind == VoxelKind::solid) throw Error(ErrorKind::usage, "--attributes: solid voxels have opacity only");
        auto [mesh, box, remarks] = read_triangles(path, request.memory_bytes);
        mesh_ = std::move(mesh);
        notes = std::move(remarks);
        frame_ = named(path, [&] { return frame_of(box, request); });
        if (!request.attributes) attributes_.color = !mesh_.colors.empty() && settings_.kind != VoxelKind::solid;
        if (attributes_.color && mesh_.colors.empty()) throw Error(ErrorKind::usage, "--attributes: " + path + " has no colors");
        settings_.attributes = attributes_;
        settings_.attributes.opacity = false;  // of coarser cells
        settings_.threads = request.threads;
        settings_.memory_bytes = request.memory_bytes - std::min(request.memory_bytes, mesh_.size_bytes());
    }

    const std::string& kind() const override { return kind_; }
    const VoxelFrame& frame() const override { return frame_; }
    const VoxelAttributes& attributes() const override { return attributes_; }

    // A surface of area A and normal n touches A |n|_1 / h^2 voxels, and blocks of 4^3 of them at 1/16 of that, of 8 bytes each.
    uint64_t estimated_bytes() const override {
        double area = 0.0;
        for (const std::array<uint32_t, 3>& t : mesh_.triangles) {
            const Vec3d& a = mesh_.positions[t[0]];
            area += 0.5 * (mesh_.positions[t[1]] - a).cross(mesh_.positions[t[2]] - a).lpNorm<1>();
        }
        const double voxels = area / (frame_.voxel_size * frame_.voxel_size);
        return uint64_t(std::min(0.5 * voxels, 0x1p62));
    }

    bool voxelize(const VoxelSink& sink, ProgressLine& progress) override {
        settings_.on_progress = [&](const VoxelProgress& p) { progress.update("voxelizing", p.done, p.total); };
        uint64_t voxels = 0;
        named(path_, [&] {
            voxelize_mesh(mesh_, frame_, settings_, [&](const VoxelBatch& batch) {
                voxels += batch.blocks.size();
                sink(batch);
            });
        });
        if (voxels == 0 && settings_.kind == VoxelKind::solid)
            notes.push_back("no voxel's center is inside: do the triangles turn clockwise, seen from outside?");
        return true;
    }

private:
    std::string path_, kind_;
    TriangleMesh mesh_;
    VoxelFrame frame_;
    VoxelAttributes attributes_;
    MeshVoxelSettings settings_;
};

/// Occupied points of a grid, which lie where the grid says.
class GridInput : public VoxelInput {
public:
    GridInput(const std::string& path, const VoxelRequest& request) {
        if (!request.not_for_grids.empty()) throw Error(ErrorKind::usage, request.not_for_grids + ": the voxels of a .vdb file are as they are");
        voxels_ = read_vdb_voxels(path, {.grid = request.grid, .isovalue = request.isovalue, .memory_bytes = request.memory_bytes});
        kind_ = voxels_.grid.grid_class == "level set" ? "level-set" : "grid";
    }

    const std::string& kind() const override { return kind_; }
    const VoxelFrame& frame() const override { return voxels_.frame; }
    const VoxelAttributes& attributes() const override { return attributes_; }
    bool voxelize(const VoxelSink& sink, ProgressLine&) override {
        voxels_.voxels.emit(sink);
        return true;
    }

private:
    VdbVoxels voxels_;
    std::string kind_;
    VoxelAttributes attributes_;
};

/// The inside of a level set that OpenVDB makes of a mesh.
class LevelSetInput : public VoxelInput {
public:
    LevelSetInput(const std::string& path, const VoxelRequest& request) {
        if (request.attributes) attributes_ = *request.attributes;
        if (attributes_.any_of_voxels()) throw Error(ErrorKind::usage, "--attributes: voxels of a level set have opacity only");
        const auto [mesh, box, remarks] = read_triangles(path, request.memory_bytes);
        notes = remarks;
        const double voxel_size = named(path, [&] { return frame_of(box, request); }).voxel_size;
        const LevelSetSettings settings = {.voxel_size = voxel_size, .memory_bytes = request.memory_bytes, .threads = request.threads};
        level_set_ = named(path, [&] { return std::make_unique<MeshLevelSet>(mesh, settings); });
        voxels_ = level_set_->voxels();
    }

    const std::string& kind() const override { return kind_; }
    const VoxelFrame& frame() const override { return voxels_.frame; }
    const VoxelAttributes& attributes() const override { return attributes_; }
    bool voxelize(const VoxelSink& sink, ProgressLine&) override {
        voxels_.voxels.emit(sink);
        return true;
    }

    bool has_own_grid() const override { return true; }
    uint64_t write_own_grid(const std::string& path, bool overwrite, Durability durability) override {
        if (attributes_.opacity) throw Error(ErrorKind::usage, "--attributes: a .vdb file keeps count and color");
        return level_set_->write(path, overwrite, {}, durability);
    }

private:
    std::unique_ptr<MeshLevelSet> level_set_;
    VdbVoxels voxels_;
    std::string kind_ = "level-set";
    VoxelAttributes attributes_;
};

class PointsInput : public VoxelInput {
public:
    PointsInput(std::span<const std::string> words, const VoxelRequest& request) : request_(request) {
        if (!request.kind.empty() && request.kind != kind_) throw wrong_kind(request, "points for points");
        const std::vector<std::string> files = point_files(words);
        source_ = open_points(files);
        const CloudInfo& info = source_->info();
        if (info.points == 0) throw Error(ErrorKind::malformed, files.front() + ": no points to make voxels of");
        notes = info.notes;
        attributes_ = request.attributes ? *request.attributes : VoxelAttributes{.color = find_attribute(info.attributes, attribute_name::kRgb) >= 0};
        frame_ = frame_of(info.bounds.empty() || !info.bounds.min.allFinite() || !info.bounds.max.allFinite() ? exact_bounds() : info.bounds, request);
    }

    const std::string& kind() const override { return kind_; }
    const VoxelFrame& frame() const override { return frame_; }
    const VoxelAttributes& attributes() const override { return attributes_; }
    std::string crs() const override { return source_->info().crs; }

    bool voxelize(const VoxelSink& sink, ProgressLine& progress) override {
        const std::unique_ptr<ScratchStore> scratch = make_scratch_file(request_.scratch_folder);
        std::mutex mutex;
        uint64_t done = 0;
        PointVoxelSettings settings = {.attributes = attributes_, .threads = request_.threads, .memory_bytes = request_.memory_bytes / 4 * 3, .scratch = scratch.get()};
        settings.on_points = [&](uint64_t points) {
            const std::lock_guard lock(mutex);
            progress.update("voxelizing", done += points, source_->info().points);
        };
        const PointVoxelReport report = voxelize_points(*source_, frame_, settings, sink);
        points_read = report.points;
        scratch_bytes = report.scratch_bytes;
        if (report.outside == 0) return true;
        notes.push_back("the header's bounds leave " + with_commas(report.outside) + " points out; those of the points are taken");
        frame_ = frame_of(exact_bounds(), request_);
        return false;
    }

private:
    Box3d exact_bounds() const { return measure_cloud(*source_, request_.threads).bounds; }

    VoxelRequest request_;
    std::string kind_ = "points";
    std::unique_ptr<PointSource> source_;
    VoxelFrame frame_;
    VoxelAttributes attributes_;
};

}  // namespace

std::unique_ptr<VoxelInput> open_voxel_input(std::span<const std::string> words, const VoxelRequest& request) {
    for (const std::string& word : words) {
        if (std::filesystem::is_directory(word)) continue;
        const FormatKind kind = identify_format(word).kind;
        if (kind == FormatKind::voxels) throw Error(ErrorKind::usage, word + ": these are voxels already; meshes, points and grids are expected");
        if (words.size() > 1 && (kind == FormatKind::mesh || kind == FormatKind::grids))
            throw Error(ErrorKind::usage, word + ": one mesh or grid at a time is expected; only points may come in several files");
    }
    if (words.size() == 1 && !std::filesystem::is_directory(words[0])) {
        const FormatKind kind = identify_format(words[0]).kind;
        if (kind == FormatKind::grids) return std::make_unique<GridInput>(words[0], request);
        if (!request.for_grids.empty()) throw Error(ErrorKind::usage, request.for_grids + ": " + words[0] + " is no .vdb file");
        if (kind == FormatKind::mesh && request.kind == "level-set") return std::make_unique<LevelSetInput>(words[0], request);
        if (kind == FormatKind::mesh) return std::make_unique<MeshInput>(words[0], request);
    }
    return std::make_unique<PointsInput>(words, request);
}

}  // namespace strata
