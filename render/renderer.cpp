#include "render/renderer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "render/gl/egl_context.h"
#include "render/pass/edl_kernel.h"
#include "render/pass/fill_kernel.h"
#include "render/pass/fill_pass.h"
#include "render/pass/isosurface_pass.h"
#include "render/pass/mesh_gl_pass.h"
#include "render/pass/mesh_pass.h"
#include "render/pass/points_kernel.h"
#include "render/pass/ssao_pass.h"
#include "render/pass/voxels_gl_pass.h"
#include "render/pass/voxels_pass.h"
#include "render/sample_sums.h"
#include "render/srgb.h"
#include "render/stream/node_loader.h"
#include "render/stream/point_cut.h"
#include "render/stream/shape_field.h"

namespace strata {
namespace {

constexpr uint64_t kPixelBytes = 60;    // word, G-buffer, finished row, and the passes' planes and textures
constexpr uint64_t kSamplePixelBytes = 52;  // more with several samples: sums, and a G-buffer for those after the first
constexpr uint64_t kStripPixels = 8 << 20;
constexpr uint64_t kGpuShare = 4;  // the GPU's rasterizer takes this part of the memory cap of the GPU's memory

// Adds the time since the last call to a row of the report.
class Stopwatch {
public:
    explicit Stopwatch(RenderReport& report) : report_(report), start_(Clock::now()), last_(start_) {}

    void lap(const char* name) {
        const auto now = Clock::now();
        const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
        last_ = now;
        for (auto& [row, sum] : report_.pass_ms)
            if (row == name) {
                sum += ms;
                return;
            }
        report_.pass_ms.emplace_back(name, ms);
    }
    double total_ms() const { return std::chrono::duration<double, std::milli>(Clock::now() - start_).count(); }

private:
    using Clock = std::chrono::steady_clock;
    RenderReport& report_;
    Clock::time_point start_, last_;
};

// Rows of the picture that points of the box can touch.
std::pair<float, float> row_range(const Camera& camera, uint32_t height_px, const Box3d& box, double margin_px) {
    double top = std::numeric_limits<double>::infinity(), bottom = -top;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d p((corner & 1 ? box.max : box.min).x(), (corner & 2 ? box.max : box.min).y(),
                      (corner & 4 ? box.max : box.min).z());
        const Vec3d q = camera.view_from_world * (p - camera.eye);
        if (camera.projection == Projection::perspective && -q.z() < camera.near_depth) return {0.0f, float(height_px)};
        const double row = 0.5 * height_px - q.y() * pixels_per_unit(camera, -q.z(), height_px);
        top = std::min(top, row);
        bottom = std::max(bottom, row);
    }
    return {float(top - margin_px), float(bottom + margin_px)};
}

// Copies of the nodes that filter or clip boxes cut, by slot; empty for nodes that are whole.
std::vector<std::optional<CutNode>> cut_nodes(std::span<ResidentNode* const> points, const ClipRegion& clip, int threads) {
    std::vector<std::optional<CutNode>> cut(points.size());
    parallel_blocks(threads, points.size(), 1, [&](size_t begin, size_t end) {
        for (size_t slot = begin; slot < end; ++slot)
            if (coverage(*points[slot], clip) != Coverage::whole) cut[slot] = cut_node(*points[slot], clip);
    });
    return cut;
}

// Indices in the nodes that were drawn become those in the nodes that are stored.
void restore_indices(std::span<PixelId> ids, std::span<const std::optional<CutNode>> cut) {
    for (PixelId& id : ids) {
        if (id == kNoPixelId) continue;
        const uint32_t slot = slot_of(id);
        if (cut[slot]) id = make_pixel_id(slot, cut[slot]->indices[primitive_of(id)]);
    }
}

std::vector<PointNode> list_nodes(const LayeredCloud& cloud, const Camera& camera, const RenderSettings& settings,
                                  std::span<const NodeId> ids, std::span<ResidentNode* const> points,
                                  std::span<const std::optional<CutNode>> cut) {
    // Two more rows cover rounding.
    const double margin_px = settings.splat.reach_px() + 2.0;
    std::vector<PointNode> nodes(ids.size());
    uint64_t rank = 0;
    for (size_t slot = 0; slot < ids.size(); ++slot) {
        PointNode& node = nodes[slot];
        node.points = cut[slot] ? &cut[slot]->points : points[slot];
        node.first_rank = uint32_t(rank);
        rank += node.points->size();
        std::tie(node.top_row, node.bottom_row) = row_range(camera, settings.height, cloud.node(ids[slot]).bounds, margin_px);
    }
    if (rank >= std::numeric_limits<uint32_t>::max())
        throw Error(ErrorKind::limit, "more than 2^32 - 2 points in one picture; lower --budget");
    if (nodes.size() > kMostSlots) throw Error(ErrorKind::limit, "more than 2^24 nodes in one picture; lower --budget");
    return nodes;
}

uint64_t pixel_bytes(const RenderSettings& settings) {
    return kPixelBytes + (settings.samples > 1 ? kSamplePixelBytes : 0) + (settings.splat.shape == SplatShape::gaussian ? kBlendPixelBytes : 0);
}

// Of the GPU's memory.
uint64_t gpu_pixel_bytes(const SplatStyle& splat) { return sizeof(uint64_t) + (splat.shape == SplatShape::gaussian ? kBlendPixelBytes : 0); }

uint32_t choose_strip_rows(const RenderSettings& settings) {
    if (settings.tile_rows > 0) return std::min(settings.tile_rows, settings.height);
    const uint64_t pixels = std::clamp<uint64_t>(settings.memory_bytes / 4 / pixel_bytes(settings), settings.width, kStripPixels);
    return uint32_t(std::min<uint64_t>(std::max<uint64_t>(pixels / settings.width, 1), settings.height));
}

// How far the screen-space passes look beyond the rows they shade.
int edl_reach_px(const Scene& scene, const RenderSettings& settings) {
    if (!(settings.edl.strength > 0.0f)) return 0;
    const bool smooth = std::any_of(scene.voxels.begin(), scene.voxels.end(), [](const VoxelModel& model) { return model.shading == VoxelShading::smooth; });
    const int widest = smooth ? 255 : scene.cloud != nullptr ? std::min(int(settings.splat.widest_px() + 0.5f), 255) : 1;
    const int splat = settings.edl.follow_splats ? widest : 0;
    return std::max(settings.edl.reach_px(settings.height, EdlSettings::kScales - 1), splat);
}

NodeCache::Clock::time_point loading_deadline(const RenderSettings& settings, double budget_ms) {
    using Clock = NodeCache::Clock;
    if (!settings.wait) return Clock::time_point::min();
    if (!(settings.time_budget_ms > 0.0)) return Clock::time_point::max();
    // Half for reading, half for drawing.
    return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double, std::milli>(0.5 * budget_ms));
}

