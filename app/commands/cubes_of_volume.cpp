// Samples of volumes as cubes: those inside an isovalue, or of labels each value a material.
#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "app/commands/isovalues.h"
#include "app/commands/slices_with_progress.h"
#include "app/commands/surface_inputs.h"
#include "core/error.h"
#include "core/surface/cube_surface.h"
#include "core/surface/volume_bricks.h"
#include "render/colormap.h"

namespace strata {
namespace {

using nlohmann::ordered_json;

/// A color for each label that no other has: that of categories, or where it is taken one near it. VolumeBricks::kMostLabels leave most colors free.
class LabelColors {
public:
    VoxelColor operator()(int32_t label) {
        const Rgba8 color = category_color(uint64_t(int64_t{label}));
        const uint32_t first = material_of({red_of(color), green_of(color), blue_of(color)});
        uint32_t& material = next_.try_emplace(first, first).first->second;
        while (!taken_.insert(material).second) material = (material + 0x050301) & 0xFFFFFF;
        return {uint8_t(material >> 16), uint8_t(material >> 8), uint8_t(material)};
    }

private:
    std::set<uint32_t> taken_;
    std::map<uint32_t, uint32_t> next_;  // by a category's color: all before it on the way from there are taken, so that many labels do not walk it again
};

// Of a label: nodes of LabelColors and LabelsOfVertices, two copies of VolumeLabel and a row of the report.
constexpr uint64_t kLabelBytes = 48 + 48 + 2 * sizeof(VolumeLabel) + 384;

/// Gives vertices their label, which their color tells.
class LabelsOfVertices : public SurfaceSink {
public:
    LabelsOfVertices(const VolumeBricks& bricks, SurfaceSink& next) : next_(next) {
        for (const VolumeLabel& label : bricks.labels()) labels_[material_of(label.color)] = float(label.value);
    }
    void add(const SurfacePiece& piece) override {
        values_.clear();
        for (const std::array<uint8_t, 4>& color : piece.colors) values_.push_back(labels_.at(material_of({color[0], color[1], color[2]})));
        const VertexScalars scalars[] = {{"label", values_}};
        SurfacePiece labeled = piece;
        labeled.scalars = scalars;
        next_.add(labeled);
    }

private:
    SurfaceSink& next_;
    std::map<uint32_t, float> labels_;  // by color
    std::vector<float> values_;
};

class CubesOfVolume : public SurfaceInput {
public:
    CubesOfVolume(const std::string& path, const SurfaceRequest& request)
        : path_(path), request_(request), volume_(request.raw ? open_raw_volume(open_file(path), *request.raw) : open_volume(path)) {
        for (const auto& [given, flag] : {std::pair(request.voxel_size.has_value(), "--voxel-size"), std::pair(request.error.has_value(), "--error")})
            if (given) throw Error(ErrorKind::usage, std::string(flag) + " is for voxels; here the volume says where samples lie");
        if (!request.grid.empty()) throw Error(ErrorKind::usage, "--grid: " + path + " is no .vdb file");
        if (request.close) throw Error(ErrorKind::usage, "--close is for --method marching-cubes; cubes are closed");
        if (!request.attributes.empty()) throw Error(ErrorKind::usage, "--attributes is not for cubes");
        notes = volume_->header().notes;
        if (request.labels) {
            for (const auto& [given, flag] : {std::pair(!request.isovalues.empty(), "--iso"), std::pair(request.inside.has_value(), "--inside")})
                if (given) throw Error(ErrorKind::usage, std::string(flag) + " and --labels: one of them is expected");
            return;
        }
        if (request.isovalues.empty()) {
            const VolumeRange range = volume_->measure();
            throw isovalue_expected(path, range.values > 0 ? range.min : 1.0, range.values > 0 ? range.max : 0.0);
        }
        if (request.isovalues.size() > 1) throw Error(ErrorKind::usage, "--iso: of cubes one isovalue is expected, got " + std::to_string(request.isovalues.size()));
        if (!request.transparent.empty()) throw Error(ErrorKind::usage, "--transparent is for cubes of several colors, such as those of --labels");
    }

    SurfaceMethod method() const override { return SurfaceMethod::cubes; }
    Box3d bounds() const override { return volume_->header().box_around(0.5); }
    double edge() const override { return volume_->placement().axes.colwise().norm().minCoeff(); }
    bool has_normals() const override { return request_.normals; }
    bool has_colors() const override { return request_.labels; }
    std::vector<std::string> scalar_names() const override { return request_.labels ? std::vector<std::string>{"label"} : std::vector<std::string>(); }

    void extract(SurfaceSink& out, ProgressLine& progress) override {
        SlicesWithProgress slices(*volume_, progress);
        VolumeBricksSettings settings = {.place = path_, .inside = request_.inside.value_or(ContourInside::above), .memory_bytes = request_.memory_bytes / 2, .memory_parts = request_.memory_parts * 2, .scratch = request_.scratch};
        if (request_.labels) settings.color_of = LabelColors(), settings.label_bytes = kLabelBytes;
        else settings.isovalue = request_.isovalues[0];
        const VolumeBricks bricks(slices, settings);
        labels_ = bricks.labels();
        LabelsOfVertices labeled(bricks, out);
        counts_ = mesh_cubes(bricks,
                             {.joints = request_.quads ? CubeSurfaceSettings::Joints::separate : CubeSurfaceSettings::Joints::closed,
                              .normals = request_.normals,
                              .colors = request_.labels,
                              .transparent = request_.transparent,
                              .threads = request_.threads,
                              .memory_bytes = request_.memory_bytes,
                              .memory_parts = request_.memory_parts},
                             request_.labels ? static_cast<SurfaceSink&>(labeled) : out);
        nan_samples_ = bricks.nan_samples();
        if (nan_samples_ > 0) notes.push_back(std::to_string(nan_samples_) + " samples are not a number, and no cubes");
        if (counts_.solid_voxels > 0) return;
        notes.emplace_back(request_.labels ? "all labels are 0: the mesh is empty" : "no sample is inside isovalue " + value_text(request_.isovalues[0]) + ": the mesh is empty");
    }

    void add_to(ordered_json& report) const override {
        report.update({{"cell_size", edge()}, {"solid_voxels", counts_.solid_voxels}, {"faces_uncut", counts_.faces_uncut}, {"faces_culled", counts_.faces_culled}, {"rectangles", counts_.rectangles}, {"nan_samples", nan_samples_}});
        if (!request_.labels) {
            report["isovalues"] = request_.isovalues;
            report["inside"] = request_.inside.value_or(ContourInside::above) == ContourInside::above ? "above" : "below";
            return;
        }
        std::vector<VolumeLabel> sorted = labels_;
        std::sort(sorted.begin(), sorted.end(), [](const VolumeLabel& a, const VolumeLabel& b) { return a.value < b.value; });
        report["labels"] = ordered_json::array();
        for (const VolumeLabel& label : sorted) {
            char color[8];
            std::snprintf(color, sizeof color, "#%06x", material_of(label.color));
            report["labels"].push_back({{"value", label.value}, {"color", color}, {"voxels", label.cells}});
        }
    }

private:
    std::string path_;
    SurfaceRequest request_;
    std::unique_ptr<VolumeSource> volume_;
    std::vector<VolumeLabel> labels_;
    CubeSurfaceCounts counts_;
    uint64_t nan_samples_ = 0;
};

}  // namespace

std::unique_ptr<SurfaceInput> cubes_of_volume(const std::string& path, const SurfaceRequest& request) {
    return std::make_unique<CubesOfVolume>(path, request);
}

}  // namespace strata
