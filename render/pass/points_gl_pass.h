#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "render/pass/points_pass.h"

namespace strata {

class EglContext;
struct WordRows;

/// Rasterizes points with a compute shader: the twin of PointsPass::draw. Nodes stay in the GPU's memory from frame to frame.
/// The context must be current while this lives.
class PointsGlPass {
public:
    /// throws  Error{device} where the driver does not take the shader
    explicit PointsGlPass(const EglContext& context);
    ~PointsGlPass();

    /// Whether the shader draws such splats.
    static bool draws(const SplatStyle& style);

    /// Draws into words, whatever they hold. Draws twice, for depths and then for ranks: OpenGL itself has no atomics of 64 bits.
    /// cap_bytes  most GPU memory that points and words take, but for one chunk of points and 32 MiB; where a picture has more
    ///            points than fit, they are brought for each of the two
    /// throws     Error{device} where the GPU has no room
    void draw(const WordRows& target, std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style,
              uint64_t cap_bytes);

    /// Drops the nodes in the GPU's memory: those to come are of another cloud.
    void forget_nodes();
    uint64_t uploaded_bytes() const;  // of points, so far

private:
    struct Resources;
    std::unique_ptr<Resources> resources_;
};

}  // namespace strata