// Where nothing was drawn, and behind what lets light pass.
void fill_background(std::span<Rgba8> colors, Rgba8 background, int threads) {
    const std::array<float, 256>& linear = linear_from_srgb8();
    const auto mixed = [&](uint8_t over, uint8_t under, float part) { return srgb8_from_linear(part * linear[over] + (1.0f - part) * linear[under]); };
    parallel_blocks(threads, colors.size(), 1 << 18, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const Rgba8 color = colors[i];
            const uint8_t alpha = alpha_of(color);
            if (alpha == 0) colors[i] = background;
            else if (alpha < 255 && alpha_of(background) == 255)
                colors[i] = make_rgba(mixed(red_of(color), red_of(background), float(alpha) / 255.0f), mixed(green_of(color), green_of(background), float(alpha) / 255.0f),
                                      mixed(blue_of(color), blue_of(background), float(alpha) / 255.0f));
        }
    });
}

void clear_gbuffer(GBuffer& out, uint32_t width, uint32_t first_row, uint32_t rows, const ResolveOptions& options) {
    const size_t pixels = size_t(width) * rows;
    out.width = width;
    out.first_row = first_row;
    out.rows = rows;
    out.colors.assign(pixels, 0);
    out.depths.assign(pixels, kNoDepth);
    out.splat_px.assign(options.splat_px ? pixels : 0, 0);
    out.ids.assign(options.ids ? pixels : 0, kNoPixelId);
}

}  // namespace

