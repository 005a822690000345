#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "render/pass/points_pass.h"

namespace strata {

class EglContext;
struct LightSum;
struct WordRows;

/// Rasterizes points with a compute shader: the twin of PointsPass::draw. Nodes stay in the GPU's memory from frame to frame.
/// The context must be current while this lives.
class PointsGlPass {
public:
    /// throws  Error{device} where the driver does not take the shader
    explicit PointsGlPass(const EglContext& context);
    ~PointsGlPass();

    /// Draws into words, whatever they hold. Draws twice, for depths and then for ranks: OpenGL itself has no atomics of 64 bits.
    /// Gaussian splats take a third time, for the sums of their light.
    /// sums       as many as words, whatever they hold; for Gaussian splats alone, else nullptr
    /// cap_bytes  most GPU memory that points take, but for one chunk of them; where a picture has more they are brought each time.
    ///            Pixels take 8 bytes, those of Gaussian splats 40, and at most 64 MiB
    /// throws     Error{device} where the GPU has no room
    void draw(const WordRows& target, LightSum* sums, std::span<const PointNode> nodes, const PointProjection& projection,
              const SplatStyle& style, uint64_t cap_bytes);

    /// Drops the nodes in the GPU's memory: those to come are of another cloud.
    void forget_nodes();
    uint64_t uploaded_bytes() const;  // of points, so far

private:
    struct Resources;
    std::unique_ptr<Resources> resources_;
};

}  // namespace strata
