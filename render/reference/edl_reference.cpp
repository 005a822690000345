#include "render/reference/edl_reference.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "render/srgb.h"

namespace strata {

double edl_response(const GBuffer& in, const EdlSettings& settings, const Vec2d& pixel_world, uint32_t height_px, int x, int y) {
    const auto depth_at = [&](int column, int row) -> std::optional<double> {
        if (column < 0 || row < 0 || column >= int(in.width) || row >= int(in.rows)) return std::nullopt;
        return in.depths[size_t(row) * in.width + size_t(column)];
    };
    const double depth = *depth_at(x, y), most = settings.most_response;
    const double unit = pixel_world.x() * depth + pixel_world.y();
    const int splat = settings.follow_splats ? int(in.splat_px[size_t(y) * in.width + size_t(x)]) : 0;
    double sum = 0.0;
    int counted = 0;
    for (int scale = 0; scale < EdlSettings::kScales; ++scale) {
        const int reach = std::max(settings.reach_px(height_px, scale), splat);
        const int diagonal = std::max(1, int(std::floor(reach * std::sqrt(0.5) + 0.5)));
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                if (dx == 0 && dy == 0) continue;
                const int step = dx != 0 && dy != 0 ? diagonal : reach;
                const double length = std::hypot(dx * step, dy * step) * unit;
                double slope;
                if (const auto neighbor = depth_at(x + dx * step, y + dy * step)) {
                    slope = (depth - *neighbor) / length;
                } else if (const auto opposite = depth_at(x - dx * step, y - dy * step)) {
                    slope = (*opposite - depth) / length;
                    if (slope > most) slope = 0.0;
                } else {
                    continue;
                }
                sum += std::clamp(slope, 0.0, most);
                ++counted;
            }
    }
    return counted > 0 ? sum / counted : 0.0;
}

Vec4d edl_shaded(const GBuffer& in, const EdlSettings& settings, const Vec2d& pixel_world, uint32_t height_px, int x, int y) {
    const size_t pixel = size_t(y) * in.width + size_t(x);
    const Rgba8 color = in.colors[pixel];
    Vec4d shaded(red_of(color), green_of(color), blue_of(color), alpha_of(color));
    if (in.depths[pixel] == kNoDepth) return shaded;
    const double shade = std::exp(-double(settings.strength) * edl_response(in, settings, pixel_world, height_px, x, y));
    for (int channel = 0; channel < 3; ++channel)
        shaded[channel] = 255.0 * srgb_from_linear(linear_from_srgb(shaded[channel] / 255.0) * shade);
    return shaded;
}

}  // namespace strata