// What all steps of a frame need.
struct Renderer::Frame {
    const Camera& camera;
    const RenderSettings& settings;
    RenderReport& report;
    Stopwatch& watch;
    PointsGlPass* gpu_points = nullptr;  // none: the CPU draws them
    VoxelsGlPass* gpu_voxels = nullptr;
    MeshGlPass* gpu_meshes = nullptr;
    uint64_t gpu_bytes = 0;  // most that points take of its memory, and as much that voxels do, and meshes
    std::vector<bool> meshes_seen = {};
};

// Rows of the picture that are drawn at a time, for a sample that lies off the middle of its pixel.
struct Renderer::Strip {
    uint32_t first_row, rows;
    Vec2f offset_px;
    ResolveOptions wanted;
};

// What is drawn of a cloud, ready for the rasterizers.
struct Renderer::ChosenPoints {
    std::vector<std::optional<CutNode>> cut;  // by slot, which nodes may point into
    std::vector<PointNode> nodes;
    double loaded_ms = 0.0;  // since the frame began, when all was loaded
};

// A rasterizer, made when a frame first needs it.
template <class Pass>
struct Renderer::GlPass {
    std::optional<Pass> pass;
    bool refused = false;  // by the driver, or it failed
};

// Passes are made when a frame first needs them.
struct Renderer::Gl {
    explicit Gl(int threads) : context(threads), software(context.is_software()) {}
    Gl(const Gl&) = delete;
    Gl& operator=(const Gl&) = delete;
    ~Gl() {
        try {
            context.make_current();  // what the passes own is the context's
        } catch (const Error&) {     // and goes with it in any case
        }
    }

    EdlPass& edl_pass() { return edl ? *edl : edl.emplace(context); }
    FillPass& fill_pass() { return fill ? *fill : fill.emplace(context); }
    SsaoPass& ssao_pass() { return ssao ? *ssao : ssao.emplace(context); }

    EglContext context;
    bool software;
    GlPass<PointsGlPass> points;
    GlPass<VoxelsGlPass> voxels;
    GlPass<MeshGlPass> meshes;
    std::optional<EdlPass> edl;
    std::optional<FillPass> fill;
    std::optional<SsaoPass> ssao;
};

// Kept from frame to frame: fresh memory costs more than what is written to it.
struct Renderer::Buffers {
    PointsPass points;
    MeshPass meshes;
    GBuffer gbuffer, other_samples;
    SsaoKernel ssao;
    std::vector<Rgba8> shaded;
    SampleSums sums;
};

Renderer::Renderer() : buffers_(std::make_unique<Buffers>()) {}
Renderer::~Renderer() = default;

void Renderer::forget_cloud() {
    resident_.reset();
    if (!gl_ || !gl_->points.pass) return;
    gl_->context.make_current();
    gl_->points.pass->forget_nodes();
}

// Starts GL where a GPU runs it, once. On software GL lighting takes longer than the points.
void Renderer::start_gl(int threads) {
    if (std::exchange(gl_tried_, true) || gl_ || !may_have_gpu()) return;
    try {
        gl_ = std::make_unique<Gl>(threads);
        if (gl_->software) gl_.reset();
    } catch (const Error& error) {
        if (error.kind != ErrorKind::device) throw;
    }
}

// None: the CPU draws.
template <class Pass>
Pass* Renderer::gpu_pass(GlPass<Pass> Gl::* place, const RenderSettings& settings) {
    if (settings.rasterizer == Rasterizer::cpu) return nullptr;
    const bool asked_for = settings.rasterizer == Rasterizer::gpu;
    try {
        if (!asked_for) start_gl(settings.threads);
        else if (!gl_) gl_ = std::make_unique<Gl>(settings.threads);
        if (!gl_ || (!asked_for && gl_->software)) return nullptr;
        auto& [pass, refused] = (*gl_).*place;
        if (!asked_for && refused) return nullptr;
        refused = true;  // unless it is made
        if (!pass) pass.emplace(gl_->context);
        refused = false;
        return &*pass;
    } catch (const Error& error) {
        if (asked_for) throw error.within("the rasterizer gpu");
        if (error.kind != ErrorKind::device) throw;
        return nullptr;
    }
}

