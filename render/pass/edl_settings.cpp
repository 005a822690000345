#include "render/pass/edl_settings.h"

#include <algorithm>
#include <cmath>

namespace strata {

int EdlSettings::reach_px(uint32_t height_px, int scale) const {
    return std::max(1, int(std::lround(double(radius) * height_px * (1 << scale))));
}

int diagonal_px(int reach_px) { return std::max(int(float(reach_px) * 0.70710678f + 0.5f), 1); }

Vec2f pixel_world_size(const Camera& camera, uint32_t height_px) {
    const float unit = float(1.0 / pixels_per_unit(camera, 1.0, height_px));
    return camera.projection == Projection::perspective ? Vec2f(unit, 0.0f) : Vec2f(0.0f, unit);
}

}  // namespace strata
