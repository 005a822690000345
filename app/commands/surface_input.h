#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/progress.h"
#include "core/math/box.h"
#include "core/math/camera.h"
#include "core/octree/scratch_store.h"
#include "core/surface/contour.h"
#include "core/surface/surface_sink.h"
#include "core/voxel/voxel_block.h"
#include "io/volume/volume_source.h"

namespace strata {

enum class SurfaceMethod { marching_cubes, cubes, smooth, balls };

/// How far cubes of coarser cells may lie from the voxels.
struct CellError {
    bool in_pixels = false;
    double most = 0.0;             // voxels, or pixels
    std::optional<Camera> camera;  // of pixels; none: that which render has for all of it
    uint32_t width_px = 0, height_px = 0;
};

/// What the words of `strata surface` say of any input.
struct SurfaceRequest {
    std::optional<SurfaceMethod> method;       // none: what suits the input
    std::vector<double> isovalues;             // empty: what suits the input
    std::optional<ContourInside> inside;       // likewise
    bool close = false, normals = false;
    std::optional<double> voxel_size;          // of cells of voxels; world units
    std::optional<CellError> error;            // likewise
    std::optional<double> radius;              // of balls around points, and of what a point has a say in; world units
    std::optional<Vec3d> viewpoint;            // world: normals of points look there
    bool labels = false;                       // of cubes of volumes: each value that is not 0 is a material
    bool quads = false;                        // of cubes: rectangles as they are
    std::vector<std::pair<VoxelColor, uint8_t>> transparent;  // of cubes: colors that can be seen through, and their opacities
    std::vector<std::string> attributes;       // for the vertices, each once
    std::string grid;                          // of a .vdb file; empty: the first
    std::optional<RawVolumeLayout> raw;        // the input is samples alone
    int threads = 1;
    uint64_t memory_bytes = 0;
    uint64_t memory_parts = 1;  // memory_bytes is one of so many of what was given: errors speak of that
    ScratchStore* scratch = nullptr;
    std::string scratch_folder;
};

/// Something that a surface can be made of. Each kind has a class of its own behind open_surface_input.
class SurfaceInput {
public:
    virtual ~SurfaceInput() = default;

    virtual SurfaceMethod method() const = 0;
    virtual Box3d bounds() const = 0;         // world: about where the surface will be
    virtual double edge() const = 0;          // world units: typical of an edge of a face
    virtual bool has_normals() const = 0;     // of vertices
    virtual bool has_colors() const = 0;      // likewise
    virtual std::vector<std::string> scalar_names() const { return {}; }  // of attributes that pieces have, in their order
    /// Hands the surface out. Once.
    virtual void extract(SurfaceSink& out, ProgressLine& progress) = 0;
    /// Adds what it counted to the report of --json. After extract().
    virtual void add_to(nlohmann::ordered_json& report) const = 0;

    /// What was odd; a line each.
    std::vector<std::string> notes;
};

/// Opens a volume, a grid, voxels, points, or what voxels can be made of.
/// throws  Error{usage}: what the request asks for is not for such an input, or a volume has no isovalue; and what reading throws
std::unique_ptr<SurfaceInput> open_surface_input(std::span<const std::string> words, const SurfaceRequest& request);

}  // namespace strata