// Of a pass that fails nothing is kept: where it stopped is not known. Unless it was asked for the CPU then draws, in this frame and in those to come.
// draw     whether it took the work; what it drew before it failed can be drawn over
// returns  false: the CPU has to
template <class Pass, class Draw>
bool Renderer::draw_by_gpu(Frame& frame, Pass* Frame::* pass, GlPass<Pass> Gl::* place, const Draw& draw) {
    try {
        if (frame.*pass != nullptr && draw(*(frame.*pass))) return true;
    } catch (const Error& error) {
        if (error.kind != ErrorKind::device) throw;
        frame.*pass = nullptr;
        auto& [made, refused] = (*gl_).*place;
        made.reset();
        if (frame.settings.rasterizer == Rasterizer::gpu) throw error.within("the rasterizer gpu");
        refused = true;
    }
    frame.report.rasterizer = Rasterizer::cpu;
    return false;
}

// Selects, loads and cuts. used_bytes: of the memory cap, by what is not points
Renderer::ChosenPoints Renderer::choose_points(Frame& frame, LayeredCloud& cloud, uint64_t used_bytes) {
    auto& [camera, settings, report, watch, gpu_points, gpu_voxels, gpu_meshes, gpu_bytes, meshes_seen] = frame;
    const bool normals = settings.splat.shape == SplatShape::surfel;
    const ResidencySettings residency = {settings.color, settings.colormap, settings.range, settings.filter, normals, settings.threads};
    if (!resident_ || !resident_->is_for(cloud, residency)) {
        forget_cloud();  // its memory first
        resident_ = std::make_unique<ResidentCloud>(cloud, residency);
    }
    watch.lap("load");

    SelectionSettings selection_settings = settings.selection;
    const ClipRegion clip(settings.clips, cloud.info().quantization);
    selection_settings.memory_bytes = settings.memory_bytes - std::min(settings.memory_bytes, used_bytes);
    // With a filter every node is copied, as those are that a clip box cuts.
    const bool filtered = !settings.filter.everything();
    const uint64_t normal_bytes = normals ? kResidentNormalBytes : 0, cut_bytes = kCutPointBytes + normal_bytes;
    selection_settings.node_bytes = kResidentNodeBytes;
    selection_settings.point_bytes = kResidentPointBytes + normal_bytes + (filtered ? kResidentFilterBytes + cut_bytes : 0);
    selection_settings.cut_point_bytes = filtered ? 0 : cut_bytes;
    selection_settings.clip = &clip;
    selection_settings.load_pages = settings.wait;
    if (!settings.wait) resident_->add_pages(cloud);
    const Selection selection = settings.filter.nothing() ? Selection()
                                                          : select_nodes(cloud, camera, settings.width, settings.height, selection_settings);
    resident_->want_pages(selection);
    watch.lap("select");

    frames_at_rest_ = last_camera_ == camera ? std::min(frames_at_rest_ + 1, 30u) : 0;
    last_camera_ = camera;
    const double budget_ms = settings.time_budget_ms * double(1u << frames_at_rest_);
    FrameNodes nodes = resident_->gather(selection, selection_settings, selection_settings.memory_bytes - std::min(selection_settings.memory_bytes, selection.cut_bytes),
                                         loading_deadline(settings, budget_ms));
    report.failures = resident_->take_failures();
    watch.lap("load");
    ChosenPoints chosen;
    chosen.loaded_ms = watch.total_ms();
    if (settings.time_budget_ms > 0.0)
        nodes.limit_points(uint64_t(std::max(budget_ms - chosen.loaded_ms, 0.0) / ms_per_point_));
    report.nodes_drawn = nodes.ids.size();
    report.nodes_missing = nodes.missing;
    report.error_px = std::max(selection.error_px, nodes.missing_error_px);
    report.bound_by = nodes.missing > 0 ? BoundBy::time : selection.bound_by;

    if (settings.splat.fixed_px <= 0.0f) {
        update_shapes(cloud, nodes.ids, nodes.points, settings.threads);
        watch.lap("shapes");
    }
    chosen.cut = cut_nodes(nodes.points, clip, settings.threads);
    chosen.nodes = list_nodes(cloud, camera, settings, nodes.ids, nodes.points, chosen.cut);
    for (const PointNode& node : chosen.nodes) report.points_drawn += node.points->size();
    watch.lap("cut");
    return chosen;
}

