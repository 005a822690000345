#pragma once

#include <memory>

#include "render/gbuffer.h"
#include "render/pass/fill_settings.h"

namespace strata {

class EglContext;

/// Hole filling with GL. The context must be current while this lives.
class FillPass {
public:
    explicit FillPass(const EglContext& context);
    ~FillPass();

    /// Does what fill_holes() does, pixel by pixel.
    void fill(GBuffer& gbuffer, const FillSettings& settings, const Camera& camera, uint32_t height_px);

private:
    struct Resources;
    std::unique_ptr<Resources> resources_;
};

}  // namespace strata
