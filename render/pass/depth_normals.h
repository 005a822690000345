#pragma once

#include <cstdint>
#include <vector>

#include "core/math/camera.h"
#include "render/gbuffer.h"

namespace strata {

/// Every second pixel of every second row of a G-buffer (those with even places in the whole picture, so that strips do not show) as a smooth
/// surface: nearness, which is linear across the picture on a plane, and its slopes. The relief of splats is smoothed away as
/// far as they reach; edges stay, as samples at other depths do not count.
/// All planes have kPad values on all sides, where there is nothing.
class HalfSurface {
public:
    static constexpr int kPad = 72;

    /// gbuffer  with splat_px
    void build(const GBuffer& gbuffer, const Camera& camera, uint32_t height_px, int threads);

    int width() const { return width_; }
    int rows() const { return rows_; }
    int first_row() const { return first_row_; }  // the half row of the whole picture that row 0 is
    size_t at(int x, int y) const { return size_t(y + kPad) * size_t(stride_) + size_t(x + kPad); }
    int stride() const { return stride_; }

    // [at(x, y)]
    std::vector<float> nearness;          // 1 / depth in perspective, -depth in orthographic projection; kNothing where there is nothing
    std::vector<float> px_per_nearness;   // nearness times this: a height towards the eye in what a pixel covers there
    std::vector<float> slope_x, slope_y;  // heights, as above, for each pixel of the whole picture to the right and downwards
    std::vector<float> splat_px;

    static constexpr float kNothing = -1e12f;

private:
    void sample(const GBuffer& gbuffer, const Camera& camera, uint32_t height_px, int threads);
    void smooth(int step, int threads);
    void measure_slopes(int threads);

    int width_ = 0, rows_ = 0, first_row_ = 0, stride_ = 0;
    std::vector<float> smoothed_;
};

}  // namespace strata
