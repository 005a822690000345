#include "render/reference/edl_reference.h"

#include <algorithm>
#include <cmath>

#include "render/srgb.h"

namespace strata {

double edl_response(const GBuffer& in, const EdlSettings& settings, const Vec2d& pixel_world, int x, int y) {
    const size_t pixel = size_t(y) * in.width + size_t(x);
    const double depth = in.depths[pixel];
    const double unit = pixel_world.x() * depth + pixel_world.y();
    const int reach = std::max(settings.reach_px(), settings.follow_splats ? int(in.splat_px[pixel]) : 0);
    const int diagonal = std::max(1, int(std::floor(reach * std::sqrt(0.5) + 0.5)));
    double sum = 0.0;
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
            if (dx == 0 && dy == 0) continue;
            const int step = dx != 0 && dy != 0 ? diagonal : reach;
            const int nx = x + dx * step, ny = y + dy * step;
            if (nx < 0 || ny < 0 || nx >= int(in.width) || ny >= int(in.rows)) continue;
            const double neighbor = in.depths[size_t(ny) * in.width + size_t(nx)];
            const double slope = (depth - neighbor) / (std::hypot(dx * step, dy * step) * unit);
            sum += std::clamp(slope, 0.0, double(settings.most_response));
        }
    return sum / 8.0;
}

Vec4d edl_shaded(const GBuffer& in, const EdlSettings& settings, const Vec2d& pixel_world, int x, int y) {
    const size_t pixel = size_t(y) * in.width + size_t(x);
    const Rgba8 color = in.colors[pixel];
    Vec4d shaded(red_of(color), green_of(color), blue_of(color), alpha_of(color));
    if (in.depths[pixel] == kNoDepth) return shaded;
    const double shade = std::exp(-double(settings.strength) * edl_response(in, settings, pixel_world, x, y));
    for (int channel = 0; channel < 3; ++channel)
        shaded[channel] = 255.0 * srgb_from_linear(linear_from_srgb(shaded[channel] / 255.0) * shade);
    return shaded;
}

}  // namespace strata
