#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/cloud/clip_box.h"
#include "core/math/camera.h"
#include "core/octree/layered_cloud.h"
#include "render/scene.h"
#include "render/sky_light.h"

namespace strata {

/// World positions of the points nearest to the root, which are evenly spread over the cloud. A few points far from all
/// others, such as birds and stray echoes, are left out, so that they do not decide what a picture shows.
/// returns  empty for a cloud without points
std::vector<Vec3d> sample_positions(LayeredCloud& cloud);

/// Those of a scene's cloud, corners of cells that hold the voxels, corners of triangles, the outermost ones among them, and what add_sample has of isosurfaces.
std::vector<Vec3d> sample_positions(const Scene& scene, std::span<const ClipBox> clips = {});

/// Adds corners of boxes around parts of an isosurface, of what clip boxes leave of them.
void add_sample(const IsosurfaceModel& model, std::span<const ClipBox> clips, std::vector<Vec3d>& points);

/// The camera of `--view`: iso, top, front, back, left or right, framed around the points. front looks north, which is along -z where y points upwards.
/// throws  Error{usage}, naming the views there are
Camera named_view(std::string_view name, Projection projection, double fov_rad, std::span<const Vec3d> points, double aspect, UpAxis up = UpAxis::z);

/// What `--color` is when the user did not say: rgb where some point has a color, else elevation.
std::string sensible_color(const LayeredCloud& cloud);

}  // namespace strata
