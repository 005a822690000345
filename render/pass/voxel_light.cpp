#include "render/pass/voxel_light.h"

#include <algorithm>

#include "render/srgb.h"

namespace strata {

const std::array<std::array<uint8_t, 256>, 256>& dimmed_colors() {
    static const auto table = [] {
        std::array<std::array<uint8_t, 256>, 256> made;
        for (size_t step = 0; step < 256; ++step)
            for (size_t color = 0; color < 256; ++color)
                made[step][color] = srgb8_from_linear(linear_from_srgb8()[color] * (float(step) / 255.0f));
        return made;
    }();
    return table;
}

Rgba8 lit(Rgba8 color, float light) {
    const auto& dim = dimmed_colors()[size_t(std::clamp(light, 0.0f, 1.0f) * 255.0f + 0.5f)];
    return make_rgba(dim[red_of(color)], dim[green_of(color)], dim[blue_of(color)], alpha_of(color));
}

}  // namespace strata
