#pragma once

#include <memory>

#include "render/gbuffer.h"
#include "render/pass/ssao_kernel.h"

namespace strata {

class EglContext;

/// Ambient occlusion with GL. The context must be current while this lives.
class SsaoPass {
public:
    explicit SsaoPass(const EglContext& context);
    ~SsaoPass();

    /// Does what SsaoKernel::shade() does, pixel by pixel.
    void shade(GBuffer& gbuffer, const SsaoSettings& settings, const Camera& camera, uint32_t height_px);

private:
    struct Resources;
    std::unique_ptr<Resources> resources_;
};

}  // namespace strata