void Renderer::draw_points(Frame& frame, const LayeredCloud& cloud, const ChosenPoints& chosen, const Strip& strip, GBuffer& out) {
    auto& [camera, settings, report, watch, gpu_points, gpu_voxels, gpu_meshes, gpu_bytes, meshes_seen] = frame;
    PointsPass& pass = buffers_->points;
    PointProjection projection(camera, cloud.info().quantization, settings.width, settings.height);
    projection.center_x -= strip.offset_px.x();
    projection.center_y -= strip.offset_px.y();
    const auto by_gpu = [&](PointsGlPass& gpu) {
        const WordRows words = pass.resize(settings.width, strip.first_row, strip.rows);
        LightSum* const light = settings.splat.shape == SplatShape::gaussian ? pass.resize_sums() : nullptr;
        gpu.draw(words, light, chosen.nodes, projection, settings.splat, gpu_bytes);
        return true;
    };
    if (!draw_by_gpu(frame, &Frame::gpu_points, &Gl::points, by_gpu)) {
        pass.clear(settings.width, strip.first_row, strip.rows, settings.threads);
        watch.lap("clear");
        pass.draw(chosen.nodes, projection, settings.splat, settings.threads);
    }
    watch.lap("points");
    pass.resolve(chosen.nodes, projection, settings.splat, strip.wanted, settings.threads, out);
    restore_indices(out.ids, chosen.cut);
    watch.lap("resolve");
}

void Renderer::draw_voxels(Frame& frame, const Scene& scene, const Strip& strip, GBuffer& out) {
    const RenderSettings& settings = frame.settings;
    const VoxelView view = {frame.camera, settings.width, settings.height, strip.offset_px, settings.selection.error_px, settings.clips, settings.threads, settings.up};
    VoxelsDrawn drawn;
    for (size_t i = 0; i < scene.voxels.size(); ++i) {
        const VoxelModel& model = scene.voxels[i];
        const uint32_t drawable = uint32_t(i) + 1;
        const auto by_gpu = [&](VoxelsGlPass& gpu) { return gpu.draw(model, drawable, view, frame.gpu_bytes, out, drawn); };
        if (draw_by_gpu(frame, &Frame::gpu_voxels, &Gl::voxels, by_gpu)) continue;
        drawn.add(strata::draw_voxels(model, drawable, view, out));
    }
    frame.report.voxel_depth = std::max(frame.report.voxel_depth, drawn.finest_depth);
    if (drawn.error_px <= frame.report.error_px) return;
    frame.report.error_px = drawn.error_px;
    frame.report.bound_by = drawn.short_of_memory ? BoundBy::memory : BoundBy::error;
}

void Renderer::draw_meshes(Frame& frame, const Scene& scene, const Strip& strip, GBuffer& out) {
    const RenderSettings& settings = frame.settings;
    frame.meshes_seen.resize(scene.meshes.size());
    for (size_t i = 0; i < scene.meshes.size(); ++i) {
        const TriangleMesh& mesh = *scene.meshes[i].mesh;
        const bool fits = MeshGlPass::gpu_bytes(mesh.positions.size(), mesh.triangles.size()) <= frame.gpu_bytes && settings.clips.empty();
        const auto draw = [&](MeshGlPass* gpu) {
            const MeshView view = {frame.camera, settings.width, settings.height, strip.offset_px, settings.clips, settings.threads, settings.up, gpu};
            if (buffers_->meshes.draw(scene.meshes[i], uint32_t(1 + scene.voxels.size() + i), view, out)) frame.meshes_seen[i] = true;
        };
        const auto by_gpu = [&](MeshGlPass& gpu) {
            if (!fits || !gpu.takes(mesh.positions.size(), mesh.triangles.size())) return false;
            draw(&gpu);
            return true;
        };
        if (!draw_by_gpu(frame, &Frame::gpu_meshes, &Gl::meshes, by_gpu)) draw(nullptr);
    }
}

void Renderer::draw_isosurfaces(Frame& frame, const Scene& scene, const Strip& strip, GBuffer& out) {
    const RenderSettings& settings = frame.settings;
    const IsosurfaceView view = {frame.camera, settings.width, settings.height, strip.offset_px, settings.clips, settings.threads, settings.up};
    const uint32_t first = uint32_t(1 + scene.voxels.size() + scene.meshes.size());
    IsosurfacesDrawn drawn;
    for (size_t i = 0; i < scene.isosurfaces.size(); ++i)
        if (scene.isosurfaces[i].opacity >= 1.0f) drawn.add(draw_isosurface(scene.isosurfaces[i], first + uint32_t(i), view, out));
    drawn.add(draw_translucent(scene.isosurfaces, first, view, out));
    frame.report.isosurface_rays += drawn.rays;
    frame.report.isosurface_hits += drawn.hits;
}

