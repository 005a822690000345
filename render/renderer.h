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
#include "render/pass/fill_settings.h"
#include "render/pass/points_gl_pass.h"
#include "render/pass/points_pass.h"
#include "render/pass/ssao_kernel.h"
#include "render/point_color.h"
#include "render/scene.h"
#include "render/sky_light.h"
#include "render/stream/resident_cloud.h"

namespace strata {

/// Who rasterizes points and meshes and casts rays to voxels: the two draw the same picture. automatic: shaders where there is a GPU
/// that takes them, else the CPU, which also takes over where the GPU fails: it has no room, say
enum class Rasterizer { automatic, cpu, gpu };

struct RenderSettings {
    uint32_t width = 1920, height = 1080;
    ColorChannel color;
    std::string colormap;              // empty: the channel's own
    std::optional<ColorRange> range;   // none: derived from the cloud
    SplatStyle splat;
    Rasterizer rasterizer = Rasterizer::automatic;
    SelectionSettings selection;       // what concerns memory and clip is set by render_frame
    std::vector<ClipBox> clips;
    PointFilter filter;                // made for the cloud
    FillSettings fill;
    UpAxis up = UpAxis::z;             // of the sky that lights voxels and meshes
    SsaoSettings ssao;
    EdlSettings edl;
    Rgba8 background = make_rgba(24, 28, 36);  // alpha 0: transparent
    bool with_ids = false;
    int threads = 1;
    uint64_t memory_bytes = uint64_t{2} << 30;
    uint32_t samples = 1;       // pictures a fraction of a pixel apart that are averaged, in linear light
    bool wait = true;           // for what is to be drawn; false: draws what is in memory, after the first frame of a cloud
    double time_budget_ms = 0;  // stop reading and drawing so that a frame takes about so long; doubled with each frame that
                                // the camera rests, until nothing is missing. 0: no end. With it pictures depend on speed
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
    uint64_t nodes_missing = 0;  // that are still to come: the next frame of this view is better
    int voxel_depth = 0;         // of the finest cells drawn; 0: no voxels were
    uint64_t isosurface_rays = 0, isosurface_hits = 0;  // cast to isosurfaces, and pixels that they show, of all samples
    uint64_t triangles_drawn = 0;  // of the meshes that the picture shows, all of them
    double error_px = 0.0;  // what the picture is off by: from selection, or how large cells look that are coarser than voxels
    BoundBy bound_by = BoundBy::error;
    Rasterizer rasterizer = Rasterizer::cpu;  // what drew points, voxels and meshes: never automatic; cpu where that drew any of them.
                                              // Isosurfaces are always the CPU's
    uint64_t uploaded_bytes = 0;  // of points, to the GPU's memory
    std::string gl_renderer;  // empty: no GL was needed
    std::string edl_by;       // what lit the picture: "cpu" or "gl"; empty: nothing did
    double frame_ms = 0.0;
    std::vector<std::pair<std::string, double>> pass_ms;  // in the order they ran
    LoadFailures failures;
};

/// Draws frames. Keeps from one frame to the next the GL context and its programs, made when a pass first needs them, and
/// the nodes in memory, as long as cloud, colors and filter stay the same. Where there is no GPU, all is done on the CPU and
/// needs no GL, unless the rasterizer `gpu` is asked for: then a software GL runs its shader, and the other passes are the CPU's.
class Renderer {
public:
    Renderer();
    ~Renderer();

    /// Draws the scene as the camera sees it and hands out the picture from top to bottom, a strip at a time.
    /// The pixels depend on neither threads nor strips, nor, if it waits, on what is in memory. A node that cannot be read is
    /// left out, so that its parent shows, and is reported once. The cloud must outlive the renderer or forget_cloud; all else
    /// of a scene only the call.
    /// throws  Error{usage} for a camera or size that cannot be, and for surfels of a cloud without normals; for the rasterizer `gpu` Error{device}
    ///         where there is no GL or it fails
    RenderReport render_frame(const Scene& scene, const Camera& camera, const RenderSettings& settings,
                              const std::function<void(const RenderedRows&)>& on_rows);

    /// Drops the nodes in memory and stops reading.
    void forget_cloud();
    /// Bytes of nodes in memory or on their way, and the nodes that were read, of the cloud at hand.
    uint64_t resident_bytes() const { return resident_ ? resident_->cache().used_bytes() : 0; }
    uint64_t nodes_read() const { return resident_ ? resident_->cache().reads_begun() : 0; }

private:
    struct Buffers;
    struct Gl;
    template <class Pass>
    struct GlPass;
    struct Frame;
    struct ChosenPoints;
    struct Strip;
    void start_gl(int threads);
    template <class Pass>
    Pass* gpu_pass(GlPass<Pass> Gl::* place, const RenderSettings& settings);
    template <class Pass, class Draw>
    bool draw_by_gpu(Frame& frame, Pass* Frame::* pass, GlPass<Pass> Gl::* place, const Draw& draw);
    ChosenPoints choose_points(Frame& frame, LayeredCloud& cloud, uint64_t used_bytes);
    void draw_points(Frame& frame, const LayeredCloud& cloud, const ChosenPoints& chosen, const Strip& strip, GBuffer& out);
    void draw_voxels(Frame& frame, const Scene& scene, const Strip& strip, GBuffer& out);
    void draw_isosurfaces(Frame& frame, const Scene& scene, const Strip& strip, GBuffer& out);
    void draw_meshes(Frame& frame, const Scene& scene, const Strip& strip, GBuffer& out);

    std::unique_ptr<Buffers> buffers_;
    std::unique_ptr<Gl> gl_;  // none: not started, or of no use. On software GL only for the rasterizer that was asked for
    bool gl_tried_ = false;
    std::unique_ptr<ResidentCloud> resident_;
    std::optional<Camera> last_camera_;
    uint32_t frames_at_rest_ = 0;
    double ms_per_point_ = 1e-5;  // after loading, of the frame before; a guess until there is one
};

inline constexpr uint32_t kLargestSide = 16384;  // pixels of a picture's side

}  // namespace strata
