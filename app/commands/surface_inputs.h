#pragma once

#include <memory>
#include <span>
#include <string>

#include "app/commands/surface_input.h"

namespace strata {

// The kinds of inputs, each in a file of its own; open_surface_input chooses among them. All throw Error{usage} for what the request asks
// for and is not for such an input, and what reading throws.

std::unique_ptr<SurfaceInput> surface_of_volume(const std::string& path, const SurfaceRequest& request);
std::unique_ptr<SurfaceInput> cubes_of_volume(const std::string& path, const SurfaceRequest& request);
std::unique_ptr<SurfaceInput> surface_of_grid(const std::string& path, const SurfaceRequest& request);  // of a .vdb file
std::unique_ptr<SurfaceInput> surface_of_voxels(const std::string& path, SurfaceMethod method, const SurfaceRequest& request);  // .svo
/// Of what voxels are made of first.
std::unique_ptr<SurfaceInput> surface_by_voxels(std::span<const std::string> words, bool is_grid, SurfaceMethod method, const SurfaceRequest& request);
std::unique_ptr<SurfaceInput> surface_of_balls(std::span<const std::string> words, const SurfaceRequest& request);
std::unique_ptr<SurfaceInput> smooth_surface(std::span<const std::string> words, const SurfaceRequest& request);  // of points

}  // namespace strata
