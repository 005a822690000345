#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/commands/scene_files.h"
#include "app/options.h"
#include "core/math/camera.h"
#include "render/renderer.h"

namespace strata {

/// What `strata render` was asked for, beyond what a frame is.
struct RenderRequest {
    Scene scene;  // of the files, which must outlive it
    RenderSettings settings;
    Camera camera;
    std::string color_name;  // of the cloud or, without one, of the first voxels, or else mesh
    std::string output, depth_output, reference;
    double threshold = 0.0;
    bool overwrite = false;
    bool stats = false;
    bool quiet = false;
};

std::span<const OptionRow> render_option_rows();

/// Width and height of "640x360". throws Error{usage} that names --size
std::pair<uint32_t, uint32_t> parse_size(const std::string& text);

/// Checks everything that needs no cloud, so that a wrong command line costs no reading.
void check_render_options(const Options& options);

/// Turns the options into a request for these files: views, colors and sizes that were left open are chosen from them. Takes their isosurfaces.
/// throws  Error{usage}
RenderRequest make_render_request(const Options& options, SceneFiles& files);

}  // namespace strata
