#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/surface/point_layers.h"
#include "core/surface/point_window.h"
#include "core/surface/surface_sink.h"

namespace strata {

struct PointPaintSettings {
    PointGrid grid;
    PointForm form;       // what the points have: colors and scalars
    int color_bits = 8;   // of colors as stored
    double radius = 0.0;  // of what a point colors; world units, at most 8 spacings
    int threads = 1;
};

/// Gives the vertices of a surface made of points the colors and attributes of the points within a radius, near ones with more weight: means, of
/// classes that of most weight. Where no point is near, gray and NaN. Takes pieces in ascending order of k, as contour_bricks makes them, and forgets
/// layers of points that no later one can be near.
class PointPaint : public SurfaceSink {
public:
    PointPaint(const PointPaintSettings& settings, PointWindow& window, SurfaceSink& next) : settings_(settings), window_(window), next_(next) {}

    /// Vertices that no point was near.
    uint64_t unknown() const { return unknown_; }
    void add(const SurfacePiece& piece) override;

private:
    PointPaintSettings settings_;
    PointWindow& window_;
    SurfaceSink& next_;
    std::vector<std::array<uint8_t, 4>> colors_;
    std::vector<std::vector<float>> scalars_;
    uint64_t unknown_ = 0;
};

}  // namespace strata
