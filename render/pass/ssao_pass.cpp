#include "render/pass/ssao_pass.h"

#include <array>
#include <optional>
#include <vector>

#include "render/gl/egl_context.h"
#include "render/gl/program.h"
#include "render/gl/texture.h"
#include "render/pass/edl_settings.h"
#include "render/pass/gbuffer_textures.h"
#include "render/pass/ssao_directions.h"

namespace strata {
namespace {

// A texture and what draws into it.
struct Plane {
    Plane(TexelFormat format, uint32_t width, uint32_t height) : texture(format, width, height), framebuffer(texture) {}

    Texture texture;
    Framebuffer framebuffer;
};

struct Targets {
    Targets(uint32_t width, uint32_t height)
        : in(width, height),
          surface(TexelFormat::rgba32f, (width + 1) / 2, (height + 1) / 2),
          other_surface(TexelFormat::rgba32f, (width + 1) / 2, (height + 1) / 2),
          slopes(TexelFormat::rgba32f, (width + 1) / 2, (height + 1) / 2),
          open(TexelFormat::r32f, (width + 1) / 2, (height + 1) / 2),
          blurred(TexelFormat::r32f, (width + 1) / 2, (height + 1) / 2),
          shaded(TexelFormat::rgba8, width, height) {}

    GBufferTextures in;
    Plane surface, other_surface, slopes, open, blurred, shaded;
};

// As ssao_occlude.frag reads them.
Texture upload_directions() {
    constexpr uint32_t kWidth = SsaoDirection::kSteps + 1, kHeight = 4 * kSsaoPhases;
    std::vector<std::array<float, 4>> texels;
    for (const SsaoDirections& directions : ssao_directions())
        for (const SsaoDirection& direction : directions) {
            for (const SsaoOffset& offset : direction.offsets) texels.push_back({float(offset.x), float(offset.y), offset.length_px, 0.0f});
            texels.push_back({direction.x, direction.y, 0.0f, 0.0f});
        }
    Texture texture(TexelFormat::rgba32f, kWidth, kHeight);
    texture.upload(texels.data(), kHeight);
    return texture;
}

}  // namespace

struct SsaoPass::Resources {
    Program sample{"cover.vert", "half_sample.frag"}, smooth{"cover.vert", "half_smooth.frag"}, slope{"cover.vert", "half_slope.frag"};
    Program occlude{"cover.vert", "ssao_occlude.frag"}, blur{"cover.vert", "ssao_blur.frag"}, apply{"cover.vert", "ssao_apply.frag"};
    Texture directions = upload_directions();
    std::optional<Targets> targets;
};

SsaoPass::SsaoPass(const EglContext&) : resources_(std::make_unique<Resources>()) {}
SsaoPass::~SsaoPass() = default;

void SsaoPass::shade(GBuffer& gbuffer, const SsaoSettings& settings, const Camera& camera, uint32_t height_px) {
    Resources& gl = *resources_;
    Targets& targets = targets_for(gl.targets, gbuffer);
    targets.in.upload(gbuffer);
    targets.in.bind(3);

    // Samples are the pixels with even places in the whole picture, so that strips do not show.
    const uint32_t first_odd = gbuffer.first_row % 2, half_width = (gbuffer.width + 1) / 2, half_rows = (gbuffer.rows - first_odd + 1) / 2;
    const int32_t first_half_row = int32_t(gbuffer.first_row + 1) / 2, perspective = camera.projection == Projection::perspective;
    const Vec2f pixel_world = pixel_world_size(camera, height_px);
    gl.sample.set(0, int32_t(first_odd));
    gl.sample.set(1, pixel_world.x(), pixel_world.y());
    gl.sample.set(2, perspective);
    gl.sample.use();
    targets.surface.framebuffer.draw_covering(half_rows);
    for (const Program* program : {&gl.smooth, &gl.slope, &gl.occlude, &gl.blur, &gl.apply})
        program->set(0, int32_t(half_width), int32_t(half_rows));
    const Plane *surface = &targets.surface, *other = &targets.other_surface;
    gl.smooth.use();
    for (const int32_t step : {1, 2, 4}) {
        gl.smooth.set(1, step);
        surface->texture.bind(0);
        other->framebuffer.draw_covering(half_rows);
        std::swap(surface, other);
    }
    surface->texture.bind(0);
    gl.slope.use();
    targets.slopes.framebuffer.draw_covering(half_rows);

    targets.slopes.texture.bind(1);
    gl.directions.bind(2);
    gl.occlude.set(1, pixel_world.x(), pixel_world.y());
    gl.occlude.set(2, perspective);
    gl.occlude.set(3, settings.radius);
    gl.occlude.set(4, float(SsaoSettings::kMostPx));
    gl.occlude.set(5, first_half_row);
    gl.occlude.set(6, int32_t(gbuffer.width), int32_t(height_px));
    gl.occlude.use();
    targets.open.framebuffer.draw_covering(half_rows);

    targets.open.texture.bind(2);
    gl.blur.use();
    targets.blurred.framebuffer.draw_covering(half_rows);

    targets.blurred.texture.bind(2);
    gl.apply.set(1, perspective);
    gl.apply.set(2, int32_t(gbuffer.first_row));
    gl.apply.set(3, first_half_row);
    gl.apply.use();
    targets.shaded.framebuffer.draw_covering(gbuffer.rows);
    targets.shaded.framebuffer.read(0, gbuffer.rows, gbuffer.colors.data());
}

}  // namespace strata
