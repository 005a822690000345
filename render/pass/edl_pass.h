#pragma once

#include <memory>
#include <span>

#include "render/gbuffer.h"
#include "render/pass/edl_settings.h"

namespace strata {

class EglContext;

/// Eye-dome lighting with GL. The context must be current while this lives.
class EdlPass {
public:
    explicit EdlPass(const EglContext& context);
    ~EdlPass();

    /// Shades rows [first, first + rows) of the G-buffer (its splat_px filled if settings follow splats), counted from its own first row; the others serve as neighbours.
    void shade(const GBuffer& in, const EdlSettings& settings, const Camera& camera, uint32_t height_px, uint32_t first,
               uint32_t rows, std::span<Rgba8> out);

private:
    struct Resources;
    std::unique_ptr<Resources> resources_;
};

}  // namespace strata