RenderReport Renderer::render_frame(const Scene& scene, const Camera& camera, const RenderSettings& settings,
                                    const std::function<void(const RenderedRows&)>& on_rows) {
    if (settings.width == 0 || settings.height == 0 || settings.width > kLargestSide || settings.height > kLargestSide)
        throw Error(ErrorKind::usage, "a picture's sides are from 1 to " + std::to_string(kLargestSide) + " pixels");
    if (settings.samples < 1 || settings.samples > kMostSamples)
        throw Error(ErrorKind::usage, "1 to " + std::to_string(kMostSamples) + " samples are possible");
    if (scene.voxels.size() + scene.meshes.size() + scene.isosurfaces.size() >= kMostDrawables)
        throw Error(ErrorKind::usage, "at most " + std::to_string(kMostDrawables - 1) + " voxel models, meshes and isosurfaces are possible in one picture");
    check_camera(camera);
    RenderReport report;
    Stopwatch watch(report);

    if (gl_) gl_->context.make_current();  // another renderer's may be
    PointsGlPass* const gpu_points = scene.cloud != nullptr ? gpu_pass(&Gl::points, settings) : nullptr;
    VoxelsGlPass* const gpu_voxels = !scene.voxels.empty() ? gpu_pass(&Gl::voxels, settings) : nullptr;
    MeshGlPass* const gpu_meshes = !scene.meshes.empty() ? gpu_pass(&Gl::meshes, settings) : nullptr;
    const int on_gpu = (gpu_points != nullptr) + (gpu_voxels != nullptr) + (gpu_meshes != nullptr);
    report.rasterizer = on_gpu > 0 ? Rasterizer::gpu : Rasterizer::cpu;
    const uint64_t uploaded_before = gpu_points != nullptr ? gpu_points->uploaded_bytes() : 0;
    // Of the GPU's memory, which is the program's own with software GL.
    const uint64_t gpu_bytes = on_gpu > 0 ? settings.memory_bytes / kGpuShare : 0;
    Frame frame = {camera, settings, report, watch, gpu_points, gpu_voxels, gpu_meshes, gpu_bytes};
    if (gl_) watch.lap("gl start");

    const uint32_t strip_rows = choose_strip_rows(settings);
    const int edl_reach = edl_reach_px(scene, settings), fill_reach = scene.cloud != nullptr ? settings.fill.reach_px() : 0, ssao_reach = settings.ssao.reach_px();
    // Each pass needs the finished rows that the next one looks at.
    const int reach = fill_reach + ssao_reach + edl_reach;
    const uint64_t strip_pixels = uint64_t{settings.width} * (strip_rows + 2 * uint64_t(reach));
    uint64_t used_bytes = strip_pixels * pixel_bytes(settings) + (on_gpu > 0 && gl_->software ? uint64_t(on_gpu) * gpu_bytes + strip_pixels * gpu_pixel_bytes(settings.splat) : 0);
    for (const VoxelModel& model : scene.voxels) used_bytes += size_bytes(*model.tree);
    uint64_t most_vertices = 0;
    for (const MeshModel& model : scene.meshes) {
        used_bytes += mesh_model_bytes(*model.mesh, model.style.shading).kept;
        most_vertices = std::max<uint64_t>(most_vertices, model.mesh->positions.size());
    }
    for (size_t i = 0; i < scene.isosurfaces.size(); ++i) {
        const FieldSurface& surface = scene.isosurfaces[i].surface;
        if (i == 0 || surface.field != scene.isosurfaces[i - 1].surface.field) used_bytes += surface.field->size_bytes();
        used_bytes += size_bytes(surface.cells);
    }
    if (!scene.meshes.empty()) used_bytes += MeshPass::working_bytes(most_vertices, strip_pixels);
    ChosenPoints chosen;
    if (scene.cloud != nullptr) chosen = choose_points(frame, *scene.cloud, used_bytes);

    if (edl_reach + fill_reach + ssao_reach > 0) {
        start_gl(settings.threads);
        watch.lap("gl start");
    }
    Gl* const gl_passes = gl_ && !gl_->software ? gl_.get() : nullptr;
    if (edl_reach > 0) report.edl_by = gl_passes != nullptr ? "gl" : "cpu";
    if (gl_) report.gl_renderer = gl_->context.renderer();

    // Depths and identities are those of the first sample, which lies in the middle of the pixel.
    auto& [points, meshes, first, others, ssao, shaded, sums] = *buffers_;
    for (uint32_t row = 0; row < settings.height; row += strip_rows) {
        const uint32_t rows = std::min(strip_rows, settings.height - row);
        // Neighbours of the strip's own rows are drawn with it, so that its seams do not show.
        const uint32_t above = std::min(row, uint32_t(reach)), below = std::min(settings.height - row - rows, uint32_t(reach));
        const size_t skip = size_t(above) * settings.width, count = size_t(rows) * settings.width;
        std::span<Rgba8> finished;
        for (uint32_t sample = 0; sample < settings.samples; ++sample) {
            GBuffer& gbuffer = sample == 0 ? first : others;
            const Strip strip = {row - above, above + rows + below, sample_offset_px(sample, settings.samples),
                                 {.splat_px = fill_reach + ssao_reach > 0 || (edl_reach > 0 && settings.edl.follow_splats), .ids = settings.with_ids && sample == 0}};
            if (scene.cloud != nullptr)
                draw_points(frame, *scene.cloud, chosen, strip, gbuffer);
            else
                clear_gbuffer(gbuffer, settings.width, strip.first_row, strip.rows, strip.wanted);
            if (fill_reach > 0) {
                if (gl_passes != nullptr)
                    gl_passes->fill_pass().fill(gbuffer, settings.fill, camera, settings.height);
                else
                    fill_holes(gbuffer, settings.fill, camera, settings.height, settings.threads);
                watch.lap("fill");
            }
            // Voxels, meshes and isosurfaces have no gaps to fill, and must not close those of points.
            if (!scene.voxels.empty()) {
                draw_voxels(frame, scene, strip, gbuffer);
                watch.lap("voxels");
            }
            if (!scene.meshes.empty()) {
                draw_meshes(frame, scene, strip, gbuffer);
                watch.lap("meshes");
            }
            if (!scene.isosurfaces.empty()) {
                draw_isosurfaces(frame, scene, strip, gbuffer);
                watch.lap("isosurfaces");
            }
            if (ssao_reach > 0) {
                if (gl_passes != nullptr)
                    gl_passes->ssao_pass().shade(gbuffer, settings.ssao, camera, settings.height);
                else
                    ssao.shade(gbuffer, settings.ssao, camera, settings.height, settings.threads);
                watch.lap("ssao");
            }
            finished = std::span(gbuffer.colors).subspan(skip, count);
            if (edl_reach > 0) {
                shaded.resize(count);
                if (gl_passes != nullptr)
                    gl_passes->edl_pass().shade(gbuffer, settings.edl, camera, settings.height, above, rows, shaded);
                else
                    shade_edl(gbuffer, settings.edl, camera, settings.height, above, rows, settings.threads, shaded);
                finished = shaded;
                watch.lap("edl");
            }
            fill_background(finished, settings.background, settings.threads);
            if (settings.samples > 1) sums.add(finished, sample == 0, settings.threads);
        }
        if (settings.samples > 1) {
            sums.average(finished, settings.threads);
            watch.lap("samples");
        }
        on_rows({row, rows, finished, std::span(first.depths).subspan(skip, count),
                 settings.with_ids ? std::span(first.ids).subspan(skip, count) : std::span<PixelId>()});
        watch.lap("output");
    }
    for (size_t i = 0; i < frame.meshes_seen.size(); ++i)
        if (frame.meshes_seen[i]) report.triangles_drawn += scene.meshes[i].mesh->triangles.size();
    if (report.points_drawn > 0) ms_per_point_ = (watch.total_ms() - chosen.loaded_ms) / double(report.points_drawn);
    if (frame.gpu_points != nullptr) report.uploaded_bytes = frame.gpu_points->uploaded_bytes() - uploaded_before;
    report.frame_ms = watch.total_ms();
    return report;
}

}  // namespace strata
