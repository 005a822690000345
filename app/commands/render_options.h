#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/options.h"
#include "core/math/camera.h"
#include "core/octree/layered_cloud.h"
#include "render/renderer.h"

namespace strata {

/// What `strata render` was asked for, beyond what a frame is.
struct RenderRequest {
    RenderSettings settings;
    Camera camera;
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

/// Turns the options into a request for this cloud: views, colors and sizes that were left open are chosen from it.
/// throws  Error{usage}
RenderRequest make_render_request(const Options& options, LayeredCloud& cloud);

}  // namespace strata
