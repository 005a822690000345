#pragma once

#include <cstdint>
#include <optional>

#include "render/gbuffer.h"
#include "render/gl/texture.h"

namespace strata {

/// What passes read of a G-buffer, as textures: colors, depths, diameters of splats.
class GBufferTextures {
public:
    GBufferTextures(uint32_t width, uint32_t height)
        : colors_(TexelFormat::rgba8, width, height), depths_(TexelFormat::r32f, width, height), splats_(TexelFormat::r8, width, height) {}

    bool fits(const GBuffer& gbuffer) const { return colors_.width() == gbuffer.width && colors_.height() >= gbuffer.rows; }

    /// Replaces the first rows; splats only where the G-buffer has them.
    void upload(const GBuffer& gbuffer) {
        colors_.upload(gbuffer.colors.data(), gbuffer.rows);
        depths_.upload(gbuffer.depths.data(), gbuffer.rows);
        if (!gbuffer.splat_px.empty()) splats_.upload(gbuffer.splat_px.data(), gbuffer.rows);
    }
    /// Colors to `unit`, depths and splats to the two behind it.
    void bind(uint32_t unit) const {
        colors_.bind(unit);
        depths_.bind(unit + 1);
        splats_.bind(unit + 2);
    }

private:
    Texture colors_, depths_, splats_;
};

/// The targets of a pass, which have a GBufferTextures `in` and are made of a width and a height: new ones where the G-buffer does
/// not fit into those at hand.
template <typename Targets>
Targets& targets_for(std::optional<Targets>& targets, const GBuffer& gbuffer) {
    if (!targets || !targets->in.fits(gbuffer)) {
        targets.reset();  // its memory first
        targets.emplace(gbuffer.width, gbuffer.rows);
    }
    return *targets;
}

}  // namespace strata
