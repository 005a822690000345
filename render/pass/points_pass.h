#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/simd_level.h"
#include "render/gbuffer.h"
#include "render/pass/point_projection.h"
#include "render/stream/resident_node.h"

namespace strata {

class BandLocks;
struct LightSum;
struct WordRows;

/// Squares and discs face the viewer and have the depth of their center. A paraboloid lies in the plane of the surface
/// around its point, where that is known (PointShape), and falls back from it by its radius at the rim: so of splats that
/// overlap on a surface each pixel shows the one with the nearest center, however large they are. Gaussian splats are
/// paraboloids whose colors are averaged (blend_kernel.h). A surfel is a disc in the plane of the point's own normal, seen in
/// perspective, with that plane's depth at every pixel; without a normal it faces the viewer.
enum class SplatShape { square, disc, paraboloid, gaussian, surfel };

inline constexpr float kSurfelReach = 2.0f;  // radii, at most: the near half of a disc looks larger

/// How points become splats. A splat covers the pixels whose centers lie in it, and always the one its center lies in.
struct SplatStyle {
    SplatShape shape = SplatShape::paraboloid;
    float fixed_px = 0.0f;        // diameter; 0: from the spacing of the points
    float least_px = 1.0f, most_px = 255.0f;  // clamps of adaptive sizes
    float spacing_factor = 2.0f;  // adaptive diameter over point spacing: a point lies within the spacing of all that it stands for

    float widest_px() const { return fixed_px > 0.0f ? fixed_px : most_px; }
    /// How far a splat reaches from its point at most.
    float reach_px() const { return 0.5f * widest_px() * (shape == SplatShape::surfel ? kSurfelReach : 1.0f); }
};

/// What resolve gives beside color and depth.
struct ResolveOptions {
    bool splat_px = false;
    bool ids = false;
};

/// A node that is drawn. Slots are in key order, and first_rank is the number of points in the slots before.
struct PointNode {
    const ResidentNode* points = nullptr;
    uint32_t first_rank = 0;
    float top_row = 0.0f, bottom_row = 0.0f;  // rows of the whole picture that its points can touch
};

/// Rasterizes points into one 64-bit word a pixel, depth key above the complement of the point's rank: the largest word
/// wins, so that equal depths go to the lower rank and neither threads nor the order of drawing show.
/// PointsGlPass fills the same words.
class PointsPass {
public:
    PointsPass();
    ~PointsPass();

    /// Words of rows [first_row, first_row + rows) of a picture, whatever they hold: for PointsGlPass. Keeps its memory for the
    /// next time.
    WordRows resize(uint32_t width, uint32_t first_row, uint32_t rows);
    /// Sums of the pixels of as many rows with as much padding, which Gaussian splats are averaged from.
    LightSum* resize_sums();
    /// The words, empty.
    void clear(uint32_t width, uint32_t first_row, uint32_t rows, int threads);

    /// Draws into the rows that were cleared, once: Gaussian splats are then blended over what is nearest.
    /// level  what the processor has; never shows
    /// cost   about 5 ns a point and thread at 1 px; Gaussian splats take 32 bytes a pixel more
    void draw(std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style, int threads,
              SimdLevel level = best_simd_level());

    /// Turns words into color and eye depth, and what else the options ask for. nodes, projection, style: as drawn
    void resolve(std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style,
                 const ResolveOptions& options, int threads, GBuffer& out, SimdLevel level = best_simd_level()) const;

private:
    uint32_t width_ = 0, stride_ = 0, first_row_ = 0, rows_ = 0;
    size_t capacity_ = 0, sums_capacity_ = 0;  // words, sums
    std::unique_ptr<uint64_t[]> words_;
    std::unique_ptr<LightSum[]> sums_;  // none unless Gaussian splats were drawn
    std::unique_ptr<BandLocks> locks_;
};
inline constexpr uint64_t kBlendPixelBytes = 32;  // more a pixel for Gaussian splats

}  // namespace strata
