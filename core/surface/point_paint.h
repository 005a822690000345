#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/surface/class_vote.h"
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
/// classes that of most weight. Where no point is near, gray and NaN. Hands pieces on, large ones in parts. Takes them as contour_bricks makes them, as the
/// window forgets layers of points that no later one can be near.
/// cost  beside the window 64 KB, and as much an attribute
class PointPaint : public SurfaceSink {
public:
    PointPaint(const PointPaintSettings& settings, const PointWindow& window, SurfaceSink& next) : settings_(settings), window_(window), next_(next) {}

    /// Vertices that no point was near.
    uint64_t unknown() const { return unknown_; }
    void add(const SurfacePiece& piece) override;

private:
    struct Say;
    static constexpr size_t kMostVertices = size_t{1} << 14;  // of a part

    void paint(const Vec3d& origin, std::span<const Vec3f> positions);
    void gather(const Vec3d& place, size_t layer, const std::array<std::shared_ptr<const PointLayer>, 3>& layers, std::vector<Say>& say) const;
    std::array<uint8_t, 4> mean_color(const std::vector<Say>& say) const;
    float value_of(size_t scalar, const std::vector<Say>& say, std::vector<ClassVote>& votes) const;

    PointPaintSettings settings_;
    const PointWindow& window_;
    SurfaceSink& next_;
    std::vector<std::array<uint8_t, 4>> colors_;
    std::vector<std::vector<float>> scalars_;
    uint64_t unknown_ = 0;
};

}  // namespace strata
