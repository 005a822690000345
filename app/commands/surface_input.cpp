// What strata surface makes surfaces of: which kind of input the words are.
#include "app/commands/surface_input.h"

#include <filesystem>

#include "app/commands/surface_inputs.h"
#include "core/error.h"
#include "io/format.h"

namespace strata {
namespace {

// What has no attributes to give.
void refuse_attributes(const SurfaceRequest& request, const std::string& path, FormatKind kind) {
    if (request.attributes.empty() || kind == FormatKind::points || kind == FormatKind::layered || kind == FormatKind::volume) return;
    if (kind == FormatKind::grids && request.method == SurfaceMethod::cubes) throw Error(ErrorKind::usage, "--attributes is not for cubes");
    if (kind == FormatKind::grids) return;
    throw Error(ErrorKind::usage, "--attributes is for points, volumes and .vdb grids; " + path + " is " + (kind == FormatKind::mesh ? "a mesh" : "a file of voxels"));
}

void refuse_viewpoint(const SurfaceRequest& request) {
    if (request.viewpoint) throw Error(ErrorKind::usage, "--viewpoint is for --method smooth, of points");
}

// What is stored sparsely ends before its grid does, and cubes are closed.
void refuse_close(const SurfaceRequest& request) {
    if (request.close) throw Error(ErrorKind::usage, "--close is for volumes; this surface meets no boundary");
}

FormatKind kind_of(const std::string& path) {
    try {
        return identify_format(path).kind;
    } catch (const Error& error) {
        if (error.kind != ErrorKind::unsupported) throw;
        throw Error(error.kind, error.what() + std::string("; if it is samples alone, --dimensions XxYxZ says how they lie"));
    }
}

}  // namespace

std::unique_ptr<SurfaceInput> open_surface_input(std::span<const std::string> words, const SurfaceRequest& request) {
    const std::string& path = words[0];
    const bool one = words.size() == 1 && !std::filesystem::is_directory(path);
    if (request.labels && request.method.value_or(SurfaceMethod::cubes) != SurfaceMethod::cubes) throw Error(ErrorKind::usage, "--labels makes cubes: --method cubes is expected with it");
    const bool of_points = request.method == SurfaceMethod::smooth || request.method == SurfaceMethod::balls;
    const bool cubes = request.method == SurfaceMethod::cubes || request.labels;
    if (request.raw) {
        if (!one) throw Error(ErrorKind::usage, "--dimensions: one file of samples is expected");
        refuse_viewpoint(request);
        return cubes ? cubes_of_volume(path, request) : surface_of_volume(path, request);
    }
    for (const std::string& word : words) {
        if (std::filesystem::is_directory(word)) continue;
        const FormatKind kind = kind_of(word);
        if (words.size() > 1 && kind != FormatKind::points && kind != FormatKind::layered)
            throw Error(ErrorKind::usage, word + ": one volume, grid, mesh or voxel file at a time is expected; only points may come in several files");
        if (of_points && kind != FormatKind::points && kind != FormatKind::layered) throw Error(ErrorKind::usage, word + ": --method " + (request.method == SurfaceMethod::smooth ? "smooth" : "balls") + " is for points");
        const char* const without_points = kind == FormatKind::mesh ? "meshes" : kind == FormatKind::voxels ? "voxels" : kind == FormatKind::volume || kind == FormatKind::grids ? "values on a grid" : nullptr;
        if (request.radius && without_points != nullptr) throw Error(ErrorKind::usage, word + ": --radius is not for " + without_points + "; it is for points");
        refuse_attributes(request, word, kind);
        if (kind != FormatKind::points && kind != FormatKind::layered) refuse_viewpoint(request);
        if (kind == FormatKind::volume) return cubes ? cubes_of_volume(word, request) : surface_of_volume(word, request);
        if (request.labels) throw Error(ErrorKind::usage, word + ": --labels is for volumes");
        refuse_close(request);
        if (kind == FormatKind::voxels) return surface_of_voxels(word, request.method.value_or(SurfaceMethod::cubes), request);
        if (kind == FormatKind::grids && !cubes) return surface_of_grid(word, request);
    }
    refuse_close(request);  // folders of points
    if (request.labels) throw Error(ErrorKind::usage, path + ": --labels is for volumes");
    if (request.radius && request.method && !of_points) throw Error(ErrorKind::usage, "--radius is for --method smooth or balls");
    const FormatKind kind = one ? identify_format(path).kind : FormatKind::points;
    if (kind != FormatKind::mesh && kind != FormatKind::grids) {
        if (request.method.value_or(SurfaceMethod::smooth) == SurfaceMethod::smooth) return smooth_surface(words, request);
        if (request.method == SurfaceMethod::balls) {
            refuse_viewpoint(request);
            if (!request.radius) throw Error(ErrorKind::usage, "--method balls: --radius R is expected, that of the balls, in CRS units");
            return surface_of_balls(words, request);
        }
    }
    refuse_viewpoint(request);
    if (!request.attributes.empty()) throw Error(ErrorKind::usage, "--attributes is for --method smooth or balls, of points; here voxels are made of " + path);
    if (!request.method) throw Error(ErrorKind::usage, path + ": of meshes --method cubes or marching-cubes with --voxel-size makes a surface");
    return surface_by_voxels(words, kind == FormatKind::grids, *request.method, request);
}

}  // namespace strata
