#include "render/pass/edl_pass.h"

#include <optional>

#include "render/gl/egl_context.h"
#include "render/gl/program.h"
#include "render/gl/texture.h"
#include "render/pass/gbuffer_textures.h"

namespace strata {
namespace {

struct Targets {
    Targets(uint32_t width, uint32_t height) : in(width, height), shaded(TexelFormat::rgba8, width, height), framebuffer(shaded) {}

    GBufferTextures in;
    Texture shaded;
    Framebuffer framebuffer;
};

}  // namespace

struct EdlPass::Resources {
    Program program{"cover.vert", "edl.frag"};
    std::optional<Targets> targets;
};

EdlPass::EdlPass(const EglContext&) : resources_(std::make_unique<Resources>()) {}
EdlPass::~EdlPass() = default;

void EdlPass::shade(const GBuffer& in, const EdlSettings& settings, const Camera& camera, uint32_t height_px, uint32_t first,
                    uint32_t rows, std::span<Rgba8> out) {
    Targets& targets = targets_for(resources_->targets, in);
    targets.in.upload(in);
    targets.in.bind(0);
    const Vec2f pixel_world = pixel_world_size(camera, height_px);
    const Program& program = resources_->program;
    program.set(0, int32_t(in.width), int32_t(in.rows));
    program.set(1, pixel_world.x(), pixel_world.y());
    program.set(2, settings.strength);
    program.set(3, settings.reach_px(height_px, 0), settings.reach_px(height_px, 1), settings.reach_px(height_px, 2));
    program.set(4, settings.most_response);
    program.set(5, int32_t(settings.follow_splats));
    program.use();
    targets.framebuffer.draw_covering(in.rows);
    targets.framebuffer.read(first, rows, out.data());
}

}  // namespace strata
