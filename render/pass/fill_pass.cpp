#include "render/pass/fill_pass.h"

#include <array>
#include <bit>
#include <optional>
#include <vector>

#include "render/gl/egl_context.h"
#include "render/gl/program.h"
#include "render/gl/texture.h"
#include "render/pass/edl_settings.h"
#include "render/pass/gbuffer_textures.h"

namespace strata {
namespace {

struct Targets {
    Targets(uint32_t width, uint32_t height) : in(width, height), filled(TexelFormat::rgba32ui, width, height), framebuffer(filled) {}

    GBufferTextures in;
    Texture filled;
    Framebuffer framebuffer;
};

using Texel = std::array<uint32_t, 4>;  // color, bits of the depth, source, unused

}  // namespace

struct FillPass::Resources {
    Program program{"cover.vert", "fill.frag"};
    std::optional<Targets> targets;
    std::vector<Texel> texels;
};

FillPass::FillPass(const EglContext&) : resources_(std::make_unique<Resources>()) {}
FillPass::~FillPass() = default;

void FillPass::fill(GBuffer& gbuffer, const FillSettings& settings, const Camera& camera, uint32_t height_px) {
    Targets& targets = targets_for(resources_->targets, gbuffer);
    targets.in.upload(gbuffer);
    targets.in.bind(0);
    const Vec2f pixel_world = pixel_world_size(camera, height_px);
    const Program& program = resources_->program;
    program.set(0, int32_t(gbuffer.width), int32_t(gbuffer.rows));
    program.set(1, pixel_world.x(), pixel_world.y());
    program.set(2, settings.gap_px);
    program.set(3, int32_t(settings.follow_splats));
    program.set(4, int32_t(camera.projection == Projection::perspective));
    program.use();
    targets.framebuffer.draw_covering(gbuffer.rows);
    std::vector<Texel>& texels = resources_->texels;
    texels.resize(gbuffer.depths.size());
    targets.framebuffer.read_integers(0, gbuffer.rows, texels.data());

    // Splats and identities of others are read as they were.
    const std::vector<uint8_t> splats = gbuffer.splat_px;
    const std::vector<PixelId> ids = gbuffer.ids;
    for (size_t pixel = 0; pixel < texels.size(); ++pixel) {
        const auto& [color, depth_bits, place, unused] = texels[pixel];
        const size_t source = size_t(place & 0xffff) * gbuffer.width + (place >> 16);
        if (source == pixel) continue;
        gbuffer.colors[pixel] = color;
        gbuffer.depths[pixel] = std::bit_cast<float>(depth_bits);
        gbuffer.splat_px[pixel] = splats[source];
        if (!ids.empty()) gbuffer.ids[pixel] = ids[source];
    }
}

}  // namespace strata
