#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/gbuffer.h"
#include "render/pass/point_projection.h"
#include "render/stream/resident_node.h"

namespace strata {

/// Squares and discs face the viewer and have the depth of their center. A paraboloid lies in the plane of the surface
/// around its point, where that is known (PointShape), and falls back from it by its radius at the rim: so of splats that
/// overlap on a surface each pixel shows the one with the nearest center, however large they are.
enum class SplatShape { square, disc, paraboloid };

/// How points become splats. A splat covers the pixels whose centers lie in it, and always the one its center lies in.
struct SplatStyle {
    SplatShape shape = SplatShape::paraboloid;
    float fixed_px = 0.0f;        // diameter; 0: from the spacing of the points
    float least_px = 1.0f, most_px = 255.0f;  // clamps of adaptive sizes
    float spacing_factor = 2.0f;  // adaptive diameter over point spacing: a point lies within the spacing of all that it stands for

    float widest_px() const { return fixed_px > 0.0f ? fixed_px : most_px; }
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
/// wins by atomic maximum, so that equal depths go to the lower rank and the order of drawing does not show.
/// The compute-shader twin of the pass fills the same words.
class PointsPass {
public:
    /// Words of empty pixels are 0. first_row, rows: the part of the picture to fill
    PointsPass(uint32_t width, uint32_t first_row, uint32_t rows);

    /// cost  about 10 ns a point and thread at 1 px
    void draw(std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style, int threads);

    /// Turns words into color and eye depth, and what else the options ask for. nodes, projection, style: as drawn
    void resolve(std::span<const PointNode> nodes, const PointProjection& projection, const SplatStyle& style,
                 const ResolveOptions& options, int threads, GBuffer& out) const;

    std::span<const uint64_t> words() const { return words_; }

private:
    uint32_t width_, first_row_, rows_;
    std::vector<uint64_t> words_;
};

}  // namespace strata
