#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/math/camera.h"
#include "core/octree/node_selection.h"
#include "render/gbuffer.h"
#include "render/pass/edl_pass.h"
#include "render/pass/points_pass.h"
#include "render/point_color.h"
#include "render/stream/node_loader.h"

namespace strata {

struct RenderSettings {
    uint32_t width = 1920, height = 1080;
    ColorChannel color;
    std::string colormap;              // empty: the channel's own
    std::optional<ColorRange> range;   // none: derived from the cloud
    SplatStyle splat;
    SelectionSettings selection;       // what concerns memory and clip is set by render_frame
    std::vector<ClipBox> clips;
    PointFilter filter;                // made for the cloud
    EdlSettings edl;
    Rgba8 background = make_rgba(24, 28, 36);  // alpha 0: transparent
    bool with_ids = false;
    int threads = 1;
    uint64_t memory_bytes = uint64_t{2} << 30;
    uint32_t tile_rows = 0;  // rows in memory at a time, 0: as many as suit; never shows in the picture
};

/// Finished rows of a picture, from the top. Valid during the call.
struct RenderedRows {
    uint32_t first_row = 0, rows = 0;
    std::span<const Rgba8> colors;
    std::span<const float> depths;  // eye depth in world units, kNoDepth at the background
    std::span<const PixelId> ids;   // where settings.with_ids
};

struct RenderReport {
    uint64_t points_drawn = 0;
    uint64_t nodes_drawn = 0;
    double error_px = 0.0;  // what the picture is off by, from selection
    BoundBy bound_by = BoundBy::error;
    std::string gl_renderer;  // empty: no GL was needed
    std::string edl_by;       // what lit the picture: "cpu" or "gl"; empty: nothing did
    double frame_ms = 0.0;
    std::vector<std::pair<std::string, double>> pass_ms;  // in the order they ran
    LoadFailures failures;
};

/// Draws frames. Keeps the GL context and its programs from one frame to the next, made when a pass first needs them. Where there
/// is no GPU, eye-dome lighting is a CPU kernel and needs none.
class Renderer {
public:
    Renderer();
    ~Renderer();

    /// Draws the cloud as the camera sees it and hands out the picture from top to bottom, a strip at a time.
    /// The pixels depend on neither threads nor strips. A node that cannot be read is left out and reported.
    /// throws  Error{usage} for a camera or size that cannot be
    RenderReport render_frame(LayeredCloud& cloud, const Camera& camera, const RenderSettings& settings,
                              const std::function<void(const RenderedRows&)>& on_rows);

private:
    struct Buffers;
    struct Gl;
    void start_gl(int threads);

    std::unique_ptr<Buffers> buffers_;
    std::unique_ptr<Gl> gl_;  // none: not started, or of no use
    bool gl_tried_ = false;
};

inline constexpr uint32_t kLargestSide = 16384;  // pixels of a picture's side

}  // namespace strata
