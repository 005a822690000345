#pragma once

#include <memory>
#include <span>

#include "core/math/camera.h"
#include "render/gbuffer.h"

namespace strata {

class EglContext;

/// Eye-dome lighting: shade = exp(-strength * mean response of 8 neighbours), response = how much nearer a neighbour is
/// over how far it lies sideways, both in world units. So a plane tilted by phi has the mean response
/// tan(phi) (1 + sqrt 2) / 8 at any resolution and distance, and one that faces the viewer has none.
struct EdlSettings {
    float strength = 0.7f;      // 0: off
    float radius_px = 2.0f;     // how far neighbours lie, at least
    bool follow_splats = true;  // neighbours lie a splat away where splats are larger, so that their rims do not show
    float most_response = 4.0f; // what a jump in depth counts for: the slope of 76 degrees

    /// Whole pixels to the neighbours along the axes. Those on the diagonals lie round(reach / sqrt 2) along each axis.
    int reach_px() const;
};

/// World units that a pixel covers: x * depth + y.
Vec2f pixel_world_size(const Camera& camera, uint32_t height_px);

/// Draws the pass with GL. The context must be current while this lives.
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
