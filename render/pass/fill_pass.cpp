#include "render/pass/fill_pass.h"

#include <array>
#include <bit>
#include <optional>
#include <vector>

#include "render/gl/egl_context.h"
#include "render/gl/program.h"
#include "render/gl/texture.h"
#include "render/pass/edl_settings.h"

namespace strata {
namespace {

struct Targets {
    Targets(uint32_t width, uint32_t height)
        : colors(TexelFormat::rgba8, width, height),
          depths(TexelFormat::r32f, width, height),
          splats(TexelFormat::r8, width, height),
          filled(TexelFormat::rgba32ui, width, height),
          framebuffer(filled) {}

    Texture colors, depths, splats, filled;
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
    std::optional<Targets>& targets = resources_->targets;
    if (!targets || targets->colors.width() != gbuffer.width || targets->colors.height() < gbuffer.rows) {
        targets.reset();
        targets.emplace(gbuffer.width, gbuffer.rows);
    }
    targets->colors.upload(gbuffer.colors.data(), gbuffer.rows);
    targets->depths.upload(gbuffer.depths.data(), gbuffer.rows);
    targets->splats.upload(gbuffer.splat_px.data(), gbuffer.rows);
    targets->colors.bind(0);
    targets->depths.bind(1);
    targets->splats.bind(2);
    const Vec2f pixel_world = pixel_world_size(camera, height_px);
    const Program& program = resources_->program;
    program.set(0, int32_t(gbuffer.width), int32_t(gbuffer.rows));
    program.set(1, pixel_world.x(), pixel_world.y());
    program.set(2, settings.gap_px);
    program.set(3, int32_t(settings.follow_splats));
    program.set(4, int32_t(camera.projection == Projection::perspective));
    program.use();
    targets->framebuffer.draw_covering(gbuffer.rows);
    std::vector<Texel>& texels = resources_->texels;
    texels.resize(gbuffer.depths.size());
    targets->framebuffer.read_integers(0, gbuffer.rows, texels.data());

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
